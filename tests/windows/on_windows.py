"""The wheel on a Windows Python: `make test-windows WINDOWS_PYTHON=FOLDER`; no part of `make test`.

FOLDER holds `python`, a program that runs a Windows CPython with all dependencies: natively, or under Wine.  What
works under Wine shows much of what is Windows' own, and proves nothing of a real one.
"""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PureWindowsPath
from typing import Any

import httpx
import numpy as np
import pytest

from tests.server.live_server import simulated_session, upload, wait_for
from tests.server.test_batches import one, send, wait_until_measured

ROOT = Path(__file__).resolve().parents[2]
_LONG_S = 1800
_START = """import sys
sys.argv[0] = "scancell"
from server.cli import main
if __name__ == "__main__":
    sys.exit(main())
"""


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
    for name in ("calib_core", "scancell_client", "server"):
        for old in [packages / name, *packages.glob("scancell-*.dist-info")]:
            shutil.rmtree(old, ignore_errors=True)
    zipfile.ZipFile(wheel).extractall(packages)
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
    done = subprocess.run(command, cwd=place, env=outside(), capture_output=True, check=False, timeout=_LONG_S)
    assert done.returncode == status, done.stderr.decode("utf-8", "replace")[-2000:]
    return done.stdout


class Server:
    """`scancell serve` on Windows, and a client of it."""

    def __init__(self, program: list[str], place: Path, data: str) -> None:
        words = [*program, "serve", "--port", "0", "--data", data, "--json"]
        self._log = (place / "server.log").open("ab")
        self._process = subprocess.Popen(
            words, cwd=place, env=outside(), stdout=subprocess.PIPE, stderr=self._log, start_new_session=True
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
def serving(program: list[str], place: Path, data: str = "data") -> Iterator[httpx.Client]:
    server = Server(program, place, data)
    try:
        with httpx.Client(base_url=f"{server.address}/api/v1", timeout=300, trust_env=False) as client:
            yield client
    finally:
        server.kill()


@pytest.fixture(scope="module")
def client(program: list[str], place: Path) -> Iterator[httpx.Client]:
    with serving(program, place) as client:
        yield client


def arc(seed: int) -> bytes:
    x = np.linspace(-12, 12, 200)
    z = 200 - np.sqrt(20.0**2 - x**2) + np.random.default_rng(seed).normal(0, 0.02, 200)
    return b"x_mm,z_mm\r\n" + b"".join(b"%.4f,%.4f\r\n" % row for row in zip(x, z, strict=True))


def record(name: str) -> dict[str, Any]:
    return {
        "id": name,
        "step": "tcp",
        "kind": "profile",
        "pose": [600, 0, 500, 180, 0, 0],
        "files": [f"{name}.csv"],
    }


def sigmas_apart(left: Mapping[str, Any], right: Mapping[str, Any], frame: str) -> float:
    a, b = (np.array(one[frame]) for one in (left, right))
    sigma = np.sqrt(np.diag(np.array(right["covariance"])))
    turned = a[:3, :3].T @ b[:3, :3]
    turn = np.array([turned[2, 1], turned[0, 2], turned[1, 0]])
    moved = a[:3, :3].T @ (b[:3, 3] - a[:3, 3])
    return float(np.max(np.abs(np.concatenate([turn, moved])) / np.maximum(sigma, 1e-12)))


@pytest.mark.parametrize(
    ("scenario", "stage", "frame"),
    [("tcp", "tcp", "tool0_from_laser"), ("turntable", "chain", "tool0_from_laser")],
)
def test_a_run_with_redirected_output_gives_what_linux_gives(
    program: list[str], place: Path, scenario: str, stage: str, frame: str
) -> None:
    from calib_core.archive.folder import load_session, result_data
    from calib_core.stages.pipeline import run

    ran(program, place, "simulate", scenario, "--seed", "3", "--out", scenario)
    found = json.loads(ran(program, place, "run", scenario, "--json"))["results"]
    text = ran(program, place, "run", scenario).decode("utf-8")
    assert "±" in text
    ours = {name: result_data(result) for name, result in run(*load_session(place / scenario)).items()}
    assert {name: result["verdict"] for name, result in found.items()} == {
        n: r["verdict"] for n, r in ours.items()
    }
    assert sigmas_apart(found[stage], ours[stage], frame) < 1e-3
    stored = json.loads((place / scenario / "results" / f"{stage}.json").read_text("utf-8"))
    assert stored[frame] == found[stage][frame]


def test_an_archive_of_linux_is_replayed_there_and_one_of_windows_here(program: list[str], place: Path) -> None:
    command = [sys.executable, "-m", "server.cli"]
    for name in ("linux", "windows"):
        shutil.copytree(place / "turntable", place / name)
        shutil.rmtree(place / name / "results")
    subprocess.run([*command, "run", str(place / "linux")], cwd=ROOT, capture_output=True, check=True)
    ran(program, place, "run", "windows")
    subprocess.run(
        [*command, "archive", "pack", str(place / "linux"), "--no-scene", "--out", str(place / "linux.zip")],
        cwd=ROOT, capture_output=True, check=True,
    )  # fmt: skip
    ran(program, place, "archive", "pack", "windows", "--out", "windows.zip")
    assert json.loads(ran(program, place, "archive", "replay", "linux.zip", "--json"))["equal"]
    ran(program, place, "archive", "unpack", "linux.zip", "--out", "unpacked")
    done = subprocess.run(
        [*command, "archive", "replay", str(place / "windows.zip"), "--json"],
        cwd=ROOT,
        capture_output=True,
        check=True,
    )
    assert json.loads(done.stdout)["equal"]


def test_the_page_and_all_its_modules_are_served(client: httpx.Client) -> None:
    site = str(client.base_url).removesuffix("/api/v1/")
    page = client.get(site)
    assert page.status_code == 200
    seen, todo = set[str](), re.findall(r'(?:src|href)="(/web/[^"]+)"', page.text)
    while todo:
        name = todo.pop()
        if name in seen:
            continue
        seen.add(name)
        answer = client.get(site + name)
        assert answer.status_code == 200, name
        if name.endswith(".js"):
            assert answer.headers["content-type"].startswith("text/javascript")
            wanted = re.findall(r'(?:from|import)\s*\(?"(\.[^"]+)"', answer.text)
            todo += [str(httpx.URL(site + name).join(path).path) for path in wanted]
    assert len(seen) > 80


def test_the_page_shows_a_solved_session_with_its_scene(client: httpx.Client, tmp_path: Path) -> None:
    from playwright.sync_api import sync_playwright

    from tests.web.browsing import BROWSER_ARGUMENTS, CHROMIUM

    session = simulated_session(client, captures=14)
    job = client.post(f"/sessions/{session}/solve/tcp").json()["id"]
    assert wait_for(client, job)["status"] == "done"
    site = str(client.base_url).removesuffix("/api/v1/")
    complaints: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=BROWSER_ARGUMENTS)
        page = browser.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.set_default_timeout(300_000)
        page.goto(f"{site}/sessions/{session}", wait_until="commit")
        page.locator("sc-guide h1").wait_for()
        page.locator("iframe").first.wait_for()
        page.frame_locator("iframe").first.locator("canvas").first.wait_for()
        page.screenshot(path=tmp_path / "page.png")
        browser.close()
    assert complaints == []
    assert (tmp_path / "page.png").stat().st_size > 20_000


def test_twenty_captures_are_stored_one_by_one_and_twenty_in_one_body(client: httpx.Client) -> None:
    cell = {"pose_convention": "fanuc", "sphere_diameter_mm": 40.0, "scanner": {"kind": "profile"}}
    session = client.post("/sessions", json={"name": "uploads", "cell": cell}).json()["id"]
    for k in range(20):
        answer = upload(client, session, record(f"p{k:02d}"), arc(k))
        assert answer.status_code == 201, answer.text
    body = b"".join(one(f"b{k:02d}", arc(100 + k)) for k in range(20))
    assert send(client, session, body).json()["stored"] == 20
    captures = wait_until_measured(client, session)
    assert len(captures) == 40
    content = client.get(f"/sessions/{session}/captures/p07/files/p07.csv").content
    assert content == arc(7)  # byte for byte, its line ends too


def test_a_solve_is_cancelled_and_the_next_one_done(client: httpx.Client) -> None:
    session = simulated_session(client, captures=14, seed=8)
    job = client.post(f"/sessions/{session}/solve/tcp").json()["id"]
    client.post(f"/jobs/{job}/cancel")
    assert wait_for(client, job)["status"] in ("cancelled", "done")
    job = client.post(f"/sessions/{session}/solve/tcp").json()["id"]
    assert wait_for(client, job)["status"] == "done"


def test_a_session_goes_out_as_an_archive_and_comes_in_again(client: httpx.Client) -> None:
    session = simulated_session(client, captures=14, seed=9)
    job = client.post(f"/sessions/{session}/solve/tcp").json()["id"]
    assert wait_for(client, job)["status"] == "done"
    archive = client.get(f"/sessions/{session}/archive", params={"scene": False}).content
    answer = client.post("/archives", content=archive, headers={"Content-Type": "application/zip"})
    assert answer.status_code == 201, answer.text
    assert len(client.get(f"/sessions/{answer.json()['id']}/captures").json()["items"]) == 14


def test_what_a_killed_server_stored_is_there_again(program: list[str], place: Path) -> None:
    with serving(program, place, "killed") as client:
        session = simulated_session(client, captures=5)
    time.sleep(1)
    with serving(program, place, "killed") as client:
        assert len(client.get(f"/sessions/{session}/captures").json()["items"]) == 5
    said = ran(program, place, "doctor", "--data", "killed").decode("utf-8")
    assert "nothing is damaged" in said
    ran(program, place, "backup", "--data", "killed", "--out", "backup")
    ran(program, place, "restore", "backup", "--data", "restored")


def test_a_second_server_is_told_that_folder_and_port_are_taken(
    program: list[str], place: Path, client: httpx.Client
) -> None:
    port = str(client.base_url.port)
    for words in (["--port", port, "--data", "other"], ["--port", "0", "--data", "data"]):
        done = subprocess.run(
            [*program, "serve", *words], cwd=place, capture_output=True, check=False, timeout=300
        )
        assert done.returncode == 2
        assert b"scancell: error:" in done.stderr


def test_the_demo_runs_with_camera_table_and_merge(program: list[str], place: Path) -> None:
    assert "merge" in ran(program, place, "demo", "--no-serve", "--data", "demo").decode("utf-8")
