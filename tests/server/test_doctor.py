"""`scancell doctor`, `backup` and `restore`, on both kinds of store: what is damaged is named, and comes back."""

import itertools
import json
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path

import httpx
import pytest
from sqlalchemy import text

from calib_core.archive.keys import keys
from calib_core.errors import ConflictError, DamagedError, InputError
from server.cli import main
from server.settings import Settings
from server.store import store_lock
from server.store.backup import MANIFEST, back_up, restore
from server.store.blob_folder import FolderBlobs
from server.store.blob_places import open_blobs
from server.store.database import Store
from server.store.doctor import Examination, examine
from server.store.engine import engine_of
from server.store.repair import repair
from tests.server.live_server import assert_problem, make_session, serving, upload
from tests.server.stores import NewPlace, alter

RECORD = {"step": "tcp", "kind": "profile", "pose": [0, 0, 0, 0, 0, 0]}


def rows(number: int) -> bytes:
    return "".join(f"{x},{200 + number + x % 3}\n" for x in range(50)).encode()


def digest(number: int) -> str:
    return sha256(rows(number)).hexdigest()


@pytest.fixture
def session(settings: Settings) -> str:
    """A store with one session of three captures."""
    with serving(settings) as client:
        made = make_session(client, name="cell 4")
        for number in range(3):
            answer = upload(client, made, {"id": f"p{number}", **RECORD}, rows(number))
            assert answer.status_code == 201, answer.text
    return made


def contents(client: httpx.Client, session: str) -> Iterator[bytes]:
    for item in client.get(f"/sessions/{session}/captures").json()["items"]:
        name = item["files"][0]
        yield client.get(f"/sessions/{session}/captures/{item['id']}/files/{name}").content


def told(found: Examination) -> list[tuple[str, str, str]]:
    return [(finding.kind, finding.session, finding.capture) for finding in found.findings]


@pytest.mark.thorough(keep=1)
def test_a_sound_store_is_called_sound_also_while_it_is_used(settings: Settings, session: str) -> None:
    for _ in range(2):
        found = examine(settings)
        assert (found.sessions, found.captures, found.files, found.findings) == (1, 3, 3, [])
    with serving(settings) as client:
        upload(client, session, {"id": "p9", **RECORD}, rows(9))
        assert examine(settings).captures == 4


@pytest.mark.thorough(keep=1)
def test_damaged_captures_are_named_and_mended_from_a_backup(
    settings: Settings,
    session: str,
    tmp_path: Path,
) -> None:
    backup = tmp_path / "backup"
    assert back_up(settings, backup).rows["captures"] == 3
    alter(settings, digest(0), rows(0)[:-1])
    alter(settings, digest(2), None)
    blobs = open_blobs(settings.blob_place)
    blobs.put(b"nobody's")
    if isinstance(blobs, FolderBlobs):
        (settings.data / "blobs" / "arriving" / "half").write_bytes(b"12")
    found = examine(settings)
    damage = [finding for finding in found.findings if finding.kind == "damage"]
    assert [(finding.session, finding.capture) for finding in damage] == [(session, "p0"), (session, "p2")] or [
        (finding.session, finding.capture) for finding in damage
    ] == [(session, "p2"), (session, "p0")]
    assert {finding.sha256: finding.what.split(" is ")[1].split()[0] for finding in damage} == {
        digest(0): "altered",
        digest(2): "missing",
    }
    leftovers = [finding.what.split()[0] for finding in found.findings if finding.kind == "leftover"]
    assert leftovers == (["1", "1"] if settings.blobs is None else ["1"])

    with serving(settings) as client:  # the sound one is given out, the damaged one with what is wrong
        assert client.get(f"/sessions/{session}/captures/p1/files/p1.csv").content == rows(1)
        altered = client.get(f"/sessions/{session}/captures/p0/files/p0.csv")
        assert_problem(altered, 503, "as it was stored", "doctor")
        assert_problem(client.get(f"/sessions/{session}/captures/p2/files/p2.csv"), 404, "nothing there")
        with pytest.raises(ConflictError, match="in use"):
            repair(settings, found, backup)

    done = repair(settings, found, backup)
    assert sum("was put back" in line for line in done) == 2
    assert told(examine(settings)) == []
    with serving(settings) as client:
        assert list(contents(client, session)) == [rows(0), rows(1), rows(2)]


@pytest.mark.thorough(keep=1)
def test_rows_that_contradict_each_other_are_named(settings: Settings, session: str) -> None:
    engine = engine_of(settings.sql_url)
    with engine.execution_options(writing=True).begin() as connection:
        connection.execute(text("UPDATE captures SET record = '{\"id\": 1}' WHERE id = 'p0'"))
        connection.execute(text("DELETE FROM files WHERE capture_id = 'p1'"))
        connection.execute(text("UPDATE captures SET measured = '[]' WHERE id = 'p2'"))
        connection.execute(text("UPDATE sessions SET last_event = 99"))
    engine.dispose()
    found = examine(settings)
    assert sorted((finding.capture, finding.kind) for finding in found.findings) == [
        ("", "damage"),  # the session's record with such a capture
        ("", "damage"),  # its log
        ("", "leftover"),  # the blob that lost its row
        ("p0", "damage"),
        ("p1", "damage"),
        ("p2", "damage"),
    ]


@pytest.mark.thorough
def test_a_backup_is_restored_also_into_the_other_kind_of_store(
    settings: Settings,
    new_place: NewPlace,
    session: str,
    tmp_path: Path,
) -> None:
    backup = tmp_path / "backup"
    first = back_up(settings, backup)
    with serving(settings) as client:
        upload(client, session, {"id": "p3", **RECORD}, rows(3))
        client.delete(f"/sessions/{session}/captures/p0")
        second = back_up(settings, backup)  # while the server runs, over the first
        upload(client, session, {"id": "p4", **RECORD}, rows(4))
    assert (first.rows["captures"], second.rows["captures"]) == (3, 3)
    assert sorted(path.name.split("-")[0] for path in backup.iterdir()) == [MANIFEST, "blobs", "tables"]
    for place in (new_place(tmp_path / "same"), {"data": tmp_path / "sqlite"}):
        other = Settings(**place, port=0, warm_up=False)
        restore(backup, other)
        assert told(examine(other)) == []
        with serving(other) as client:
            assert list(contents(client, session)) == [rows(1), rows(2), rows(3)]
            assert upload(client, session, {"id": "p5", **RECORD}, rows(5)).status_code == 201
            job = client.post(f"/sessions/{session}/solve/tcp")  # rows numbered by the database go on
            assert job.status_code == 202
        with pytest.raises(ConflictError, match="without a store"):
            restore(backup, other)


@pytest.mark.thorough(keep=1)
def test_a_backup_under_load_restores_to_the_last_acknowledged_capture(settings: Settings, tmp_path: Path) -> None:
    backup, other = tmp_path / "backup", Settings(data=tmp_path / "other", port=0, warm_up=False)
    acknowledged: list[tuple[str, int]] = []
    stop = threading.Event()

    def send(address: str, session: str) -> None:
        with httpx.Client(base_url=address, timeout=300, trust_env=False) as sender:
            for number in itertools.count():
                if stop.is_set():
                    return
                answer = upload(sender, session, {"id": f"p{number}", **RECORD}, rows(number))
                assert answer.status_code == 201, answer.text
                acknowledged.append((session, number))

    with serving(settings) as client, ThreadPoolExecutor() as pool:
        senders = [pool.submit(send, str(client.base_url), make_session(client)) for _ in range(2)]
        try:
            for count in (1, 20):  # the second goes into the folder of the first
                while len(acknowledged) < count and not any(sender.done() for sender in senders):
                    time.sleep(0.01)
                before = list(acknowledged)
                back_up(settings, backup)
        finally:
            stop.set()
        for sender in senders:
            sender.result()
    assert len(acknowledged) > len(before) >= 20
    restore(backup, other)
    assert told(examine(other)) == []
    with serving(other) as client:
        for session, number in before:
            file = client.get(f"/sessions/{session}/captures/p{number}/files/p{number}.csv")
            assert file.content == rows(number)


@pytest.mark.thorough(keep=1)
def test_a_damaged_backup_is_not_restored(settings: Settings, session: str, tmp_path: Path) -> None:
    backup = tmp_path / "backup"
    back_up(settings, backup)
    (table,) = backup.glob("tables-*/captures.jsonl")
    whole = table.read_bytes()
    table.write_bytes(whole.replace(b'"p1"', b'"q1"'))
    new = Settings(data=tmp_path / "new")
    with pytest.raises(DamagedError, match="captures"):
        restore(backup, new)
    table.write_bytes(whole)
    kept = FolderBlobs(backup / "blobs").path(digest(1))
    kept.write_bytes(b"altered")
    with pytest.raises(DamagedError):
        restore(backup, new)
    kept.write_bytes(rows(1))
    assert restore(backup, new).rows["captures"] == 3  # what failed has left nothing in the way
    alter(settings, digest(1), None)
    kept.unlink()
    with pytest.raises(Exception, match="doctor"):
        back_up(settings, backup)


def test_an_older_store_is_examined_and_migrated(tmp_path: Path) -> None:
    from kill_server import old_store

    data = tmp_path / "data"
    old_store(data, 3)
    before = (data / "scancell.db").read_bytes()
    (data / "blobs" / "arriving").rmdir()  # an older version made fewer folders
    there = sorted(data.rglob("*"))
    found = examine(Settings(data=data))
    assert sorted(data.rglob("*")) == there
    assert [finding.kind for finding in found.findings] == ["note"]
    assert "0001" in found.findings[0].what
    assert (found.sessions, found.captures) == (3, 3)
    assert (data / "scancell.db").read_bytes() == before
    backup = tmp_path / "backup"
    back_up(Settings(data=data), backup)
    new = Settings(data=tmp_path / "new")
    restore(backup, new)
    assert examine(new).findings == []


def test_the_commands_say_what_they_did(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data, out = str(tmp_path / "data"), str(tmp_path / "backup")
    assert main(["doctor", "--data", data]) == 2
    assert "scancell serve --data" in capsys.readouterr().err
    assert not (tmp_path / "data").exists()
    assert main(["backup", "--data", data, "--out", out]) == 2
    with store_lock.store_lock(Settings(data=tmp_path / "data")):
        pass
    assert main(["doctor", "--data", data]) == 0
    assert "0 sessions, 0 captures, 0 files: nothing is damaged" in capsys.readouterr().out
    store = Store(Settings(data=tmp_path / "data"), print)
    blob = store.blobs.put(b"points")
    store.close()
    assert main(["backup", "--data", data, "--out", out]) == 0
    assert main(["doctor", "--data", data, "--repair"]) == 0
    assert "repaired: 1 file that nothing refers to was removed" in capsys.readouterr().out
    assert not FolderBlobs(tmp_path / "data" / "blobs").path(blob).exists()
    assert main(["restore", out, "--data", str(tmp_path / "new")]) == 0
    capsys.readouterr()
    assert main(["doctor", "--data", str(tmp_path / "new"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["damaged"] is False
    (tmp_path / "new" / "scancell.db").write_bytes(b"SQLite format 3\0" + b"\xff" * 9000)
    assert main(["doctor", "--data", str(tmp_path / "new")]) == 1
    assert "database cannot be read" in capsys.readouterr().out
    assert main(["doctor", "--data", data, "--backup", out]) == 2
    assert main(["backup", "--data", data, "--out", str(tmp_path)]) == 2
    with pytest.raises(InputError, match="backup"):
        restore(tmp_path, Settings(data=tmp_path / "x"))


def test_what_another_installation_signed_is_told_when_it_is_restored(
    settings: Settings,
    session: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    there = keys().own_key
    back_up(settings, tmp_path / "backup")
    monkeypatch.setenv("SCANCELL_KEY_FILE", str(tmp_path / "here" / "key.pem"))
    assert main(["restore", str(tmp_path / "backup"), "--data", str(tmp_path / "new")]) == 0
    assert f"signed with the key {there}" in capsys.readouterr().err
    assert main(["doctor", "--data", str(tmp_path / "new")]) == 1
    told = capsys.readouterr()
    assert "by other ways" not in told.out + told.err  # nobody is accused
