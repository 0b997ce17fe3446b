"""What a release is made of, and tried: `make release OUT=dist [PYTHON_ZIP=…] [SIGNING_KEY=…] [IMAGE_TOOL=…]`.

The wheels, on Linux one with compiled kernels for each Python at hand, the portable zip where Windows' Python is
given (and a wheel with its kernels where these are), the image where podman or docker is named, a list of parts
(CycloneDX), notes of one page, and the SHA-256 of each; all are read again, and each Linux wheel solves a session.
SIGNING_KEY is an ssh key with which the list of SHA-256 is signed: who has its public half checks it by
`ssh-keygen -Y verify`.
"""

import argparse
import hashlib
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
import uuid
import zipfile
from email.parser import BytesParser
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
import clean_environment
import kernels
import portable
import wheelhouse

SUMS = "SHA256SUMS"
PARTS = "parts.cdx.json"
NOTES = "NOTES.md"
_NOTES_LINES = 60
_PYTHONS = ("3.11", "3.12", "3.13", "3.14")
_LOCKED = re.compile(r"^([\w.-]+)==([^\s;\\]+)", re.MULTILINE)
_HASH = re.compile(r"--hash=sha256:([0-9a-f]{64})")


def locked_parts(lock: str) -> list[dict[str, Any]]:
    """Return the parts that a lock file names, each with version, package URL and the SHA-256 of its files."""
    starts = [*_LOCKED.finditer(lock)]
    ends = [*(match.start() for match in starts[1:]), len(lock)]
    return [
        {
            "type": "library",
            "bom-ref": f"pkg:pypi/{match[1].lower()}@{match[2]}",
            "name": match[1],
            "version": match[2],
            "purl": f"pkg:pypi/{match[1].lower()}@{match[2]}",
            "hashes": [{"alg": "SHA-256", "content": h} for h in _HASH.findall(lock[match.start() : end])],
        }
        for match, end in zip(starts, ends, strict=True)
    ]


def parts_of_the_page() -> list[dict[str, Any]]:
    """Return what the page brings of others: folders of `web/vendor`, whose READMEs tell version and package."""
    found: list[dict[str, Any]] = []
    for readme in sorted((wheelhouse.ROOT / "web" / "vendor").glob("*/README.md")):
        told = re.search(r"^\D*(\d[\d.]*\d).*?npm package `([^`]+)`", readme.read_text(encoding="utf-8"))
        assert told is not None, readme
        files = sorted(file for file in readme.parent.iterdir() if file.suffix in (".js", ".css"))
        hashes = [{"alg": "SHA-256", "content": hashlib.sha256(file.read_bytes()).hexdigest()} for file in files]
        purl = f"pkg:npm/{told[2]}@{told[1]}"
        part = {"type": "library", "bom-ref": purl, "name": told[2], "version": told[1], "purl": purl}
        found.append({**part, "hashes": hashes})
    return found


def part_of_python(python_zip: Path) -> dict[str, Any]:
    """Return Windows' Python, which the portable zip has, as a part."""
    with tempfile.TemporaryDirectory() as folder:
        version = portable.unpack(python_zip, Path(folder))
    digest = hashlib.sha256(python_zip.read_bytes()).hexdigest()
    part = {"type": "platform", "bom-ref": "python-windows", "name": "CPython for Windows x64", "version": version}
    return {**part, "hashes": [{"alg": "SHA-256", "content": digest}]}


def unlisted(parts: dict[str, Any], installed: set[str]) -> list[str]:
    """Return what is installed, as `name==version`, and not named in a list of parts."""
    named = [parts["metadata"]["component"], *parts["components"]]
    return sorted(installed - {f"{part['name']}=={part['version']}".lower().replace("_", "-") for part in named})


def list_of_parts(wheel: Path) -> dict[str, Any]:
    """Return the CycloneDX list of what a wheel installs with all extras, in the versions of the lock."""
    with zipfile.ZipFile(wheel) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        about = BytesParser().parsebytes(archive.read(name))
    digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
    parts = [*locked_parts(wheelhouse.LOCK.read_text(encoding="utf-8")), *parts_of_the_page()]
    own = f"pkg:pypi/scancell@{about['Version']}"
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, digest)}",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application",
                "bom-ref": own,
                "name": "scancell",
                "version": about["Version"],
                "purl": own,
                "licenses": [{"license": {"id": "Apache-2.0"}}],
                "hashes": [{"alg": "SHA-256", "content": digest}],
            }
        },
        "components": parts,
        "dependencies": [{"ref": own, "dependsOn": [part["bom-ref"] for part in parts]}],
    }


def notes(changes: str, wheels: list[str]) -> str:
    """Return the first section of the changes, at most one page of it, and which wheels bring kernels."""
    section = re.split(r"^## ", changes, flags=re.MULTILINE)[1].strip().splitlines()
    kept = section[:_NOTES_LINES]
    while len(kept) < len(section) and kept and not section[len(kept)].startswith("- "):
        kept.pop()
    more = ["", "The rest stands in CHANGELOG.md."] if len(kept) < len(section) else []
    fast = ", ".join(name for name in wheels if not name.endswith("-any.whl")) or "none"
    told = ["", f"Wheels with compiled kernels: {fast}. Any other installation compiles them at its first start."]
    return "\n".join([f"# {kept[0]}", *kept[1:], *more, *told, ""])


def sums(folder: Path) -> str:
    """Return the SHA-256 of all files in a folder, as `sha256sum --check` takes them."""
    files = sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith(SUMS))
    return "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files)


def sign(folder: Path, key: Path) -> None:
    """Sign the list of SHA-256, and check the signature as others would."""
    listed = folder / SUMS
    subprocess.run(["ssh-keygen", "-q", "-Y", "sign", "-f", str(key), "-n", "scancell", str(listed)], check=True)
    public = key.with_name(key.name + ".pub").read_text(encoding="utf-8").split()
    with tempfile.TemporaryDirectory() as temporary:
        signers = Path(temporary) / "signers"
        signers.write_text(f"release {public[0]} {public[1]}\n", encoding="utf-8")
        command = ["ssh-keygen", "-Y", "verify", "-f", str(signers), "-I", "release", "-n", "scancell"]
        command += ["-s", str(listed) + ".sig"]
        subprocess.run(command, input=listed.read_bytes(), capture_output=True, check=True)


def check(folder: Path) -> None:
    """Read all that was made again: SHA-256, zips, the list of parts; raises AssertionError."""
    for line in (folder / SUMS).read_text(encoding="utf-8").splitlines():
        digest, name = line.split("  ")
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest, name
    for archive in [*folder.glob("*.whl"), *folder.glob("*.zip")]:
        assert zipfile.ZipFile(archive).testzip() is None, archive
    assert json.loads((folder / PARTS).read_text(encoding="utf-8"))["components"]


_DROPPED = ("PYTHONPATH", "NUMBA_CACHE_DIR")


def _ran(programs: Path, *words: str) -> bytes:
    environment = {name: value for name, value in os.environ.items() if name not in _DROPPED}
    command = [str(programs / "scancell"), *words]
    return subprocess.run(command, cwd=programs, env=environment, capture_output=True, check=True).stdout


def try_out(wheel: Path, python: str, parts: dict[str, Any]) -> None:
    """Install a wheel where nothing else is, look for parts that are not listed, and solve a session."""
    with tempfile.TemporaryDirectory() as folder:
        programs = clean_environment.make(Path(folder) / "environment", wheel, python)
        assert unlisted(parts, clean_environment.installed(programs)) == []
        if not wheel.name.endswith("-any.whl"):
            assert json.loads(_ran(programs, "warm", "--any-processor", "--json"))["compiled"] == 0
        for words in (["--version"], ["simulate", "tcp", "--seed", "3", "--out", "cell"], ["run", "cell"]):
            _ran(programs, *words)


def pythons() -> dict[str, str]:
    """Return the Pythons that are at hand here, of those that scancell runs on: versions and programs."""
    found: dict[str, str] = {}
    for version in _PYTHONS:
        command = [sys.executable, "-m", "uv", "python", "find", "--system", "--no-python-downloads", version]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            found[version] = done.stdout.strip()
    return found


def wheel_with_kernels(wheel: Path, version: str, python: str) -> Path:
    """Compile the kernels with a Python, where the wheel is installed alone; write the wheel that has them."""
    tag = f"cp{version.replace('.', '')}-none-manylinux_2_28_x86_64"
    with tempfile.TemporaryDirectory() as folder:
        programs = clean_environment.make(Path(folder) / "environment", wheel, python)
        _ran(programs, "warm", "--any-processor")
        (compiled,) = Path(folder).glob(f"environment/lib/*/site-packages/{kernels.FOLDER}")
        return kernels.with_kernels(wheel, compiled, tag)


def image(out: Path, version: str, tool: str) -> None:
    """Build the image by podman or docker, have it say its version, and keep it as a file."""
    name, file = f"scancell:{version}", out / f"scancell-{version}-image.tar"
    form = ["--format", "docker"] if Path(tool).name == "podman" else []
    build = [tool, "build", *form, "--tag", name, "--file", "Containerfile", "."]
    subprocess.run(build, cwd=wheelhouse.ROOT, check=True)
    subprocess.run([tool, "run", "--rm", name, "scancell", "--version"], check=True)
    subprocess.run([tool, "save", "--output", str(file), name], check=True)


def make(
    out: Path,
    python_zip: Path | None,
    key: Path | None,
    house: Path | None,
    image_tool: str | None = None,
    compiled: Path | None = None,
    starter: Path | None = None,
    runtime: Path | None = None,
    *,
    compiles: bool = True,
) -> dict[Path, str]:
    """Make all parts of a release in a folder, and read them again; return the wheels to try, with their Pythons.

    `compiled` holds kernels for the portable zip, and `starter`, a program that runs a Windows Python, completes
    them; `compiles`: whether there are wheels with those of Pythons here.
    """
    out.mkdir(parents=True, exist_ok=True)
    wheel = wheelhouse.build(out)
    wheelhouse.build(out, wheelhouse.ROOT / "scancell_client")
    parts, made = list_of_parts(wheel), {}
    if compiles and (sys.platform, platform.machine()) == ("linux", "x86_64"):
        made = {wheel_with_kernels(wheel, *python): python[1] for python in pythons().items()}
    if python_zip is not None:
        zipped = portable.make(python_zip, out, house, compiled, starter, runtime)
        parts["components"].append(windows := part_of_python(python_zip))
        with tempfile.TemporaryDirectory() as folder:
            if kernels.taken_from(zipped, Path(folder)):
                tag = f"cp{windows['version'].replace('.', '')}-none-win_amd64"
                kernels.with_kernels(wheel, Path(folder), tag)
    if image_tool is not None:
        image(out, parts["metadata"]["component"]["version"], image_tool)
    (out / PARTS).write_text(json.dumps(parts, indent=1) + "\n", encoding="utf-8")
    changes = (wheelhouse.ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    (out / NOTES).write_text(
        notes(changes, sorted(file.name for file in out.glob("scancell-*.whl"))), encoding="utf-8"
    )
    (out / SUMS).write_text(sums(out), encoding="utf-8")
    if key is not None:
        sign(out, key)
    check(out)
    return made or {wheel: sys.executable}


def main() -> None:
    """Read the arguments, and make it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--python-zip", type=Path, help="the embeddable Python of Windows: the portable zip too")
    parser.add_argument("--wheelhouse", type=Path, help="one for Windows that is there already")
    parser.add_argument("--kernels", type=Path, help="compiled for the portable zip: see portable.py")
    parser.add_argument("--windows-python", type=Path, help="a program that runs one: see portable.py")
    parser.add_argument("--runtime", type=Path, help="Microsoft's, for C++: see portable.py")
    parser.add_argument("--signing-key", type=Path, help="an ssh key")
    parser.add_argument("--image-tool", help="podman or docker: the image too")
    options = parser.parse_args()
    given = (options.python_zip, options.signing_key, options.wheelhouse, options.image_tool, options.kernels)
    for wheel, python in make(options.out, *given, options.windows_python, options.runtime).items():
        try_out(wheel, python, list_of_parts(wheel))
    for path in sorted(options.out.iterdir()):
        print(f"{path.stat().st_size / 1e6:8.1f} MB  {path.name}")
    if options.signing_key is None:
        print("Not signed: --signing-key names a key.", file=sys.stderr)
    if options.image_tool is None:
        print("Without the image: --image-tool names podman or docker.", file=sys.stderr)
    if options.python_zip is None:
        print("Without the portable zip: --python-zip names the embeddable Python of Windows.", file=sys.stderr)


if __name__ == "__main__":
    main()
