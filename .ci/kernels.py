"""Compiled kernels that a wheel or a portable folder brings along, for any x86-64 processor and one Python.

`scancell warm --any-processor` leaves them in `calib_core/kernels/__pycache__` of an installation. A wheel with
them is named after its Python, and installers take it before the one without.
"""

import base64
import hashlib
import re
import zipfile
from pathlib import Path

FOLDER = "calib_core/kernels/__pycache__"
_BROUGHT = (".nbi", ".nbc", ".compiled")


def files_of(folder: Path) -> list[Path]:
    """Return the files of kernels in a folder.

    Raises
    ------
    SystemExit
        If there are none.
    """
    found = sorted(file for file in folder.iterdir() if file.suffix in _BROUGHT)
    if not found:
        raise SystemExit(f"{folder}: need compiled kernels, of `scancell warm --any-processor`.")
    return found


def taken_from(archive: Path, into: Path) -> bool:
    """Take the kernels that a portable zip brings out into a folder; return whether it brings any."""
    with zipfile.ZipFile(archive) as given:
        names = [name for name in given.namelist() if f"/{FOLDER}/" in name and name.endswith(_BROUGHT)]
        for name in names:
            (into / Path(name).name).write_bytes(given.read(name))
    return bool(names)


def with_kernels(wheel: Path, folder: Path, tag: str) -> Path:
    """Write a wheel with the kernels of a folder beside a wheel without, such as for `cp312-none-win_amd64`."""
    made = wheel.with_name(re.sub(r"-py3-none-any\.whl$", f"-{tag}.whl", wheel.name))
    with zipfile.ZipFile(wheel) as given, zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as out:
        (record,) = [name for name in given.namelist() if name.endswith(".dist-info/RECORD")]
        contents = {name: given.read(name) for name in given.namelist() if name != record}
        about = record.replace("RECORD", "WHEEL")
        told = re.sub(r"^Tag: .*$", f"Tag: {tag}", contents[about].decode(), flags=re.MULTILINE)
        contents[about] = told.replace("Root-Is-Purelib: true", "Root-Is-Purelib: false").encode()
        contents |= {f"{FOLDER}/{file.name}": file.read_bytes() for file in files_of(folder)}
        lines = [_line(name, content) for name, content in contents.items()]
        for name, content in {**contents, record: "".join([*lines, f"{record},,\n"]).encode()}.items():
            out.writestr(name, content)
    return made


def _line(name: str, content: bytes) -> str:
    digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
    return f"{name},sha256={digest},{len(content)}\n"
