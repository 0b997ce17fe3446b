"""Watched folders: only whole files with a pose become captures, each once, whatever else happens there."""

import json
import os
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from calib_core.simulation import simulate
from server.settings import Settings
from server.sources.folder import Resting
from tests.server.live_server import assert_problem, make_session, serving

MADE = simulate("tcp", 11)
RECORD: Any = MADE.session.to_json()
CAPTURES: list[Any] = RECORD["captures"]


def profile(number: int) -> bytes:
    return MADE.files[CAPTURES[number]["files"][0]]


def pose_line(number: int) -> str:
    return " ".join(map(str, CAPTURES[number]["pose"]))


@contextmanager
def watching(tmp_path: Path, rest_s: float = 0.2) -> Generator[httpx.Client]:
    root = tmp_path / "scans"
    (root / "hall" / "cell 4").mkdir(parents=True, exist_ok=True)
    settings = Settings(data=tmp_path / "data", port=0, warm_up=False, watch_root=root, watch_rest_s=rest_s)
    with serving(settings) as client:
        yield client


@pytest.fixture
def client(tmp_path: Path) -> Iterator[httpx.Client]:
    with watching(tmp_path) as client:
        yield client


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "scans" / "hall" / "cell 4"


def watched_session(client: httpx.Client) -> str:
    session = make_session(client, cell=RECORD["cell"])
    answer = client.put(f"/sessions/{session}/sources/folder", json={"folder": "hall/cell 4"})
    assert answer.status_code == 200, answer.text
    return session


def captures(client: httpx.Client, session: str) -> dict[str, Any]:
    return {c["id"]: c for c in client.get(f"/sessions/{session}/captures").json()["items"]}


def wait_for_captures(client: httpx.Client, session: str, count: int, timeout_s: float = 30) -> dict[str, Any]:
    end_s = time.monotonic() + timeout_s
    while len(found := captures(client, session)) < count:
        assert time.monotonic() < end_s, client.get(f"/sessions/{session}/sources/folder").text
        time.sleep(0.02)
    return found


def wait_for_refusal(client: httpx.Client, session: str, name: str, word: str, timeout_s: float = 30) -> None:
    end_s = time.monotonic() + timeout_s
    while True:
        watch = client.get(f"/sessions/{session}/sources/folder").json()["watch"]
        if any(one["file"] == name and word in one["reason"] for one in watch["refused"]):
            return
        assert time.monotonic() < end_s, watch
        time.sleep(0.02)


def test_poses_come_from_a_table_a_line_beside_it_or_a_record(client: httpx.Client, folder: Path) -> None:
    session = watched_session(client)
    (folder / "a1.csv").write_bytes(profile(0))
    os.utime(folder / "a1.csv", (1_700_000_000, 1_700_000_000))
    (folder / "poses.txt").write_text(f"a1.csv {pose_line(0)}\n")
    (folder / "a2.csv").write_bytes(profile(1))
    (folder / "a2.txt").write_text(pose_line(1))
    (folder / "a3.csv").write_bytes(profile(2))
    (folder / "a3.json").write_text(json.dumps({"step": "verify", "pose": CAPTURES[2]["pose"]}))
    (folder / "readme.md").write_text("not a measurement")
    found = wait_for_captures(client, session, 3)
    assert [found[name]["pose"] for name in ("a1", "a2", "a3")] == [c["pose"] for c in CAPTURES[:3]]
    assert [found[name]["step"] for name in ("a1", "a2", "a3")] == ["tcp", "tcp", "verify"]
    assert found["a1"]["taken"] == "2023-11-14T22:13:20.000Z"  # when its file was written
    assert found["a1"]["clock"] == "file"
    assert all(c["measured"]["verdict"] != "fail" for c in found.values())
    stored = client.get(f"/sessions/{session}/captures/a1/files/a1.csv").content
    assert stored == profile(0)
    assert {p.name for p in folder.glob("*.*")} == {f"a{n}.csv" for n in (1, 2, 3)} | {
        "a2.txt",
        "a3.json",
        "poses.txt",
        "readme.md",
    }


@pytest.mark.thorough
def test_a_file_written_in_portions_is_taken_whole(tmp_path: Path, folder: Path) -> None:
    with watching(tmp_path, rest_s=1.0) as client:
        session = watched_session(client)
        (folder / "slow.txt").write_text(pose_line(0))
        content = profile(0)
        portion = len(content) // 6 + 1
        with (folder / "slow.csv").open("wb") as file:
            for start in range(0, len(content), portion):
                file.write(content[start : start + portion])
                file.flush()
                time.sleep(0.3)  # the server looks at it in between
                assert captures(client, session) == {}
        wait_for_captures(client, session, 1)
        assert client.get(f"/sessions/{session}/captures/slow/files/slow.csv").content == content


@pytest.mark.thorough
def test_what_is_refused_says_why_and_is_tried_again_once_mended(client: httpx.Client, folder: Path) -> None:
    session = watched_session(client)
    (folder / "p1.csv").write_bytes(profile(0))
    wait_for_refusal(client, session, "p1.csv", "Write p1.txt with the pose line")
    (folder / "p1.txt").write_text("1 2 3")
    wait_for_refusal(client, session, "p1.csv", "Write one pose in the cell's convention")
    (folder / "p1.txt").write_text(pose_line(0))
    wait_for_captures(client, session, 1)
    (folder / "broken.csv").write_text("x_mm,z_mm\n1,2\n3\n")
    (folder / "broken.txt").write_text(pose_line(1))
    wait_for_refusal(client, session, "broken.csv", "broken")
    assert set(captures(client, session)) == {"p1"}
    assert client.get(f"/sessions/{session}/sources/folder").json()["watch"]["taken"] == 1


@pytest.mark.thorough
def test_each_file_once_also_after_a_restart_and_again_when_written_anew(tmp_path: Path, folder: Path) -> None:
    with watching(tmp_path) as client:
        session = watched_session(client)
        (folder / "scan.csv").write_bytes(profile(0))
        (folder / "scan.txt").write_text(pose_line(0))
        wait_for_captures(client, session, 1)
        client.delete(f"/sessions/{session}/captures/scan")
    with watching(tmp_path) as client:
        (folder / "z.csv").write_bytes(profile(3))  # taken after those that come before it by name
        (folder / "z.txt").write_text(pose_line(3))
        assert set(wait_for_captures(client, session, 1)) == {"z"}  # what a person deleted stays deleted
        (folder / "scan.csv").write_bytes(profile(1))
        (folder / "scan.txt").write_text(pose_line(1))
        assert wait_for_captures(client, session, 2)["scan"]["pose"] == CAPTURES[1]["pose"]
        (folder / "scan.csv").write_bytes(profile(2))
        (folder / "scan.txt").write_text(pose_line(2))
        assert set(wait_for_captures(client, session, 3)) == {"scan", "scan-2", "z"}


def test_only_below_the_root(client: httpx.Client, folder: Path, tmp_path: Path) -> None:
    session = make_session(client, cell=RECORD["cell"])
    (tmp_path / "elsewhere").mkdir()
    (folder.parent / "out").symlink_to(tmp_path / "elsewhere")
    path = f"/sessions/{session}/sources/folder"
    for outside in ("..", "../data", str(tmp_path / "elsewhere"), "hall/out"):
        assert_problem(client.put(path, json={"folder": outside}), 422, "below the watched root")
    for name in ("hall/none", "x" * 5000, "hall/../hall", "C:\\hall"):
        assert_problem(client.put(path, json={"folder": name}), 422, "nothing at")
    assert client.get(path).json()["folders"] == [".", "hall", "hall/cell 4", "hall/out"]
    (tmp_path / "secret.csv").write_bytes(profile(0))
    client.put(path, json={"folder": "hall/cell 4"})
    (folder / "p1.csv").symlink_to(tmp_path / "secret.csv")
    (folder / "p1.txt").write_text(pose_line(0))
    (folder / "z.csv").write_bytes(profile(1))
    (folder / "z.txt").write_text(pose_line(1))
    assert set(wait_for_captures(client, session, 1)) == {"z"}
    client.delete(path)
    assert client.get(path).json()["watch"] is None


def test_without_a_root_it_says_how_to_allow_it(tmp_path: Path) -> None:
    with serving(Settings(data=tmp_path, port=0, warm_up=False)) as client:
        path = f"/sessions/{make_session(client)}/sources/folder"
        assert client.get(path).json() == {"available": False, "folders": [], "watch": None}
        assert_problem(client.put(path, json={"folder": "."}), 409, "SCANCELL_WATCH_ROOT")


def test_files_rest_before_they_count() -> None:
    resting = Resting(rest_s=1.0)
    assert resting.rested({"a": (10, 1)}, 0.0) == set()
    assert resting.rested({"a": (20, 1)}, 0.9) == set()  # it grew
    assert resting.rested({"a": (20, 1)}, 1.8) == set()
    assert resting.rested({"a": (20, 1), "b": (1, 1)}, 2.0) == {"a"}
    assert resting.rested({"a": (20, 2), "b": (1, 1)}, 3.0) == {"b"}  # written anew with the same size
