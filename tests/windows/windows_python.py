"""A Windows Python to try the wheel on: a folder with `python`, a program that runs one, native or under Wine."""

import json
import os
import shutil
import signal
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PureWindowsPath

import httpx
import pytest

ROOT = Path(__file__).resolve().parents[2]
LONGEST_S = 1800
_START = """import sys
sys.argv[0] = "scancell"
from server.cli import main
if __name__ == "__main__":
    sys.exit(main())
"""

Figure = Callable[[str, str, str], None]
"""Takes what was measured: what, target, measured."""


@pytest.fixture
def figure(record_property: Callable[[str, object], None]) -> Figure:
    """What a test measures, for `scancell bench windows`."""
    return lambda *words: record_property("figure", json.dumps(words))


def python() -> Path:
    named = os.environ.get("WINDOWS_PYTHON")
    if not named:
        pytest.fail("name the folder of a Windows Python: make test-windows WINDOWS_PYTHON=FOLDER")
    return Path(named).resolve() / "python"


def outside() -> dict[str, str]:
    """What is told to that Python: nothing of this one."""
    return {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}


def here(path: str) -> Path:
    """Return the path of this system that a path of Wine's names, which knows no case."""
    if os.name == "nt":
        return Path(path)
    found = Path("/")
    for part in PureWindowsPath(path).parts[1:]:
        found = next((p for p in found.iterdir() if p.name.lower() == part.lower()), found / part)
    return found


def there(path: Path) -> str:
    return str(PureWindowsPath(f"Z:{path}")) if os.name != "nt" else str(path)


def replace_packages(packages: Path, wheel: Path) -> None:
    """Unpack a wheel in place of what was there; files that are the same stay, and kernels compiled of them."""
    with zipfile.ZipFile(wheel) as archive:
        wanted = {packages / name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}
    for old in packages.glob("scancell-*.dist-info"):
        shutil.rmtree(old)
    for name in ("calib_core", "scancell_client", "server"):
        for old in (packages / name).rglob("*"):
            if old.is_file() and old not in wanted and old.parent.name != "__pycache__":
                old.unlink()
    for file, content in wanted.items():
        if not file.is_file() or file.read_bytes() != content:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The command line of the wheel of this checkout, installed in place of what that Python had."""
    built = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(built)]
    subprocess.run(command, cwd=ROOT, capture_output=True, check=True)
    (wheel,) = built.glob("*.whl")
    asked = [python(), "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    packages = here(
        subprocess.run(asked, env=outside(), capture_output=True, text=True, check=True).stdout.strip()
    )
    replace_packages(packages, wheel)
    start = tmp_path_factory.mktemp("start") / "start.py"
    start.write_text(_START, encoding="utf-8")
    return [str(python()), there(start)]


@pytest.fixture(scope="session")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("windows") / "Meßzelle ü 4"
    folder.mkdir()
    return folder


def ran(program: list[str], place: Path, *words: str, status: int = 0) -> bytes:
    command = [*program, *words]
    done = subprocess.run(command, cwd=place, env=outside(), capture_output=True, check=False, timeout=LONGEST_S)
    assert done.returncode == status, done.stderr.decode("utf-8", "replace")[-2000:]
    return done.stdout


class Server:
    """`scancell serve` on Windows, and a client of it."""

    def __init__(self, command: list[str], place: Path, more: Mapping[str, str]) -> None:
        self._log = (place / "server.log").open("ab")
        self._process = subprocess.Popen(
            command,
            cwd=place,
            env=outside() | {"SCANCELL_WARM_UP": "false"} | more,  # else it compiles all kernels beside
            stdout=subprocess.PIPE,
            stderr=self._log,
            start_new_session=True,
        )
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line, (place / "server.log").read_text("utf-8", "replace")[-2000:]
        self.address: str = json.loads(line)["address"]

    def kill(self) -> None:
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()
        self._log.close()


@contextmanager
def serving(program: list[str], place: Path, data: str = "data", **more: str) -> Iterator[httpx.Client]:
    """Serve a data folder, with more variables of the environment."""
    server = Server([*program, "serve", "--port", "0", "--data", data, "--json"], place, more)
    try:
        with httpx.Client(base_url=f"{server.address}/api/v1", timeout=300, trust_env=False) as client:
            yield client
    finally:
        server.kill()
