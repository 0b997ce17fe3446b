"""Rows that somebody changed in the database: named by every answer, and neither exported nor released."""

import json
import sqlite3
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import httpx
import pytest

from server.settings import Settings
from server.store.changed_rows import accept
from server.store.doctor import examine
from tests.core.test_forged_results import leaves, other
from tests.server.access import bearer, guarded
from tests.server.live_server import assert_problem, serving, simulated_session, upload, wait_for
from tests.server.test_standing import solved_in
from tests.verified import verified_session

CELL = "cell-of-forgers"
Change = Callable[[str, str, Callable[[Any], Any]], None]


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[httpx.Client, str, Path]]:
    """A session that is solved and released twice, and the database that it lies in."""
    data: Path = tmp_path_factory.mktemp("forged")
    with serving(Settings(data=data, port=0, warm_up=False)) as client:
        session = simulated_session(client, captures=14)
        client.patch(f"/sessions/{session}", json={"name": "Cell of Forgers"}).raise_for_status()
        for _ in range(2):
            client.post(f"/sessions/{session}/solve/tcp", params={"wait": 60}).raise_for_status()
            client.post(f"/sessions/{session}/release", json={"why": "set up"}).raise_for_status()
            client.patch(f"/sessions/{session}/captures/p03", json={"excluded": True}).raise_for_status()
        client.post(f"/sessions/{session}/solve/tcp", params={"wait": 60}).raise_for_status()
        yield client, session, data / "scancell.db"


@pytest.fixture
def change(served: tuple[httpx.Client, str, Path]) -> Iterator[Change]:
    """Change a column of a table's newest row; every row is as before afterwards."""
    with sqlite3.connect(served[2], isolation_level=None, timeout=20) as db:
        before: dict[tuple[str, str, int], str] = {}

        def changed(table: str, column: str, by: Callable[[Any], Any]) -> None:
            number, text = db.execute(f"SELECT number, {column} FROM {table} ORDER BY number DESC").fetchone()
            text = before.setdefault((table, column, number), text)
            new = json.dumps(by(json.loads(text))) if column in ("record", "answer") else by(text)
            db.execute(f"UPDATE {table} SET {column} = ? WHERE number = ?", (new, number))

        yield changed
        for (table, column, number), text in before.items():
            db.execute(f"UPDATE {table} SET {column} = ? WHERE number = ?", (text, number))
    db.close()


def test_the_time_line_says_who_decided(served: tuple[httpx.Client, str, Path]) -> None:
    client, session, _ = served
    items = client.get(f"/sessions/{session}/timeline").json()["items"]
    kinds = [item["kind"] for item in items if item["kind"] not in ("capture", "now")]
    assert kinds == ["result", "release", "result", "release", "result"]
    (told,) = {item["message"].partition(". ")[2] for item in items if item["kind"] == "release"}
    assert told == "Reason: set up"
    place = next(item["place"] for item in items if item["kind"] == "release")
    assert client.get(f"/sessions/{session}/timeline/{place}").json()["results"].keys() == {"tcp"}


def test_a_result_that_was_changed_is_no_answer(served: tuple[httpx.Client, str, Path], change: Change) -> None:
    client, session, _ = served
    for changes in (
        {"software": "scancell 9"},
        {"pose_convention": "none"},
        {"solved": "2020-01-01T00:00:00.000Z"},
    ):
        change("results", "record", lambda record, changes=changes: record | changes)
        assert client.get(f"/sessions/{session}/exports/kuka").status_code in (409, 422)
        assert client.post(f"/sessions/{session}/release", json={}).status_code in (409, 422)
    assert client.get(f"/sessions/{session}/answer").json()["faults"] == ["altered", "not-replayed"]
    report = client.get(f"/sessions/{session}/report").text
    assert "2020-01-01 00:00 UTC, as told: nobody who is trusted here has signed this date" in report
    assert "20200101" not in report


def test_every_field_of_a_release_that_was_changed_is_named(
    served: tuple[httpx.Client, str, Path], change: Change
) -> None:
    client, _, database = served
    with sqlite3.connect(database, timeout=20) as db:
        (text,) = db.execute("SELECT answer FROM releases ORDER BY number DESC").fetchone()
    db.close()
    answer = json.loads(text)
    for container, name in list(leaves(answer)):
        value, container[name] = container[name], other(container[name])
        change("releases", "answer", lambda _: answer)
        told = client.get(f"/cells/{CELL}/answer")
        assert "not-replayed" in told.headers.get("Scancell-Faults", ""), (name, told.text)
        container[name] = value
    change("releases", "answer", lambda _: answer)
    assert client.get(f"/cells/{CELL}/answer").headers["Scancell-Faults"] == ""


@pytest.mark.parametrize("column", ["who", "why", "created"])
def test_a_release_that_was_changed_is_told_as_such_wherever_it_stands(
    served: tuple[httpx.Client, str, Path], change: Change, column: str
) -> None:
    client = served[0]
    first, newest = (client.get(f"/cells/{CELL}/history").json()["releases"][k] for k in (-1, 0))
    assert newest["signed"]
    assert first["signed"]
    change("releases", column, lambda text: text[:-1] + "0")
    (told,) = (one for one in client.get("/cells").json()["items"] if one["id"] == CELL)
    assert not told["released"]["signed"]
    assert "not-replayed" in client.get(f"/cells/{CELL}/answer").headers["Scancell-Faults"]
    assert not client.get(f"/cells/{CELL}/history").json()["releases"][0]["signed"]


def test_a_changed_release_is_in_no_report_and_archive_as_signed_and_a_roll_back_mends_nothing(
    served: tuple[httpx.Client, str, Path], change: Change
) -> None:
    client, session, _ = served
    client.post(f"/sessions/{session}/release", json={"why": "third"}).raise_for_status()
    unsigned = "Nobody who is trusted here has signed this as it stands."
    archived = f"/sessions/{session}/archive"

    def names() -> set[str]:
        with ZipFile(BytesIO(client.get(archived, params={"scene": False}).content)) as archive:
            return {name.rpartition("/")[2] for name in archive.namelist()}

    assert "release.json" in names()
    assert unsigned not in client.get(f"/sessions/{session}/report").text
    change("releases", "who", lambda who: f"{who} 2")
    assert "release.json" not in names()
    assert unsigned in client.get(f"/sessions/{session}/report").text

    forged = client.get(f"/cells/{CELL}/history").json()["releases"][0]["number"]
    back = client.post(f"/cells/{CELL}/rollback", json={"number": forged})
    assert back.status_code == 409
    assert "not-replayed" in back.json()["detail"]
    back = client.post(f"/cells/{CELL}/rollback", json={"number": forged, "allow": "not-replayed"})
    assert not back.raise_for_status().json()["signed"]
    assert "not-replayed" in client.get(f"/cells/{CELL}/answer").headers["Scancell-Faults"]


LEAVES = {
    "sessions": ("record", "id", "/sessions/{session}/answer"),
    "captures": ("record", "rowid", "/sessions/{session}/answer"),
    "measured": ("measured", "rowid", "/sessions/{session}/answer"),
    "policy": ("told", "number", "/cells/{cell}/answer"),
    "acknowledged": ("told", "number", "/cells/{cell}/answer"),
}
"""Of each stored record: its column, its key, and where a change of any field must be told."""


@pytest.mark.thorough(keep=2)
@pytest.mark.parametrize("record", LEAVES)
def test_every_field_of_a_stored_record_that_was_changed_is_told(
    served: tuple[httpx.Client, str, Path], record: str
) -> None:
    client, session, database = served
    client.put(f"/cells/{CELL}/policy", json={"needs": [], "interval_days": 90}).raise_for_status()
    column, key, address = LEAVES[record]
    cell = CELL
    if record == "acknowledged":
        cell = "remounted"
        client.post(f"/sessions/{solved_in(client, cell)}/release", json={}).raise_for_status()
        solved_in(client, cell, seed=8)
        client.post(f"/cells/{cell}/acknowledge", json={"fault": "drift", "why": "told"}).raise_for_status()
    is_logged = record in ("policy", "acknowledged")
    table = "signed_log" if is_logged else {"measured": "captures"}.get(record, record)
    where = f"kind = '{record}'" if is_logged else "1"

    def faults() -> str:
        return client.get(address.format(session=session, cell=cell)).headers["Scancell-Faults"]

    assert "altered" not in faults()
    with sqlite3.connect(database, isolation_level=None, timeout=20) as db:
        found = f"SELECT {key}, {column} FROM {table} WHERE {where} ORDER BY {key} DESC"
        number, text = db.execute(found).fetchone()
        data = json.loads(text)
        for container, name in list(leaves(data)):
            value, container[name] = container[name], other(container[name])
            db.execute(f"UPDATE {table} SET {column} = ? WHERE {key} = ?", (json.dumps(data), number))
            container[name] = value
            told = client.get(address.format(session=session, cell=cell))
            assert told.status_code == 422 or "altered" in told.headers["Scancell-Faults"], (name, told.text)
        db.execute(f"UPDATE {table} SET {column} = ? WHERE {key} = ?", (text, number))
    db.close()
    assert "altered" not in faults()


def test_a_piece_of_equipment_and_its_certificate_that_were_changed_are_told(
    served: tuple[httpx.Client, str, Path],
) -> None:
    client, _, database = served
    settings = Settings(data=database.parent)
    certificate = {"number": "K-1", "due": "2030-01-01"}
    told = {"kind": "sphere", "name": "K80-1", "serial": "S-1", "certificate": certificate}
    piece = client.post("/equipment", json=told).raise_for_status().json()["id"]
    here = f"/equipment/{piece}"
    client.put(f"{here}/certificate", files={"file": ("K-1.pdf", b"%PDF-1.7 K-1")}).raise_for_status()
    referring = {"cell": {"pose_convention": "ur", "equipment": [{"kind": "sphere", "register_id": piece}]}}
    client.post("/sessions", json=referring).raise_for_status()
    assert not client.get(here).json()["altered"]
    with sqlite3.connect(database, isolation_level=None, timeout=20) as db:
        text, file = db.execute("SELECT record, certificate_file FROM equipment").fetchone()
        data = json.loads(text)
        for container, name in list(leaves(data)):
            value, container[name] = container[name], other(container[name])
            db.execute("UPDATE equipment SET record = ?", (json.dumps(data),))
            container[name] = value
            answer = client.get(here)
            assert answer.status_code == 422 or answer.json()["altered"], name
            assert_problem(client.post("/sessions", json=referring), 409, "changed in the database")
        db.execute("UPDATE equipment SET record = ?", (text,))
        for other_file in (file.replace(b"1.7", b"1.4"), None):
            db.execute("UPDATE equipment SET certificate_file = ?", (other_file,))
            assert_problem(client.get(f"{here}/certificate"), 503, "certificate")
            assert_problem(client.post("/sessions", json=referring), 503, "certificate")
            assert [one.what for one in examine(settings).findings if one.kind == "damage" and piece in one.what]
        db.execute("UPDATE equipment SET certificate_sha256 = NULL")  # as if it never had one
        assert client.get(here).json()["altered"]
    db.close()
    client.put(f"{here}/certificate", files={"file": ("K-1.pdf", file[:-1])}).raise_for_status()
    assert client.get(here).json()["altered"]  # what is written over it mends nothing, unless it is what it was
    client.put(f"{here}/certificate", files={"file": ("K-1.pdf", file)}).raise_for_status()
    assert client.get(f"{here}/certificate").content == file
    assert not client.get(here).json()["altered"]
    client.delete(here).raise_for_status()


def test_what_was_changed_stays_told_when_the_server_writes_it_again(
    served: tuple[httpx.Client, str, Path],
) -> None:
    client, session, database = served
    with sqlite3.connect(database, isolation_level=None, timeout=20) as db:
        record, text = db.execute(
            "SELECT record, measured FROM captures WHERE id = 'p05' AND session_id = ?", (session,)
        ).fetchone()
        better = json.dumps({**json.loads(text), "points": 9999})
        db.execute("UPDATE captures SET measured = ? WHERE id = 'p05' AND session_id = ?", (better, session))
        client.patch(f"/sessions/{session}/captures/p05", json={"excluded": True}).raise_for_status()
        client.patch(f"/sessions/{session}/captures/p05", json={"excluded": False}).raise_for_status()
        assert "altered" in client.get(f"/sessions/{session}/answer").json()["faults"]
        kept = [
            one
            for one in client.get(f"/sessions/{session}/answer").json()["findings"]
            if one["code"] == "answer-altered"
        ]
        assert "scancell doctor" in kept[0]["to_do"]
        found = examine(Settings(data=database.parent))
        assert [(one.session, one.capture) for one in found.findings if one.kind == "damage"] == [(session, "p05")]
        back = "UPDATE captures SET record = ?, measured = ? WHERE id = 'p05' AND session_id = ?"
        db.execute(back, (record, text, session))
        assert "altered" not in client.get(f"/sessions/{session}/answer").json()["faults"]
    db.close()


def test_an_entry_of_the_log_taken_out_is_told_and_so_is_its_end(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path, port=0, warm_up=False)
    database = tmp_path / "scancell.db"

    def faults(client: httpx.Client) -> str:
        return client.get("/cells/told/answer").headers["Scancell-Faults"]

    with serving(settings) as client:
        session = simulated_session(client, captures=14)
        client.patch(f"/sessions/{session}", json={"name": "told"}).raise_for_status()
        client.post(f"/sessions/{session}/solve/tcp", params={"wait": 60}).raise_for_status()
        client.post(f"/sessions/{session}/release", json={"why": "set up"}).raise_for_status()
        client.put("/cells/told/policy", json={"needs": []}).raise_for_status()
        client.put("/cells/told/policy", json={"needs": [], "interval_days": 30}).raise_for_status()
        assert faults(client) == ""
        with sqlite3.connect(database, isolation_level=None, timeout=20) as db:
            rows = db.execute("SELECT * FROM signed_log ORDER BY number").fetchall()
            for gone in ([rows[2]], [rows[-1]], rows[-2:], rows):  # in the midst, at the end, all of it
                for row in gone:
                    db.execute("DELETE FROM signed_log WHERE number = ?", (row[0],))
                assert faults(client) == "altered"
                assert client.post(f"/sessions/{session}/release", json={}).status_code == 409
                for row in gone:
                    db.execute(f"INSERT INTO signed_log VALUES ({', '.join('?' * len(row))})", row)
                assert faults(client) == ""
            db.execute("DELETE FROM signed_log WHERE number >= ?", (rows[-2][0],))  # as if nobody had asked for it
        db.close()
    assert [one.what for one in examine(settings).findings if one.kind == "damage"]
    assert accept(settings)
    assert not examine(settings).damaged
    with serving(settings) as client:
        assert faults(client) == ""


def test_the_newest_release_taken_out_is_told(served: tuple[httpx.Client, str, Path]) -> None:
    client, session, database = served
    client.post(f"/sessions/{session}/release", json={"why": "the newest"}).raise_for_status()
    before = client.get(f"/cells/{CELL}/answer").headers["Scancell-Faults"]
    with sqlite3.connect(database, isolation_level=None, timeout=20) as db:
        row = db.execute("SELECT * FROM releases ORDER BY number DESC").fetchone()
        db.execute("DELETE FROM releases WHERE number = ?", (row[0],))
        assert "altered" in client.get(f"/cells/{CELL}/answer").headers["Scancell-Faults"]
        db.execute(f"INSERT INTO releases VALUES ({', '.join('?' * len(row))})", row)
    db.close()
    assert client.get(f"/cells/{CELL}/answer").headers["Scancell-Faults"] == before


@pytest.mark.thorough
def test_a_decision_before_that_was_changed_or_deleted_is_told(tmp_path: Path) -> None:
    with serving(Settings(data=tmp_path, port=0, warm_up=False)) as client:
        made = verified_session(5, 1.0)
        record = made.session.to_json()
        captures = record.pop("captures")
        session = client.post("/sessions", json=record).raise_for_status().json()["id"]
        for capture in captures:
            upload(client, session, capture, *(made.files[name] for name in capture["files"])).raise_for_status()
        last = {"excluded": True, "excluded_because": {"why": "the cable touched"}}
        client.post(f"/sessions/{session}/solve/all", params={"wait": 120}).raise_for_status()
        client.patch(f"/sessions/{session}/captures/{captures[-1]['id']}", json=last).raise_for_status()
        client.post(f"/sessions/{session}/solve/verify", params={"wait": 120}).raise_for_status()

        def before() -> list[str]:
            return [one["text"] for one in client.get(f"/sessions/{session}/answer").json()["decided_before"]]

        def faults() -> list[str]:
            return client.get(f"/sessions/{session}/answer").json()["faults"]

        (told,) = before()
        assert "the cable touched" in told
        with sqlite3.connect(tmp_path / "scancell.db", isolation_level=None, timeout=20) as db:
            number, text, origin = db.execute(
                "SELECT number, record, solved_from FROM results WHERE stage = 'verify' ORDER BY number"
            ).fetchone()
            passed = {**json.loads(text), "decision": None, "verdict": "pass"}
            db.execute("UPDATE results SET record = ? WHERE number = ?", (json.dumps(passed), number))
            assert "It was removed or changed since." in before()[0]
            db.execute("UPDATE results SET record = ? WHERE number = ?", (text, number))
            assert before() == [told]
            other_limits = json.loads(origin)
            other_limits["session"]["cell"]["verification"]["tool_mm"] = 5.0
            db.execute("UPDATE results SET solved_from = ? WHERE number = ?", (json.dumps(other_limits), number))
            first = client.get(f"/sessions/{session}/results/verify/history/{number}").json()
            assert first["provenance"] == "imported"
            db.execute("DELETE FROM results WHERE number = ?", (number,))
            assert "was: failed. It was removed or changed since." in before()[0]
            # The newest verification is taken out whole: the answer does not stand without it.
            db.execute(
                "INSERT INTO results SELECT * FROM (SELECT ? AS number, session_id, stage, created, verdict,"
                " ? AS record, ? AS solved_from FROM results WHERE stage = 'verify' LIMIT 1)",
                (number, text, origin),
            )
            assert before() == [told]
            kept = db.execute("SELECT * FROM results WHERE stage = 'verify' ORDER BY number DESC").fetchone()
            assert "altered" not in faults()
            db.execute("DELETE FROM results WHERE number = ?", (kept[0],))
            assert "altered" in faults()
            db.execute("INSERT INTO results VALUES (?, ?, ?, ?, ?, ?, ?)", kept)
            # Dates of captures, and the log of changed limits, which no key knows.
            first = captures[0]["id"]
            record = json.loads(db.execute("SELECT record FROM captures WHERE id = ?", (first,)).fetchone()[0])
            later = json.dumps({**record, "taken": "2020-01-01T00:00:00.000Z"})
            db.execute("UPDATE captures SET record = ? WHERE id = ?", (later, first))
            assert "altered" in faults()
            assert client.get(f"/sessions/{session}/exports/kuka").status_code == 409
            db.execute("UPDATE captures SET record = ? WHERE id = ?", (json.dumps(record), first))
            assert "altered" not in faults()
        db.close()


def test_a_release_that_came_with_an_archive_is_told_and_is_none_of_this_servers(
    served: tuple[httpx.Client, str, Path],
) -> None:
    client, session, _ = served
    client.post(f"/sessions/{session}/release", json={"why": "to be taken along"}).raise_for_status()
    before = client.get(f"/cells/{CELL}/history").json()["releases"]
    archive = client.get(f"/sessions/{session}/archive", params={"scene": False}).content
    brought = client.post("/archives", content=archive, headers={"Content-Type": "application/zip"}).json()["id"]
    items = client.get(f"/sessions/{brought}/timeline").json()["items"]
    (told,) = (item for item in items if item["kind"] == "release")
    assert told["brought"]
    assert told["message"].endswith("Reason: to be taken along")  # signed by a key that is trusted here
    assert not any(item.get("brought") for item in client.get(f"/sessions/{session}/timeline").json()["items"])
    assert client.get(f"/cells/{CELL}/history").json()["releases"] == before


def test_who_may_only_read_sees_whether_results_replay_and_notes_nothing(tmp_path: Path) -> None:
    with guarded(tmp_path) as (client, tokens):
        client.headers.update(bearer(tokens["capture"]))
        session = simulated_session(client, captures=14)
        client.post(f"/sessions/{session}/solve/tcp", params={"wait": 60}).raise_for_status()
        with sqlite3.connect(tmp_path / "scancell.db", isolation_level=None, timeout=20) as db:
            (text,) = db.execute("SELECT record FROM results").fetchone()
            unsigned = {name: value for name, value in json.loads(text).items() if name != "seal"}
            db.execute("UPDATE results SET record = ?", (json.dumps(unsigned),))
        db.close()
        for role, provenance in (("read", "imported"), ("capture", "replayed")):
            by = bearer(tokens[role])
            job = client.post(f"/sessions/{session}/replay", headers=by).raise_for_status().json()
            assert wait_for(client, job["id"])["status"] == "done"
            assert client.get(f"/jobs/{job['id']}/answer", headers=by).json()["replay"]["equal"]
            assert client.get(f"/sessions/{session}/results/tcp").json()["provenance"] == provenance
