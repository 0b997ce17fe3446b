"""The wheel, installed alone into an empty environment and used there, as pipx, uv and an image would."""

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import httpx
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / ".ci"))

import clean_environment  # noqa: E402
import release  # noqa: E402


def built(source: Path, out: Path) -> Path:
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(out)]
    subprocess.run(build, cwd=source, capture_output=True, check=True)
    (file,) = out.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(ROOT, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def client_wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(ROOT / "scancell_client", tmp_path_factory.mktemp("client"))


def folders(wheel: Path) -> set[str]:
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    return {name.partition("/")[0] for name in names}


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the programs of an environment that has what the wheel asks for, and nothing else."""
    place = tmp_path_factory.mktemp("environment")
    programs = clean_environment.make(place, wheel)
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(place), "platbase": str(place)}))
    compiled = packages / "calib_core" / "kernels" / "__pycache__"
    compiled.mkdir()
    for file in (ROOT / "calib_core" / "kernels" / "__pycache__").glob("*.nb[ic]"):  # of the same sources
        shutil.copy(file, compiled / file.name)
    return programs


def outside() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}


def ran(program: Path, *arguments: str, cwd: Path) -> str:
    command = [program, *arguments]
    done = subprocess.run(command, cwd=cwd, env=outside(), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_it_holds_every_file_and_no_names_of_nobody(wheel: Path) -> None:
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    command = ["git", "ls-files", "calib_core", "scancell_client", "server", "web"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    files = [name for name in listed.stdout.split() if (ROOT / name).is_file()]
    assert {re.sub("^(web|scancell_client)/", r"server/\1/", name) for name in files} <= names
    assert folders(wheel) == {"calib_core", "server"}
    assert "calib_core/py.typed" in names


@pytest.mark.thorough
def test_the_client_stands_alone(wheel: Path, client_wheel: Path, tmp_path: Path) -> None:
    """Nothing of the other wheel is there, and no file belongs to both."""
    assert folders(client_wheel) == {"scancell_client"}
    assert not folders(client_wheel) & folders(wheel)
    zipfile.ZipFile(client_wheel).extractall(tmp_path)
    assert (tmp_path / "scancell_client" / "py.typed").is_file()
    (metadata,) = tmp_path.glob("*.dist-info/METADATA")
    asked = re.findall(r"^Requires-Dist: ([\w-]+)", metadata.read_text(encoding="utf-8"), re.MULTILINE)
    assert asked == ["httpx", "pydantic"]
    code = """
import sys
sys.modules.update(dict.fromkeys(("calib_core", "server", "numpy", "fastapi")))  # as where they are not installed
from scancell_client import Scancell
from scancell_client.models import RESULTS, TcpResult
assert RESULTS["tcp"] is TcpResult
Scancell("http://127.0.0.1:9").close()
"""
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=outside(), check=True)


@pytest.mark.thorough
def test_the_list_of_parts_names_all_that_is_installed(installed: Path, wheel: Path) -> None:
    parts = release.list_of_parts(wheel)
    found = clean_environment.installed(installed)
    assert release.unlisted(parts, found) == []
    assert len(found) > 80
    assert all(part["hashes"] for part in parts["components"])
    assert release.unlisted(parts, {*found, "other==1.0"}) == ["other==1.0"]


@pytest.mark.thorough
def test_the_library_is_imported(installed: Path, tmp_path: Path) -> None:
    code = "import calib_core as cc; print(cc.__file__); print(cc.calibrate_tcp.__module__)"
    file, module = ran(installed / "python", "-c", code, cwd=tmp_path).split()
    assert Path(file).is_relative_to(installed.parent)
    assert module == "calib_core.library.calibrate"


@pytest.mark.thorough
def test_a_session_is_simulated_solved_and_reported(installed: Path, tmp_path: Path) -> None:
    scancell = installed / "scancell"
    assert "scancell 0." in ran(scancell, "--version", cwd=tmp_path)
    ran(scancell, "simulate", "tcp", "--seed", "3", "--out", "cell", cwd=tmp_path)
    solved = json.loads(ran(scancell, "run", "cell", "--json", cwd=tmp_path))
    assert solved["results"]["tcp"]["verdict"] == "pass"
    command = [scancell, "run", "cell", "--server", "http://127.0.0.1:9"]
    done = subprocess.run(command, cwd=tmp_path, env=outside(), capture_output=True, text=True, check=False)
    assert (done.returncode, "a server that answers" in done.stderr) == (2, True), done.stderr  # it has its client
    ran(scancell, "report", "cell", "--out", "report.html", cwd=tmp_path)
    assert "<html" in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.thorough
def test_the_benchmarks_say_that_they_need_a_checkout(installed: Path, tmp_path: Path) -> None:
    command = [installed / "scancell", "bench"]
    done = subprocess.run(command, cwd=tmp_path, env=outside(), capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "in a checkout of the project" in done.stderr


@pytest.mark.thorough
def test_the_workbench_is_served_with_its_page(installed: Path, tmp_path: Path) -> None:
    command = [installed / "scancell", "serve", "--port", "0", "--data", "data", "--json"]
    settings = outside() | {"SCANCELL_WARM_UP": "false"}
    with subprocess.Popen(command, cwd=tmp_path, env=settings, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            address = json.loads(server.stdout.readline())["address"]
            page = httpx.get(address)
            assert page.status_code == 200
            (script,) = re.findall(r'src="(/[^"]+\.js)"', page.text)
            assert httpx.get(f"{address}{script}").status_code == 200
            assert httpx.get(f"{address}/api/v1/sessions").json()["items"] == []
        finally:
            server.terminate()
        assert server.wait(300) == 0
