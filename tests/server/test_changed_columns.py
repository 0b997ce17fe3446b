"""Every column of every table, changed in turn in the database: told, or it is one that decides nothing."""

import json
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from server.settings import Settings
from server.store.changed_rows import accept
from server.store.doctor import examine
from server.store.models import Base
from tests.core.test_forged_results import leaves, other
from tests.server.live_server import serving, simulated_session

CELL = "cell-of-columns"
DECIDES_NOTHING = {
    "results": "number created",  # one that is put before the newest is told, by what was solved last
    "sessions": "updated revision last_position name_folded simulated",
    "captures": "position revision created",  # when it came, and after which: no stage asks
    "files": "size",
    "releases": "number",  # the same
    "equipment": "updated",
}
"""What beside the signed may change and stay untold: counters, and what a server writes for its own lists."""
WORK = {
    *("waiting", "jobs", "events", "answers", "server_number", "deliveries", "webhooks"),
    *("devices", "tokens", "logins", "audit", "outputs"),
}
"""Tables of what goes on and of who may: no answer or report is made from them."""


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[httpx.Client, list[str], Settings]]:
    """A session that is solved twice and released twice, with equipment, and the addresses that must tell."""
    settings = Settings(data=tmp_path_factory.mktemp("columns"), port=0, warm_up=False)
    with serving(settings) as client:
        session = simulated_session(client, captures=14)
        client.patch(f"/sessions/{session}", json={"name": "Cell of Columns"}).raise_for_status()
        for _ in range(2):
            client.post(f"/sessions/{session}/solve/tcp", params={"wait": 60}).raise_for_status()
            client.post(f"/sessions/{session}/release", json={"why": "set up"}).raise_for_status()
        piece = {"kind": "sphere", "name": "K80", "serial": "S-1", "certificate": {"number": "K-1"}}
        here = f"/equipment/{client.post('/equipment', json=piece).raise_for_status().json()['id']}"
        client.put(f"{here}/certificate", files={"file": ("K-1.pdf", b"%PDF-1.7 K-1")}).raise_for_status()
        file = f"/sessions/{session}/captures/p03"
        file = f"{file}/files/{client.get(file).json()['files'][0]}"
        answers = [f"/sessions/{session}/answer", f"/cells/{CELL}/answer", here, f"{here}/certificate", file]
        yield client, answers, settings


def told(served: tuple[httpx.Client, list[str], Settings]) -> list[object]:
    """Return what whoever asks is told: statuses and faults."""
    answers = [served[0].get(address) for address in served[1]]
    return [(one.status_code, one.headers.get("Scancell-Faults"), '"altered":true' in one.text) for one in answers]


def damage(served: tuple[httpx.Client, list[str], Settings]) -> list[str]:
    """Return what `scancell doctor` calls damage."""
    return [one.what for one in examine(served[2]).findings if one.kind == "damage"]


def test_every_table_is_looked_at() -> None:
    assert set(Base.metadata.tables) == {*DECIDES_NOTHING, "signed_log", *WORK}


@pytest.mark.thorough(keep=2)
@pytest.mark.parametrize("table", [*DECIDES_NOTHING, "signed_log"])
def test_every_column_that_was_changed_is_told(
    served: tuple[httpx.Client, list[str], Settings], table: str
) -> None:
    untold, before = DECIDES_NOTHING.get(table, "").split(), told(served)
    assert damage(served) == []
    with sqlite3.connect(served[2].data / "scancell.db", isolation_level=None, timeout=20) as db:
        of = {"captures": "id = 'p03'", "files": "capture_id = 'p03'"}.get(table, "1")
        row = db.execute(f"SELECT max(rowid) FROM {table} WHERE {of}").fetchone()[0]
        for column in Base.metadata.tables[table].columns.keys():  # noqa: SIM118 - the columns are no dictionary
            value = db.execute(f'SELECT "{column}" FROM {table} WHERE rowid = ?', (row,)).fetchone()[0]
            db.execute(f'UPDATE {table} SET "{column}" = ? WHERE rowid = ?', (changed(value), row))
            is_told = told(served) != before or damage(served) != []
            changed_to = db.execute(
                f'SELECT rowid FROM {table} WHERE "{column}" IS ?', (changed(value),)
            ).fetchone()
            db.execute(f'UPDATE {table} SET "{column}" = ? WHERE rowid = ?', (value, *changed_to))
            assert is_told == (column not in untold), column
            if value is not None and Base.metadata.tables[table].c[column].nullable:  # and taken off
                db.execute(f'UPDATE {table} SET "{column}" = NULL WHERE rowid = ?', (row,))
                assert (told(served) != before or damage(served) != []) == (column not in untold), column
                db.execute(f'UPDATE {table} SET "{column}" = ? WHERE rowid = ?', (value, row))
    db.close()
    assert (told(served), damage(served)) == (before, [])


def changed(value: object) -> object:
    """Return another value that the column takes."""
    if isinstance(value, int | float):
        return value + 1
    if isinstance(value, bytes):
        return value + b" "
    if value is None or str(value)[:1] not in "{[":
        return f"{value or ''}1"
    data = json.loads(str(value))
    found = list(leaves(data))
    container, name = next((leaf for leaf in found if leaf[1] == "pose_convention"), found[-1])
    container[name] = other(container[name])
    return json.dumps(data)


@pytest.mark.parametrize("table", ["results", "releases"])
def test_an_older_one_put_before_the_newest_is_told(
    served: tuple[httpx.Client, list[str], Settings], table: str
) -> None:
    before = told(served)
    with sqlite3.connect(served[2].data / "scancell.db", isolation_level=None, timeout=20) as db:
        db.execute(f"UPDATE {table} SET number = number + 1000 WHERE number = (SELECT min(number) FROM {table})")
        assert "altered" in str(told(served))
        assert damage(served)
        db.execute(f"UPDATE {table} SET number = number - 1000 WHERE number > 1000")
    db.close()
    assert (told(served), damage(served)) == (before, [])


def test_what_was_changed_beside_the_signed_is_accepted_when_asked(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path, port=0, warm_up=False)
    with serving(settings) as client:
        session = simulated_session(client, captures=14)
        client.post(f"/sessions/{session}/solve/tcp", params={"wait": 60}).raise_for_status()
    with sqlite3.connect(tmp_path / "scancell.db") as db:
        db.execute("UPDATE sessions SET name = 'another'")
        db.execute("UPDATE results SET verdict = 'fail'")
        db.execute("UPDATE results SET solved_from = json_set(solved_from, '$.files.\"forged.csv\"', '0')")
    db.close()
    said = " ".join(one.what for one in examine(settings).findings if one.kind == "damage")
    assert "record was changed" in said
    assert "newest result of tcp was taken out, or changed" in said
    assert "result 1 of tcp was solved from was changed" in said
    accept(settings)
    assert not examine(settings).damaged
    with sqlite3.connect(tmp_path / "scancell.db") as db:
        assert db.execute("SELECT solved_from FROM results").fetchall() == [(None,)]
    db.close()
