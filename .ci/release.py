"""What a release consists of, made and tried: `make release OUT=dist [PYTHON_ZIP=…] [SIGNING_KEY=…]`.

The wheel, the portable zip where Windows' Python is given, a list of parts (CycloneDX), notes of one page, and the
SHA-256 of each.  SIGNING_KEY is an ssh key with which the list of SHA-256 is signed: who has its public half
checks it by `ssh-keygen -Y verify`.
"""

import argparse
import hashlib
import json
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
import portable
import wheelhouse

SUMS = "SHA256SUMS"
PARTS = "parts.cdx.json"
NOTES = "NOTES.md"
_NOTES_LINES = 60
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


def list_of_parts(wheel: Path) -> dict[str, Any]:
    """Return the CycloneDX list of what a wheel installs with all extras, in the versions of the lock."""
    with zipfile.ZipFile(wheel) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        about = BytesParser().parsebytes(archive.read(name))
    digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
    parts = locked_parts(wheelhouse.LOCK.read_text(encoding="utf-8"))
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


def notes(changes: str) -> str:
    """Return the first section of the changes, at most one page of it."""
    section = re.split(r"^## ", changes, flags=re.MULTILINE)[1].strip().splitlines()
    kept = section[:_NOTES_LINES]
    while len(kept) < len(section) and kept and not section[len(kept)].startswith("- "):
        kept.pop()
    more = ["", "The rest stands in CHANGELOG.md."] if len(kept) < len(section) else []
    return "\n".join([f"# {kept[0]}", *kept[1:], *more, ""])


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


def make(out: Path, python_zip: Path | None, key: Path | None, house: Path | None) -> None:
    """Make all parts of a release in a folder."""
    out.mkdir(parents=True, exist_ok=True)
    wheel = wheelhouse.build(out)
    (out / PARTS).write_text(json.dumps(list_of_parts(wheel), indent=1) + "\n", encoding="utf-8")
    changes = (wheelhouse.ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    (out / NOTES).write_text(notes(changes), encoding="utf-8")
    if python_zip is not None:
        portable.make(python_zip, out, house)
    (out / SUMS).write_text(sums(out), encoding="utf-8")
    if key is not None:
        sign(out, key)
    check(out)


def main() -> None:
    """Read the arguments, and make it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--python-zip", type=Path, help="the embeddable Python of Windows: the portable zip too")
    parser.add_argument("--wheelhouse", type=Path, help="one for Windows that is there already")
    parser.add_argument("--signing-key", type=Path, help="an ssh key")
    options = parser.parse_args()
    make(options.out, options.python_zip, options.signing_key, options.wheelhouse)
    for path in sorted(options.out.iterdir()):
        print(f"{path.stat().st_size / 1e6:8.1f} MB  {path.name}")
    if options.signing_key is None:
        print("Not signed: --signing-key names a key.", file=sys.stderr)
    if options.python_zip is None:
        print("Without the portable zip: --python-zip names the embeddable Python of Windows.", file=sys.stderr)


if __name__ == "__main__":
    main()
