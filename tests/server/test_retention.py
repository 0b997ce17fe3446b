"""Retention: by age, by cell and by a cell's quota; first only told, then done; what is in force stays."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import update

from server.cli import main
from server.settings import Settings
from server.store.database import Store
from server.store.models import SessionRow
from server.store.releases import add_release
from tests.server.live_server import make_session, upload
from tests.server.test_captures import arc_csv, record

CELL = {"pose_convention": "fanuc", "sphere_diameter_mm": 40.0, "scanner": {"kind": "profile"}}
Printed = pytest.CaptureFixture[str]


@pytest.fixture
def data(start: Callable[..., Any], tmp_path: Path) -> Path:
    """A store with three sessions of press-7 and one of press-8: of January, February, March, and January."""
    with start() as client:
        ids = [make_session(client, cell={**CELL, "id": "press-7"}) for _ in range(3)] + [
            make_session(client, cell={**CELL, "id": "press-8"})
        ]
        for number, session in enumerate(ids):
            extra = b"\n" * number  # files of one content would be stored once
            assert upload(client, session, record(), arc_csv() + extra).status_code == 201
    store = Store(Settings(data=tmp_path / "data"), lambda _: None)
    with store.write() as db:
        for session, month in zip(ids, (1, 2, 3, 1), strict=True):
            moment = f"2020-0{month}-01T00:00:00.000Z"
            db.execute(update(SessionRow).where(SessionRow.id == session).values(updated=moment))
    store.close()
    return tmp_path / "data"


def told(data: Path, capsys: Printed, *options: str) -> dict[str, Any]:
    assert main(["retention", "--data", str(data), "--json", *options]) == 0
    return json.loads(capsys.readouterr().out)


def test_old_sessions_are_told_first_and_then_removed(data: Path, capsys: Printed) -> None:
    found = told(data, capsys, "--days", "30", "--cell", "press-7")
    assert ([one["updated"][:7] for one in found["sessions"]], found["removed"]) == (
        ["2020-01", "2020-02", "2020-03"],
        0,
    )
    assert told(data, capsys, "--days", "30", "--cell", "press-7") == found  # nothing went
    assert told(data, capsys, "--days", "30", "--cell", "press-7", "--remove")["removed"] == 3
    assert [one["cell"] for one in told(data, capsys, "--days", "30")["sessions"]] == ["press-8"]
    assert main(["doctor", "--data", str(data)]) == 0


@pytest.mark.thorough
def test_a_server_far_away_tells_the_same_and_keeps_what_changed_meanwhile(
    data: Path, start: Callable[..., Any], capsys: Printed
) -> None:
    here = told(data, capsys, "--days", "30")
    with start() as client:
        server = ["--server", str(client.base_url).removesuffix("/api/v1/")]
        assert main(["retention", "--json", "--days", "30", *server]) == 0
        assert json.loads(capsys.readouterr().out) == here
        old = client.get("/retention", params={"days": 30, "cell": "press-8"}).json()["items"]
        changed = here["sessions"][0]["id"]
        stale = {"If-Match": f'"{here["sessions"][0]["revision"]}"'}
        assert client.patch(f"/sessions/{changed}", json={"name": "in use"}).status_code == 200
        assert client.delete(f"/sessions/{changed}", headers=stale).status_code == 412
        assert main(["retention", "--json", "--days", "30", "--remove", *server]) == 0
        assert json.loads(capsys.readouterr().out)["removed"] == 3
        assert [one["id"] for one in client.get("/sessions").json()["items"]] == [changed]
        assert [one["cell"] for one in old] == ["press-8"]
        for wrong in ({}, {"days": -1}, {"quota_mb": 1e300}):
            assert client.get("/retention", params=wrong).status_code == 422


def test_a_quota_lets_the_oldest_of_a_cell_go(data: Path, capsys: Printed) -> None:
    size_mb = len(arc_csv()) / 1e6
    found = told(data, capsys, "--quota-mb", str(2.2 * size_mb))
    assert [(one["cell"], one["updated"][:7], one["why"]) for one in found["sessions"]] == [
        ("press-7", "2020-01", "quota")
    ]


def test_what_is_in_force_for_a_cell_stays(data: Path, capsys: Printed) -> None:
    everything = told(data, capsys, "--days", "30")["sessions"]
    store = Store(Settings(data=data), lambda _: None)
    with store.write() as db:
        answer = {"cell": "press-7", "verdict": "pass", "solved": None}
        add_release(db, everything[0]["id"], answer, "Ada", "", [])
    store.close()
    left = told(data, capsys, "--days", "30")["sessions"]
    assert {one["id"] for one in everything} - {one["id"] for one in left} == {everything[0]["id"]}


@pytest.mark.parametrize("options", [[], ["--days", "-1"], ["--quota-mb", "nan"], ["--days", "1e300"]])
def test_rules_that_are_none_are_refused(data: Path, options: list[str], capsys: Printed) -> None:
    assert main(["retention", "--data", str(data), *options]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
