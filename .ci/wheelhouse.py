"""All wheels for an installation without a network, for a named platform: `make wheelhouse PLATFORM=windows`.

Versions are the lock's; which of them a platform needs, uv decides by that platform's own markers (pip would ask
those of the machine that this runs on).
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LOCK = ROOT / "requirements-image.lock"
_GLIBC = range(17, 36)

PLATFORMS: dict[str, tuple[str, list[str]]] = {
    "windows": ("x86_64-pc-windows-msvc", ["win_amd64"]),
    "linux": ("x86_64-manylinux_2_35", [f"manylinux_2_{n}_x86_64" for n in _GLIBC] + ["manylinux2014_x86_64"]),
    "linux-arm": (
        "aarch64-manylinux_2_35",
        [f"manylinux_2_{n}_aarch64" for n in _GLIBC] + ["manylinux2014_aarch64"],
    ),
    "macos-arm": (
        "aarch64-apple-darwin",
        [f"macosx_{n}_0_{kind}" for n in range(11, 16) for kind in ("arm64", "universal2")],
    ),
}
"""By name: as uv calls it, and the tags of wheels that run there."""


def requirements(platform: str, python: str, extras: tuple[str, ...] = ()) -> list[str]:
    """Return what must be installed on a platform, each with the version of the lock.

    Raises
    ------
    SystemExit
        If uv finds no way: with what it says.
    """
    asked = [sys.executable, "-m", "uv", "pip", "compile", str(ROOT / "pyproject.toml"), "--constraint", str(LOCK)]
    asked += ["--python-platform", PLATFORMS[platform][0], "--python-version", python, "--only-binary", ":all:"]
    asked += ["--no-header", "--no-annotate", "--quiet", *(word for name in extras for word in ("--extra", name))]
    done = subprocess.run(asked, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{platform}, Python {python}: {done.stderr.strip()}")
    return [line for line in done.stdout.splitlines() if "==" in line]


def build(out: Path, source: Path = ROOT) -> Path:
    """Build the project's own wheel, or that of a folder of it, into a folder; return it."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", folder]
        subprocess.run(command, cwd=source, capture_output=True, check=True)
        (wheel,) = Path(folder).glob("*.whl")
        return Path(shutil.copy(wheel, out / wheel.name))


def make(platform: str, python: str, out: Path, extras: tuple[str, ...] = ()) -> list[Path]:
    """Fill a folder with every wheel, the project's own too; return them."""
    out.mkdir(parents=True, exist_ok=True)
    wanted = requirements(platform, python, extras)
    listed = out / "requirements.txt"
    listed.write_text("\n".join(wanted) + "\n", encoding="utf-8")
    tags = [word for tag in PLATFORMS[platform][1] for word in ("--platform", tag)]
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary=:all:", *tags]
    command += [
        "--implementation",
        "cp",
        "--python-version",
        python,
        "--dest",
        str(out),
        "--requirement",
        str(listed),
    ]
    subprocess.run(command, check=True)
    build(out)
    return sorted(out.glob("*.whl"))


def main() -> None:
    """Read the arguments, and make it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("platform", choices=PLATFORMS)
    parser.add_argument("out", type=Path, help="the folder to fill")
    parser.add_argument("--python", default="3.12", help="of the machine that it is for (%(default)s)")
    parser.add_argument("--extra", action="append", default=[], help="an extra of scancell, such as opcua")
    options = parser.parse_args()
    wheels = make(options.platform, options.python, options.out, tuple(options.extra))
    size = sum(wheel.stat().st_size for wheel in wheels)
    print(f"{options.out}: {len(wheels)} wheels, {size / 1e6:.0f} MB. There, without a network:")
    print(f"  python -m pip install --no-index --find-links {options.out.name} scancell")


if __name__ == "__main__":
    main()
