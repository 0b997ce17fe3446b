"""Compiled kernels: kept under the hash of all that they are made of, wherever there is room, and told of."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# A package of two kernels, one of which calls the other; the script prints how many are compiled.
_NEEDED = ("__init__.py", "compiled.py", "disk.py", "errors.py", "messages.py", "windows_runtime.py")
_CALLER = "from calib_core.kernels.callee import callee\n"
_KERNEL = "from numba import njit\n{}@njit(cache=True)\ndef {}(x):\n    return {}\n"
_SCRIPT = (
    "from calib_core import compiled; seen = []\n"
    "compiled.on_compiling.append(lambda: seen.append(1))\n"
    "from calib_core.kernels.caller import caller\n"
    "print(caller(1.0), len(seen))"
)


@pytest.fixture
def package(tmp_path: Path) -> Path:
    kernels = tmp_path / "calib_core" / "kernels"
    kernels.mkdir(parents=True)
    for name in (*_NEEDED, "kernels/__init__.py"):
        shutil.copy(ROOT / "calib_core" / name, kernels.parent / name)
    (kernels / "callee.py").write_text(_KERNEL.format("", "callee", "x + 1"))
    (kernels / "caller.py").write_text(_KERNEL.format(_CALLER, "caller", "10 * callee(x)"))
    return tmp_path


def ran(package: Path, script: str = _SCRIPT, **environment: str) -> list[str]:
    plain = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA")}
    done = subprocess.run(
        [sys.executable, "-B", "-c", script],
        cwd=package,
        env=plain | {"PYTHONPATH": str(package)} | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.split()


@pytest.mark.thorough
def test_a_change_of_a_called_kernel_is_seen(package: Path) -> None:
    assert ran(package) == ["20.0", "2"]
    assert ran(package) == ["20.0", "0"]  # nothing is compiled a second time
    (package / "calib_core" / "kernels" / "callee.py").write_text(_KERNEL.format("", "callee", "x + 2"))
    assert ran(package) == ["30.0", "2"]


@pytest.mark.thorough
def test_what_a_package_brings_is_taken_along_where_it_may_not_be_written(package: Path, tmp_path: Path) -> None:
    """As one that an administrator installed: read, and not written."""
    assert ran(package) == ["20.0", "2"]
    beside = package / "calib_core" / "kernels" / "__pycache__"
    home = tmp_path / "home"
    places = {"HOME": str(home), "XDG_CACHE_HOME": str(home / "cache"), "LOCALAPPDATA": str(home)}
    script = (
        "from numba.core import caching\nfrom calib_core import compiled\n"
        "def refused(*_): raise OSError\n"
        "caching.InTreeCacheLocator.ensure_cache_path = refused\n"
        "compiled.note_that_all_are_compiled()\nassert compiled.own_are_compiled()\n" + _SCRIPT
    )
    assert ran(package, script, **places) == ["20.0", "0"]
    (folder,) = {file.parent for file in home.rglob("*.nbc")}
    brought = {file.name for file in beside.glob("*.nb[ci]")}
    assert {file.name for file in folder.iterdir()} == brought


@pytest.mark.thorough
def test_all_is_noted_where_it_may_be_written(package: Path, tmp_path: Path) -> None:
    (package / "calib_core" / "kernels" / "__pycache__").write_text("a file: no folder can be made here")
    home = tmp_path / "home"
    places = {"HOME": str(home), "XDG_CACHE_HOME": str(home / "cache"), "LOCALAPPDATA": str(home)}
    asks = "from calib_core import compiled\nprint(compiled.own_are_compiled())\n"
    notes = "compiled.note_that_all_are_compiled()\nprint(compiled.own_are_compiled())"
    assert ran(package, asks + notes, **places) == ["False", "True"]
    assert ran(package, asks, **places) == ["True"]
    assert list(home.rglob("*.compiled"))


@pytest.mark.thorough
def test_a_package_that_may_not_be_written_is_compiled_elsewhere(package: Path, tmp_path: Path) -> None:
    (package / "calib_core" / "kernels" / "__pycache__").write_text("a file: no folder can be made here")
    home = tmp_path / "home"
    home.mkdir()
    places = {"HOME": str(home), "XDG_CACHE_HOME": str(home / "cache"), "LOCALAPPDATA": str(home)}
    assert ran(package, **places) == ["20.0", "2"]
    assert ran(package, **places) == ["20.0", "0"]
    assert list(home.rglob("*.nbc"))
    nowhere = dict.fromkeys(
        places, str(package / "calib_core" / "__init__.py")
    )  # no folder can be made there either
    assert ran(package, **nowhere) == ["20.0", "2"]
    asked = {**nowhere, "NUMBA_CACHE_DIR": str(tmp_path / "asked")}
    assert ran(package, **asked) == ["20.0", "2"]
    assert ran(package, **asked) == ["20.0", "0"]
