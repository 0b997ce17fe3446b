"""The real server process on a disk that fails, under a wrong clock, with a locked database, over cut connections.

Each fault is answered with a problem that says what to do, nothing that was acknowledged is lost, and the same
request succeeds once the fault is mended.
"""

import json
import os
import resource
import socket
import sqlite3
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from kill_server import ServerProcess

from server.settings import Settings
from server.store.doctor import examine
from tests.server.forked_commands import ForkedCommand
from tests.server.live_server import assert_problem, make_session, simulated_session, upload, wait_for
from tests.server.scene_cell import wait_until

RECORD = {"step": "tcp", "kind": "profile", "pose": [0, 0, 0, 0, 0, 0]}
DAY_S = 86_400


def rows(number: int, size: int = 60) -> bytes:
    return "".join(f"{x / 4},{200 + number + x % 3}\n" for x in range(size)).encode()


def add(client: httpx.Client, session: str, number: int, size: int = 60) -> httpx.Response:
    key = {"Idempotency-Key": f"{session}-{number}"}
    return upload(client, session, {"id": f"p{number}", **RECORD}, rows(number, size), headers=key)


def assert_all_there(client: httpx.Client, session: str, count: int, size: int = 60) -> None:
    captures = client.get(f"/sessions/{session}/captures", params={"limit": 1000}).json()["items"]
    assert [capture["id"] for capture in captures] == [f"p{number}" for number in range(count)]
    for number in range(count):
        file = client.get(f"/sessions/{session}/captures/p{number}/files/p{number}.csv")
        assert file.content == rows(number, size)


def assert_sound(data: Path) -> None:
    found = examine(Settings(data=data))
    assert [finding for finding in found.findings if finding.kind == "damage"] == []


@contextmanager
def server(data: Path, *program: str, **environment: str) -> Iterator[httpx.Client]:
    process = ServerProcess(data, environment, program or ("server.cli",), forked=True).wait()
    try:
        with process.client() as client:
            yield client
    finally:
        process.kill()


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 8 MB of its own; where none may be mounted, a limit on how large files grow takes its place."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", folder], capture_output=True).returncode:
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, before[1]))
        yield folder
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        return
    yield folder
    subprocess.run(["umount", "-l", folder], check=True)


def test_a_full_disk_is_said_and_loses_nothing(small_disk: Path) -> None:
    data, size = small_disk / "data", 4000
    ballast = small_disk / "ballast"
    mounted = os.path.ismount(small_disk)
    with server(data) as client:
        session = make_session(client)
        assert add(client, session, 0, size).status_code == 201
        ballast.write_bytes(b"0" * 900_000)
        if mounted:
            free = os.statvfs(small_disk)
            with ballast.open("ab") as file:
                file.write(b"0" * max(0, free.f_bavail * free.f_bsize - 700_000))
        count = 1
        while (answer := add(client, session, count, size)).status_code == 201:
            count += 1
            assert count < 1000, "the disk does not fill up"
        assert_problem(answer, 507 if mounted else 503, "full" if mounted else "too large")
        assert_all_there(client, session, count, size)  # reading goes on
        if mounted:
            archive = client.get(f"/sessions/{session}/archive", params={"scene": False})
            assert_problem(archive, 507, "full")
        assert_sound(data)
    if not mounted:
        return
    # It may be started on a full disk, or says why not; it is never half started.
    said = _tried(data)
    assert not said or ("need" in said and "Traceback" not in said)
    ballast.unlink()
    with server(data) as client:
        assert add(client, session, count, size).status_code == 201
        assert_all_there(client, session, count + 1, size)
    assert_sound(data)


@pytest.mark.thorough
def test_a_disk_that_becomes_read_only_is_said_and_loses_nothing(small_disk: Path) -> None:
    data = small_disk / "data"
    assert "folder for the data that can be written to" in _tried(Path("/sys/scancell"))
    if not os.path.ismount(small_disk):
        return
    blobs = data / "blobs"
    with server(data) as client:
        session = make_session(client)
        assert add(client, session, 0).status_code == 201
        # The database's files are open for writing, which keeps the kernel from changing their disk as a whole.
        subprocess.run(["mount", "--bind", blobs, blobs], check=True)
        subprocess.run(["mount", "-o", "remount,bind,ro", blobs], check=True)
        assert_problem(add(client, session, 1), 503, "Read-only", "data folder")
        assert_all_there(client, session, 1)
        subprocess.run(["umount", "--lazy", blobs], check=True)
        assert add(client, session, 1).status_code == 201
    # What a killed process had open for writing is closed a moment after its end.
    wait_until(lambda: subprocess.run(["mount", "-o", "remount,ro", small_disk], check=False).returncode == 0)
    assert "read-only" in _tried(data)
    assert_sound(data)
    subprocess.run(["mount", "-o", "remount,rw", small_disk], check=True)
    with server(data) as client:
        assert add(client, session, 2).status_code == 201
        assert_all_there(client, session, 3)
    assert_sound(data)


@pytest.mark.thorough
def test_a_clock_set_back_changes_no_order_and_loses_nothing(tmp_path: Path) -> None:
    data = tmp_path / "data"
    count = 0
    sessions: list[str] = []
    for shift_s in (2 * DAY_S, -2 * DAY_S):
        with server(data, "tests.server.shifted_clock", str(shift_s)) as client:
            sessions.append(make_session(client, name=f"at {shift_s}"))
            for _ in range(2):
                assert add(client, sessions[0], count).status_code == 201
                count += 1
            again = add(client, sessions[0], count - 1)
            assert again.headers["Idempotency-Replayed"] == "true"
            assert_all_there(client, sessions[0], count)
            listed: list[str] = []
            cursor = None
            while True:
                page = client.get(
                    "/sessions", params={"limit": 1, **({"cursor": cursor} if cursor else {})}
                ).json()
                listed += [item["id"] for item in page["items"]]
                cursor = page["next"]
                if cursor is None:
                    break
            assert sorted(listed) == sorted(sessions)
            # Removing one of two captures with the same bytes takes the file from neither.
            twin = upload(client, sessions[-1], {"id": "twin", **RECORD}, rows(0))
            assert twin.status_code == 201
            assert client.delete(f"/sessions/{sessions[-1]}/captures/twin").status_code == 204
            assert_all_there(client, sessions[0], count)
    assert_sound(data)


@pytest.mark.thorough
def test_a_locked_database_is_said_and_reading_goes_on(tmp_path: Path) -> None:
    data = tmp_path / "data"
    with server(data, SCANCELL_DATABASE_WAIT_S="0.3") as client:
        session = make_session(client)
        assert add(client, session, 0).status_code == 201
        other = sqlite3.connect(data / "scancell.db", isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        assert_problem(add(client, session, 1), 503, "locked", "another program")
        assert_all_there(client, session, 1)
        other.execute("ROLLBACK")
        other.close()
        assert add(client, session, 1).status_code == 201
        assert_all_there(client, session, 2)
    assert_sound(data)


@pytest.mark.thorough
def test_a_connection_cut_in_an_upload_leaves_nothing(tmp_path: Path) -> None:
    data = tmp_path / "data"
    with server(data) as client:
        session = make_session(client)
        assert add(client, session, 0).status_code == 201
        form, kind = _form({"id": "p1", **RECORD}, rows(1, 40_000))
        path = f"/api/v1/sessions/{session}/captures"
        for sent in (len(form) // 2, len(form) - 1, 10):
            _cut(client, path, kind, form[:sent], len(form))
        _cut(client, "/api/v1/archives", "application/zip", os.urandom(100_000), 1_000_000)
        assert_all_there(client, session, 1)
        whole = client.post(path.removeprefix("/api/v1"), content=form, headers={"Content-Type": kind})
        assert whole.status_code == 201, whole.text
        assert [item["id"] for item in client.get(f"/sessions/{session}/captures").json()["items"]] == ["p0", "p1"]
    assert list((data / "blobs" / "arriving").iterdir()) == []
    found = examine(Settings(data=data))
    assert (found.captures, found.files, found.findings) == (2, 2, [])


@pytest.mark.thorough
def test_a_damaged_file_fails_the_solve_with_its_name_and_doctor_names_the_capture(tmp_path: Path) -> None:
    data = tmp_path / "data"
    with server(data) as client:
        session = simulated_session(client, captures=14)
        name = client.get(f"/sessions/{session}/captures/p05").json()["files"][0]
        digest = client.get(f"/sessions/{session}/captures/p05/files/{name}").headers["ETag"].strip('"')
        path = data / "blobs" / digest[:2] / digest
        content = bytearray(path.read_bytes())
        content[100] ^= 1
        path.write_bytes(content)
        job = wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"])
        assert job["status"] == "failed"
        assert digest[:12] in job["error"]["detail"]
        assert "doctor" in job["error"]["detail"]
        archive = client.get(f"/sessions/{session}/archive", params={"scene": False})
        assert_problem(archive, 503, digest[:12])  # a damaged file is never packed as if it were whole
    said = _doctor(data)
    assert [(row["session"], row["capture"]) for row in said["findings"]] == [(session, "p05")]
    assert said["damaged"] is True


def _tried(data: Path) -> str:
    """Return what a server says that does not start, nothing where it does."""
    tried = ServerProcess(data, forked=True)
    try:
        tried.wait()
    except AssertionError as error:
        return str(error)
    tried.kill()
    return ""


def _pages(client: httpx.Client) -> Iterator[str]:
    """Give the sessions' ids, page by page of one."""
    cursor = {}
    while cursor is not None:
        page = client.get("/sessions", params={"limit": 1, **cursor}).json()
        yield from (item["id"] for item in page["items"])
        cursor = {"cursor": page["next"]} if page["next"] else None


def _doctor(data: Path) -> dict[str, Any]:
    doctor = ForkedCommand(["server.cli", "doctor", "--data", str(data), "--json"])
    printed, said = doctor.communicate(timeout=300)
    assert doctor.returncode == 1, said
    return json.loads(printed)


def _form(record: dict[str, Any], content: bytes) -> tuple[bytes, str]:
    request = httpx.Request(
        "POST",
        "http://x",
        files=[("record", (None, json.dumps(record))), ("files", ("1.csv", content))],
    )
    return request.read(), request.headers["Content-Type"]


def _cut(client: httpx.Client, path: str, kind: str, body: bytes, length: int) -> None:
    """Send the beginning of a request, and hang up."""
    host, port = client.base_url.host, client.base_url.port
    head = (
        f"POST {path} HTTP/1.1\r\nHost: {host}:{port}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n\r\n"
    )
    with socket.create_connection((host, port)) as connection:
        connection.sendall(head.encode() + body)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\x00\x00\x00\x00\x00\x00\x00")
