"""The portable zip, made with that Python in place of the embeddable one and started without a network."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.windows.windows_python import ROOT, Figure, here, outside, python, ran

sys.path.insert(0, str(ROOT / ".ci"))

import portable

_MOST_MB = 400
_KERNELS = """from calib_core import compiled
print(compiled.KERNELS, any(file.exists() for file in compiled.stamp_files(compiled.BASELINE)), sep="|")
"""
_NEEDLESS = ("include", "libs", "share", "tcl", "wine")


def python_zip(into: Path) -> Path:
    """Pack that Python, without its packages, as the embeddable one is packed."""
    asked = [python(), "-c", "import sys; print(sys.base_prefix)"]
    done = subprocess.run(asked, env=outside(), capture_output=True, text=True, check=True)
    prefix = here(done.stdout.strip())
    with zipfile.ZipFile(into, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for file in sorted(path for path in prefix.rglob("*") if path.is_file()):
            name = file.relative_to(prefix)
            if "site-packages" in name.parts or "__pycache__" in name.parts or name.parts[0].lower() in _NEEDLESS:
                continue
            archive.write(file, name.as_posix())
    return into


def compiled(program: list[str], place: Path) -> Path:
    """Compile the kernels with that Python, for any processor, unless they are there; return where they lie."""
    asked = [python(), "-P", "-c", _KERNELS]  # else it finds the checkout's, where the tests are run
    folder, there = subprocess.run(asked, env=outside(), capture_output=True, text=True, check=True).stdout.split(
        "|"
    )
    if there.strip() != "True":
        ran(program, place, "warm", "--any-processor")
    return here(folder) / "__pycache__"


@pytest.mark.skipif(shutil.which("unshare") is None, reason="nothing here takes the network away")
def test_it_starts_without_a_network_from_a_path_with_a_space_and_shows_the_demo(
    program: list[str], place: Path, tmp_path: Path, figure: Figure
) -> None:
    given, house = (os.environ.get(name) for name in ("WINDOWS_PORTABLE", "WINDOWS_WHEELHOUSE"))
    if given:
        made = Path(given)
    else:
        wheels = Path(house) if house else None
        made = portable.make(
            python_zip(tmp_path / "python.zip"), tmp_path / "out", wheels, compiled(program, place)
        )
    size_mb = made.stat().st_size / 1e6
    folder = tmp_path / "Meßzelle ü 4"
    with zipfile.ZipFile(made) as archive:
        unpacked_mb = sum(one.file_size for one in archive.infolist()) / 1e6
        archive.extractall(folder)
    brought = set(folder.rglob("*.nbc"))
    command = ["unshare", "-rn", "sh", "-c", 'ip link set lo up && exec "$@"', "sh", sys.executable, "-m"]
    command += [
        "tests.windows.portable_visit",
        str(python()),
        str(folder / "scancell"),
        str(tmp_path / "page.png"),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout.strip().splitlines()[-1])
    assert found["captures"] == 5
    assert size_mb <= _MOST_MB
    compiled_there = set(folder.rglob("*.nbc")) - brought
    assert brought
    assert not compiled_there
    what = "portable zip with a stand-in for the embeddable Python"
    figure(what, f"≤ {_MOST_MB} MB", f"{size_mb:.0f} MB, {unpacked_mb:.0f} MB unpacked")
    shown = f"works, {found['captures']} captures, scene shown, {len(brought)} kernels brought, 0 compiled"
    figure("portable zip, no network, path with space and ü: Start.cmd, page, demo session", "works", shown)
