"""What a release is made of: the list of parts, hashes, a signature, notes, and the portable zip's folder."""

import hashlib
import json
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / ".ci"))

import kernels  # noqa: E402
import portable  # noqa: E402
import release  # noqa: E402
import wheelhouse  # noqa: E402


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return wheelhouse.build(tmp_path_factory.mktemp("wheel"))


@pytest.fixture
def python_zip(tmp_path: Path) -> Path:
    """What stands for the embeddable Python: its names alone."""
    file = tmp_path / "python.zip"
    with zipfile.ZipFile(file, "w") as archive:
        for name in ("python.exe", "python3.dll", "python312.dll", "python312.zip"):
            archive.writestr(name, b"MZ")
        archive.writestr("python312._pth", "python312.zip\n.\n#import site\n")
    return file


def test_the_list_of_parts_is_the_locks_each_with_its_hashes(wheel: Path) -> None:
    parts = release.list_of_parts(wheel)
    lock = wheelhouse.LOCK.read_text(encoding="utf-8")
    locked = [part for part in parts["components"] if part["purl"].startswith("pkg:pypi/")]
    others = [part["name"] for part in parts["components"] if part not in locked]
    assert others == ["swagger-ui-dist"]
    assert len(others) == len([*(ROOT / "web" / "vendor").iterdir()])
    listed = {(part["name"], part["version"]) for part in locked}
    assert listed == set(re.findall(r"^([\w.-]+)==(\S+?)(?:\s|;|$)", lock, re.MULTILINE))
    assert len(listed) > 80
    hashes = [one["content"] for part in locked for one in part["hashes"]]
    assert hashes == re.findall(r"sha256:([0-9a-f]{64})", lock)
    assert all(part["hashes"] for part in parts["components"])
    own = parts["metadata"]["component"]
    assert own["hashes"][0]["content"] == hashlib.sha256(wheel.read_bytes()).hexdigest()
    assert set(parts["dependencies"][0]["dependsOn"]) == {part["bom-ref"] for part in parts["components"]}


@pytest.mark.thorough
def test_a_release_is_hashed_and_signed_and_read_again(tmp_path: Path) -> None:
    if shutil.which("ssh-keygen") is None:
        pytest.skip("no ssh-keygen here")
    key, out = tmp_path / "key", tmp_path / "dist"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(key)], check=True)
    release.make(out, None, key, None, compiles=False)
    names = {path.name for path in out.iterdir()}
    assert {"SHA256SUMS", "SHA256SUMS.sig", "NOTES.md", "parts.cdx.json"} <= names
    wheels = {path.name for path in out.glob("*.whl")}
    assert {name.split("-")[0] for name in wheels} == {"scancell", "scancell_client"}
    told = (out / "SHA256SUMS").read_text()
    assert all(name in told for name in wheels)
    assert json.loads((out / "parts.cdx.json").read_text(encoding="utf-8"))["bomFormat"] == "CycloneDX"
    (out / "NOTES.md").write_text("altered")
    with pytest.raises(AssertionError, match=r"NOTES\.md"):
        release.check(out)


def test_the_notes_are_one_page_of_the_newest_section() -> None:
    changes = (
        "# Changes\n\n## 2.0\n\n"
        + "".join(f"- change {k}\n  more of it\n" for k in range(50))
        + "\n## 1.0\n\n- old\n"
    )
    names = ["scancell-2.0-cp312-none-win_amd64.whl", "scancell-2.0-py3-none-any.whl"]
    text = release.notes(changes, names)
    assert text.startswith("# 2.0\n")
    assert len(text.splitlines()) <= 65
    *text, told = text.rstrip().splitlines()
    assert told.startswith("Wheels with compiled kernels: scancell-2.0-cp312-none-win_amd64.whl. ")
    text = "\n".join(text)
    assert "old" not in text
    assert "CHANGELOG.md" in text
    assert text.rstrip().splitlines()[-3].strip() == "more of it"  # no half of a change


@pytest.mark.thorough
def test_the_portable_folder_finds_its_packages_and_starts(python_zip: Path, wheel: Path, tmp_path: Path) -> None:
    house = tmp_path / "house"
    house.mkdir()
    shutil.copy(wheel, house)
    compiled = tmp_path / "compiled"
    compiled.mkdir()
    (compiled / "a.nbc").touch()
    made = portable.make(python_zip, tmp_path / "out", house, compiled)
    assert re.fullmatch(r"scancell-[\d.]+-windows-x64\.zip", made.name)
    with zipfile.ZipFile(made) as archive:
        names = archive.namelist()
        paths = archive.read("scancell/python/python312._pth").decode().split("\n")
        start = archive.read("scancell/Start.cmd").decode()
    assert paths == ["python312.zip", ".", "..\\packages", "import site", ""]
    assert '"%~dp0python\\python.exe" -m server.cli serve --open --data "%~dp0data" %*\r\n' in start
    assert "\n" not in start.replace("\r\n", "")
    assert "scancell/packages/server/web/index.html" in names
    assert "scancell/packages/calib_core/kernels/__init__.py" in names
    brought = [name for name in names if "__pycache__" in name and not name.endswith("/")]
    assert brought == ["scancell/packages/calib_core/kernels/__pycache__/a.nbc"]


def test_kernels_are_brought_along_by_a_wheel_of_one_python(wheel: Path, tmp_path: Path) -> None:
    folder = tmp_path / "compiled"
    folder.mkdir()
    with pytest.raises(SystemExit, match="need compiled kernels"):
        kernels.files_of(folder)
    for name in ("a.nbi", "a.1.nbc", "all-0.compiled", "b.pyc"):
        (folder / name).write_bytes(name.encode())
    given = Path(shutil.copy(wheel, tmp_path))
    made = kernels.with_kernels(given, folder, "cp312-none-win_amd64")
    assert re.fullmatch(r"scancell-[\d.]+-cp312-none-win_amd64\.whl", made.name)
    with zipfile.ZipFile(given) as before, zipfile.ZipFile(made) as after:
        brought = set(after.namelist()) - set(before.namelist())
        assert brought == {f"{kernels.FOLDER}/{name}" for name in ("a.nbi", "a.1.nbc", "all-0.compiled")}
        (record,) = (name for name in after.namelist() if name.endswith("/RECORD"))
        lines = after.read(record).decode().splitlines()
        assert {line.split(",")[0] for line in lines} == set(after.namelist())
        assert "Tag: cp312-none-win_amd64\n" in after.read(record.replace("RECORD", "WHEEL")).decode()


@pytest.mark.thorough
def test_the_folders_own_python_compiles_what_kernels_it_lacks(
    python_zip: Path, wheel: Path, tmp_path: Path
) -> None:
    """A program that stands for one that runs a Windows Python does what it is told to have done there."""
    starter, house, told = tmp_path / "python", tmp_path / "house", tmp_path / "told"
    house.mkdir()
    shutil.copy(wheel, house)
    starter.write_text(
        f"#!{sys.executable}\nimport pathlib, sys\n"
        f"pathlib.Path({str(told)!r}).write_text('\\n'.join(sys.argv[3:]))\n"
        "top = pathlib.Path(sys.argv[3].removeprefix('Z:')).parents[1]\n"
        f"folder = top / 'packages' / {kernels.FOLDER!r}\nfolder.mkdir()\n(folder / 'b.nbc').touch()\n"
    )
    starter.chmod(0o755)
    made = portable.make(python_zip, tmp_path / "out", house, None, starter)
    python, *words = told.read_text().splitlines()
    assert python.startswith("Z:/")
    assert python.endswith("/scancell/python/python.exe")
    assert words == ["-B", "-m", "server.cli", "warm", "--any-processor"]
    (taken := tmp_path / "taken").mkdir()
    assert kernels.taken_from(made, taken)
    assert [file.name for file in kernels.files_of(taken)] == ["b.nbc"]


@pytest.mark.thorough
def test_what_programs_need_of_microsofts_runtime_is_brought_or_told(
    python_zip: Path, wheel: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    house, runtime = tmp_path / "house", tmp_path / "runtime"
    house.mkdir()
    runtime.mkdir()
    shutil.copy(wheel, house)
    with zipfile.ZipFile(house / "numba-1-cp312-cp312-win_amd64.whl", "w") as archive:
        names = b"MZ\0KERNEL32.dll\0MSVCP140.dll\0VCRUNTIME140_1.dll\0msvcp140-0a4c.dll\0Python3.dll\0"
        archive.writestr("numba/typeconv.pyd", names)
    (runtime / "msvcp140.dll").write_bytes(b"MZ")
    made = portable.make(python_zip, tmp_path / "out", house, None, None, runtime)
    assert "Lacks vcruntime140_1.dll: " in capsys.readouterr().err
    with zipfile.ZipFile(made) as archive:
        assert "scancell/python/msvcp140.dll" in archive.namelist()
        assert "for vcruntime140_1.dll.\r\n" in archive.read("scancell/README.txt").decode()


def test_another_zip_is_no_python_of_windows(tmp_path: Path) -> None:
    file = tmp_path / "other.zip"
    zipfile.ZipFile(file, "w").close()
    with pytest.raises(SystemExit, match="need the embeddable Python"):
        portable.unpack(file, tmp_path / "python")


def test_files_of_a_wheels_data_land_where_python_looks(tmp_path: Path) -> None:
    wheel = tmp_path / "a-1.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for name in ("a-1.data/purelib/a/__init__.py", "a-1.data/scripts/a.exe", "a/tests/test_a.py", "a/b.pyi"):
            archive.writestr(name, b"")
    portable.install([wheel], tmp_path / "packages")
    assert [p.relative_to(tmp_path / "packages").as_posix() for p in (tmp_path / "packages").rglob("*.*")] == [
        "a/__init__.py"
    ]
