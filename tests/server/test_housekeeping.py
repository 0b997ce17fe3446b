"""What is tidied up by itself: old events, answers, and files that a kill left without a capture."""

import threading
from pathlib import Path
from types import SimpleNamespace

import pytest
from sqlalchemy import func, select

from calib_core.records.policy import Policy
from server.housekeeping import Alarms, Housekeeping, forget_old_events, remove_orphans
from server.store import blob_bucket, blob_folder
from server.store.answers import remember_answer
from server.store.database import Store, record_event
from server.store.models import AnswerRow, EventRow, OutputRow
from server.store.releases import add_release
from server.store.sessions import create_session, locked_session
from server.store.standing import set_policy
from server.store.webhooks import DeliveryRow, add_webhook

CELL = {"cell": {"pose_convention": "ur"}}


def test_the_newest_events_are_kept_of_each_session(store: Store) -> None:
    with store.write() as db:
        long, short = (create_session(db, CELL, None).id for _ in range(2))
        for _ in range(30):
            record_event(db, locked_session(db, long), "capture", {})
    forget_old_events(store, kept=10)
    with store.read() as db:
        kept = db.scalars(select(EventRow.id).where(EventRow.session_id == long).order_by(EventRow.id)).all()
        assert kept == list(range(22, 32))
        assert db.scalar(select(func.count()).where(EventRow.session_id == short)) == 1
    with store.write() as db:
        record_event(db, locked_session(db, long), "capture", {})  # numbers go on


@pytest.mark.thorough
def test_files_that_nothing_refers_to_go_once_they_are_old(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    orphan, kept = store.blobs.put(b"orphan"), store.blobs.put(b"kept")
    with store.write() as db:
        session = create_session(db, CELL, None).id
        db.flush()
        db.add(OutputRow(session_id=session, name="clouds/x.ply", stage="merge", sha256=kept, size=4))
    remove_orphans(store, threading.Event())
    assert set(store.blobs.digests()) == {orphan, kept}  # young: an upload may be about to refer to it
    for module in (blob_folder, blob_bucket):
        monkeypatch.setattr(module, "YOUNG_S", -1.0)
    remove_orphans(store, threading.Event())
    assert set(store.blobs.digests()) == {kept}


def test_a_full_disk_and_an_answer_that_became_overdue_are_told_once(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    free = 10**12

    def disk(_: Path) -> SimpleNamespace:
        return SimpleNamespace(free=free, total=10**12)

    monkeypatch.setattr("shutil.disk_usage", disk)
    alarms = Alarms(store, tmp_path)
    with store.write() as db:
        add_webhook(db, "http://receiver.example", "", ["disk", "overdue"], None)
        session = create_session(db, {"cell": {**CELL["cell"], "id": "old"}}, None).id
        answer = {"cell": "old", "verdict": "pass", "solved": "2020-01-01T00:00:00.000Z", "inputs_sha256": {}}
        add_release(db, session, {**answer, "faults": [], "equipment": []}, "qa", "", [])

    def told() -> list[str]:
        with store.read() as db:
            return [f"{row.event} {row.payload['session']}" for row in db.scalars(select(DeliveryRow))]

    alarms.tell()
    assert told() == []
    with store.write() as db:
        set_policy(db, "old", Policy(interval_days=30))
    free = 10**8
    alarms.tell()
    alarms.tell()
    assert told() == [f"overdue {session}", "disk None"]


def test_a_server_begins_with_it_and_ends_in_the_middle(store: Store, tmp_path: Path) -> None:
    with store.write() as db:
        remember_answer(db, "POST /x", "key", "0", 201, {})
        db.flush()
        db.get_one(AnswerRow, ("POST /x", "key")).created = "2020-01-01T00:00:00.000Z"
    keeping = Housekeeping(store, tmp_path)
    keeping.start()
    keeping.stop()
    with store.read() as db:
        assert db.get(AnswerRow, ("POST /x", "key")) is None
