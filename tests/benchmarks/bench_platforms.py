"""Whether every requirement has a wheel, platform by platform and Python by Python; asks the package registry.

`full` fills a wheelhouse for this machine too, and installs it where there is no network.
"""

import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from harness import Row

ROOT = Path(__file__).resolve().parents[2]

PLATFORMS = {
    "Windows x64": "x86_64-pc-windows-msvc",
    "Linux x86_64, glibc 2.35": "x86_64-manylinux_2_35",
    "Linux ARM64, glibc 2.35": "aarch64-manylinux_2_35",
    "macOS ARM": "aarch64-apple-darwin",
    "Linux x86_64, glibc 2.28": "x86_64-manylinux_2_28",
}
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
NOT_PROMISED = ("Linux x86_64, glibc 2.28",)
_ALONE = ["unshare", "--map-root-user", "--net"]
_LACKING = re.compile(r"[Bb]ecause(?: only)? ([\w.-]+)")


def run(full: bool) -> Iterator[Row]:
    """Resolve the base requirements by wheels alone; `full` takes every Python, else the oldest and the newest."""
    pythons = PYTHONS if full else (PYTHONS[0], PYTHONS[-1])
    for name, called in PLATFORMS.items():
        lacking = {python: what for python in pythons if (what := _lacking(called, python))}
        told = "; ".join(f"{python}: {what}" for python, what in lacking.items())
        target = "told" if name in NOT_PROMISED else "all"
        holds = None if name in NOT_PROMISED else not lacking
        yield Row(f"{name}, Python {', '.join(pythons)}", target, f"lacks {told}" if lacking else "all", holds)

    if full:
        yield _without_a_network()


def _without_a_network() -> Row:
    """Return whether a wheelhouse for this machine is installed, and a session solved, without a network."""
    what, target = "a wheelhouse for this machine, installed and a session solved without a network", "done"
    if shutil.which("unshare") is None or platform.system() != "Linux":
        return Row(what, target, "not tried: nothing here takes the network away")
    name = "linux-arm" if platform.machine() == "aarch64" else "linux"
    python = ".".join(platform.python_version_tuple()[:2])
    with tempfile.TemporaryDirectory() as temporary:
        house, bin_ = Path(temporary) / "wheels", Path(temporary) / "there" / "bin"
        make = [sys.executable, str(ROOT / ".ci" / "wheelhouse.py"), name, str(house), "--python", python]
        told = ""
        for command in (
            make,
            [sys.executable, "-m", "venv", str(bin_.parent)],
            [
                *_ALONE,
                str(bin_ / "pip"),
                "install",
                "--quiet",
                "--no-index",
                "--find-links",
                str(house),
                "scancell",
            ],
            [*_ALONE, str(bin_ / "scancell"), "simulate", "tcp", "--seed", "3", "--out", f"{temporary}/cell"],
            [*_ALONE, str(bin_ / "scancell"), "run", f"{temporary}/cell"],
        ):
            done = subprocess.run(
                command, cwd=temporary, capture_output=True, text=True, env=_outside(), check=False
            )
            if done.returncode:
                told = f"{Path(command[-1]).name}: {done.stderr.strip()[-200:]}"
                break
        wheels = len(list(house.glob("*.whl")))
    return Row(what, target, told or f"done, {wheels} wheels", not told)


def _outside() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}


def _lacking(called: str, python: str) -> str:
    """Return which requirement has no wheel there, nothing where all have."""
    command = [
        sys.executable,
        "-m",
        "uv",
        "pip",
        "compile",
        str(ROOT / "pyproject.toml"),
        "--quiet",
        "--no-header",
    ]
    command += ["--python-platform", called, "--python-version", python, "--only-binary", ":all:"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not done.returncode:
        return ""
    found = _LACKING.search(done.stderr)
    return found[1] if found else " ".join(done.stderr.split())[:80]
