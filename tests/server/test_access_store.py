"""Tokens, logins and the log on every store that there is."""

from datetime import timedelta
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import DatabaseError

from server.auth.logins import REMEMBERED_S, Logins
from server.http.errors import LoginError
from server.settings import Settings
from server.store.audit import Act, acting, list_audit
from server.store.backup import back_up, restore
from server.store.database import Store
from server.store.secrets import KEY_FILE
from server.store.sessions import create_session
from server.store.tokens import has_admin, list_tokens, revoke_token

CELL = {"cell": {"pose_convention": "ur"}}


def whole_log(store: Store) -> list[str]:
    with store.read() as db:
        return [item["path"] for item in list_audit(db, 100, None)["items"]]


def fail(store: Store) -> None:
    with store.write() as db:
        create_session(db, CELL, None)
        raise RuntimeError


@pytest.mark.thorough
def test_an_act_is_noted_once_with_what_it_does_or_not_at_all(store: Store) -> None:
    with store.write() as db:
        create_session(db, CELL, None)  # by the server itself: nobody's act
    assert whole_log(store) == []
    before = acting.set(Act("Ada", "admin", None, "192.0.2.1", "POST", "/x\x00\n\ud800" + "y" * 600))
    try:
        for _ in range(2):
            with store.write() as db:
                create_session(db, CELL, None)
        (path,) = whole_log(store)
        assert path.startswith("/x???yyy")
        assert len(path) == 500
        acting.set(Act("Ada", "admin", None, "192.0.2.1", "POST", "/fails"))
        with pytest.raises(RuntimeError):
            fail(store)
        assert whole_log(store) == [path]
    finally:
        acting.reset(before)


def test_the_database_itself_keeps_the_log(store: Store, settings: Settings) -> None:
    before = acting.set(Act("Ada", "admin", None, "192.0.2.1", "POST", "/x"))
    try:
        with store.write() as db:
            create_session(db, CELL, None)
    finally:
        acting.reset(before)
    changes = ["UPDATE audit SET who = 'x'", "DELETE FROM audit"]
    if "postgresql" in settings.sql_url:
        changes.append("TRUNCATE audit")
    for change in changes:
        with pytest.raises(DatabaseError, match="only grow"), store.write() as db:
            db.execute(text(change))
    assert whole_log(store) == ["/x"]


def test_tokens_and_logins_are_good_as_long_as_they_should_be(store: Store, settings: Settings) -> None:
    now_s = 100.0
    logins = Logins(settings.data, store, lambda: now_s)
    day, moment = timedelta(days=1), timedelta(microseconds=1)
    with store.write() as db:
        assert not has_admin(db)
        gone = logins.make_token(db, "gone", "admin", moment)[1]
        record, good = logins.make_token(db, "good", "capture", day)
        assert not has_admin(db)
        logins.make_token(db, "admin", "admin", None)
        assert has_admin(db)
        identity, cookie = logins.log_in(db, good, day)
        assert (identity.name, identity.by) == ("good", "cookie")
        short = logins.log_in(db, good, moment)[1]
        for wrong in (gone, good[:-1], good.upper(), "", "scancell_", good + "\n"):
            with pytest.raises(LoginError):
                logins.log_in(db, wrong, day)
        assert [row.name for row in list_tokens(db)].count("good") == 1
    for secret in (gone, short, cookie, "x" * 1000):
        assert logins.by_token(secret) is None
    assert logins.by_cookie(short) is None
    assert logins.by_cookie(good) is None
    found = logins.by_cookie(cookie)
    assert found is not None
    assert found == logins.remembered(cookie)
    assert logins.by_token(good) is not None
    with store.write() as db:
        revoke_token(db, record["id"])  # as another process does
    assert logins.remembered(cookie) == found
    now_s += REMEMBERED_S + 0.1
    assert logins.remembered(cookie) is None
    assert logins.by_cookie(cookie) is None
    assert logins.by_token(good) is None


def test_a_backup_brings_tokens_and_the_log_back(store: Store, settings: Settings, tmp_path: Path) -> None:
    before = acting.set(Act("Ada", "admin", None, "192.0.2.1", "POST", "/tokens"))
    try:
        with store.write() as db:
            token = Logins(settings.data, store).make_token(db, "robot", "capture", None)[1]
    finally:
        acting.reset(before)
    back_up(settings, tmp_path / "backup")
    again = Settings(data=tmp_path / "again")
    restore(tmp_path / "backup", again)
    restored = Store(again, lambda _: None)
    try:
        found = Logins(again.data, restored).by_token(token)
        assert found is not None
        assert found.name == "robot"
        assert whole_log(restored) == ["/tokens"]
        assert (again.data / KEY_FILE).stat().st_mode & 0o777 == 0o600
    finally:
        restored.close()


def test_another_key_opens_nothing(store: Store, settings: Settings) -> None:
    with store.write() as db:
        token = Logins(settings.data, store).make_token(db, "a", "read", None)[1]
    assert Logins(settings.data, store).by_token(token) is not None
    assert Logins(settings.data / "elsewhere", store).by_token(token) is None
