"""One zip that runs on Windows without an installation: `make portable PYTHON_ZIP=python-3.12.8-embed-amd64.zip`.

PYTHON_ZIP is the official embeddable Python for Windows x64, from python.org. Made on Windows, or where a program
runs a Windows Python, that Python itself compiles the kernels which are brought along.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import kernels
import wheelhouse

_PACKAGES = "packages"
_START = r"""@echo off
rem Starts the workbench and shows it in the browser. Its data lie in the folder data beside this file.
title scancell
set PYTHONUTF8=1
"%~dp0python\python.exe" -m server.cli serve --open --data "%~dp0data" %*
if errorlevel 1 pause
"""
_COMMAND = r"""@echo off
set PYTHONUTF8=1
"%~dp0python\python.exe" -m server.cli %*
"""
_README = """scancell {version}, for Windows x64

Start.cmd         the workbench in the browser; its window ends it
scancell.cmd      the command line, as in: scancell.cmd run FOLDER
data              what you capture; it is made at the first start

Nothing else on this computer is changed: to remove it, remove this folder. At the first start the numerical
kernels are compiled for this processor, some minutes, while the workbench is used. To update, put the new folder
beside this one and move `data` into it.
"""
_WARM = ["-B", "-m", "server.cli", "warm", "--any-processor"]
_RUNTIME = re.compile(rb"(?i)\b((?:msvcp|vcomp|vcruntime|concrt)140\w*\.dll)\0")
_LACKS = """
This computer needs Microsoft's Visual C++ runtime (vc_redist.x64.exe), for {names}.
"""
_DROPPED = ("PYTHONPATH", "PYTHONHOME", "NUMBA_CACHE_DIR")
_IN_TURN = "import subprocess, sys; sys.exit(subprocess.call(sys.argv[1:]))"
_NEEDLESS = re.compile(r"(^|/)(__pycache__|tests?)/|\.(pyi|lib|pdb|h)$")


def unpack(python_zip: Path, into: Path) -> str:
    """Unpack Windows' Python and name the packages to it; return its version, such as `3.12`.

    Raises
    ------
    SystemExit
        If it is no embeddable Python.
    """
    with zipfile.ZipFile(python_zip) as archive:
        named = [re.fullmatch(r"python(3)(\d+)\.dll", name) for name in archive.namelist()]
        found = next((match for match in named if match), None)
        if found is None or "python.exe" not in archive.namelist():
            sys.exit(f"{python_zip}: need the embeddable Python of Windows x64, with python.exe in it.")
        archive.extractall(into)
    digits = f"{found[1]}{found[2]}"
    paths = [f"python{digits}.zip", ".", *(["Lib"] if (into / "lib").is_dir() or (into / "Lib").is_dir() else [])]
    for old in into.glob("python*._pth"):
        old.unlink()
    (into / f"python{digits}._pth").write_text("\n".join([*paths, f"..\\{_PACKAGES}", "import site", ""]))
    return f"{found[1]}.{found[2]}"


def install(wheels: list[Path], into: Path) -> None:
    """Unpack wheels into a folder, without what only builds and tests need."""
    for wheel in wheels:
        with zipfile.ZipFile(wheel) as archive:
            for name in archive.namelist():
                place = re.sub(r"^[^/]+\.data/(?:purelib|platlib)/", "", name)
                if name.endswith("/") or _NEEDLESS.search(name) or re.match(r"^[^/]+\.data/", place):
                    continue
                (into / place).parent.mkdir(parents=True, exist_ok=True)
                (into / place).write_bytes(archive.read(name))


def bring_runtime(top: Path, runtime: Path | None) -> list[str]:
    """Copy what the folder's programs need of Microsoft's runtime for C++; return what is neither there nor given.

    The embeddable Python has a part of it, and a Windows need not have the rest.
    """
    programs = [file for file in top.rglob("*") if file.suffix.lower() in (".dll", ".pyd")]
    needed = {name.decode().lower() for file in programs for name in _RUNTIME.findall(file.read_bytes())}
    for name in sorted(needed - {file.name.lower() for file in (top / "python").iterdir()}):
        if runtime is not None and (runtime / name).is_file():
            shutil.copy(runtime / name, top / "python")
    return sorted(needed - {file.name.lower() for file in (top / "python").iterdir()})


def compile_kernels(top: Path, starter: Path | None) -> None:
    """Have the folder's Python compile the kernels that it lacks, on Windows or by what runs a Windows Python."""
    python = str(top / "python" / "python.exe")
    command = [python, *_WARM] if starter is None else [str(starter), "-c", _IN_TURN, f"Z:{python}", *_WARM]
    environment = {name: value for name, value in os.environ.items() if name not in _DROPPED}
    subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=True)


def make(
    python_zip: Path,
    out: Path,
    house: Path | None,
    compiled: Path | None = None,
    starter: Path | None = None,
    runtime: Path | None = None,
) -> Path:
    """Write the portable zip.

    `house` is a wheelhouse for Windows, else one is made; `compiled` holds kernels; `starter` is a program that
    runs a Windows Python; `runtime` is a folder with Microsoft's runtime for C++.
    """
    with tempfile.TemporaryDirectory() as temporary:
        top = Path(temporary) / "scancell"
        version = unpack(python_zip, top / "python")
        wheels = (
            sorted(house.glob("*.whl")) if house else wheelhouse.make("windows", version, Path(temporary) / "w")
        )
        install(wheels, top / _PACKAGES)
        lacking = bring_runtime(top, runtime)
        if lacking:
            print(
                f"Lacks {', '.join(lacking)}: --runtime names a folder of Microsoft's redistributable.",
                file=sys.stderr,
            )
        for file in kernels.files_of(compiled) if compiled else []:
            (top / _PACKAGES / kernels.FOLDER).mkdir(exist_ok=True)
            shutil.copy(file, top / _PACKAGES / kernels.FOLDER)
        if starter is not None or os.name == "nt":
            compile_kernels(top, starter)
        own = next(wheel.name.split("-")[1] for wheel in wheels if wheel.name.startswith("scancell-"))
        readme = _README + (_LACKS.replace("{names}", ", ".join(lacking)) if lacking else "")
        for name, text in {"Start.cmd": _START, "scancell.cmd": _COMMAND, "README.txt": readme}.items():
            (top / name).write_bytes(text.replace("{version}", own).replace("\n", "\r\n").encode())
        out.mkdir(parents=True, exist_ok=True)
        made = shutil.make_archive(str(out / f"scancell-{own}-windows-x64"), "zip", temporary, "scancell")
        return Path(made)


def main() -> None:
    """Read the arguments, and make it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("python_zip", type=Path)
    parser.add_argument("out", type=Path, help="the folder to write it to")
    parser.add_argument("--wheelhouse", type=Path, help="one for Windows that is there already")
    where = (
        "packages\\calib_core\\kernels\\__pycache__ of this zip, after `scancell warm --any-processor` on Windows"
    )
    parser.add_argument("--kernels", type=Path, help=f"brought along: {where}")
    parser.add_argument(
        "--windows-python", type=Path, help="a program that runs a Windows Python: compiles kernels"
    )
    system = Path(os.environ["SYSTEMROOT"]) / "System32" if os.name == "nt" else None
    told = "a folder with Microsoft's runtime for C++, x64: VC/Redist/MSVC/…/x64 (on Windows, its own)"
    parser.add_argument("--runtime", type=Path, default=system, help=told)
    options = parser.parse_args()
    given = (options.wheelhouse, options.kernels, options.windows_python, options.runtime)
    made = make(options.python_zip, options.out, *given)
    print(f"{made}: {made.stat().st_size / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
