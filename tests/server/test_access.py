"""Who may: every route for every role, logins, tokens, and the log of it all."""

import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from bench_safety import role_that_should_do, trials
from sqlalchemy import text
from sqlalchemy.exc import DatabaseError

from calib_core.errors import InputError
from server.auth.roles import RULES, needed_role
from server.cli import main
from server.serve import WorkbenchServer
from server.settings import Settings
from server.store.database import Store
from tests.server.access import bearer, every_route, guarded, log_in, site_of
from tests.server.live_server import assert_problem, make_session

BODY = {"cell": {"pose_convention": "ur"}}


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[httpx.Client, dict[str, str]]]:
    with guarded(tmp_path_factory.mktemp("guarded")) as found:
        yield found


@pytest.fixture
def client(served: tuple[httpx.Client, dict[str, str]]) -> httpx.Client:
    served[0].cookies.clear()
    return served[0]


@pytest.fixture
def tokens(served: tuple[httpx.Client, dict[str, str]]) -> dict[str, str]:
    return served[1]


def test_every_route_has_a_role_in_the_table_and_no_row_is_left_over() -> None:
    declared = [row for rows in RULES.values() for row in rows]
    assert len(set(declared)) == len(declared)
    assert sorted(declared) == sorted(f"{method} {template}" for method, template in every_route())


def test_the_table_says_what_people_are_told() -> None:
    for method, template in every_route():
        path = re.sub(r"\{[^}]*\}", "x", template)
        assert needed_role(method, path).word == role_that_should_do(method, template), (method, template)


def test_what_no_row_declares_is_the_admins() -> None:
    for method, path in (("GET", "/api/v1/new"), ("PUT", "/api/v1/sessions"), ("OPTIONS", "/"), ("WS", "/x")):
        assert needed_role(method, path).word == "admin"


@pytest.mark.thorough
def test_everything_is_refused_that_should_be_and_nothing_else() -> None:
    found = list(trials(every=False))  # every way at each route: `scancell bench safety`
    assert [trial for trial in found if trial.refused != trial.should] == []
    assert len(found) > 900


def test_refusals_say_what_to_do(client: httpx.Client, tokens: dict[str, str]) -> None:
    client.headers.pop("Authorization", None)
    assert_problem(client.get("/sessions"), 401, "/login")
    assert client.get("/sessions").headers["www-authenticate"] == "Bearer"
    assert_problem(client.get("/sessions", headers=bearer(tokens["revoked"])), 401, "revoked")
    assert_problem(
        client.post("/sessions", json=BODY, headers=bearer(tokens["read"])),
        403,
        "role capture",
        "one who may read",
    )
    # Refused before the body is looked at, or even read.
    assert_problem(client.post("/sessions", content=b"{", headers=bearer(tokens["read"])), 403)


def test_pages_lead_to_the_login_and_back(client: httpx.Client) -> None:
    site = site_of(client)
    for path in ("/", "/docs", "/sessions/abc"):
        answer = client.get(site + path)
        assert answer.status_code == 303
        assert answer.headers["location"] == "/login?next=" + path.replace("/", "%2F")
    assert client.get(site + "/login").status_code == 200
    assert client.get(site + "/scenes/abc/").status_code == 401


def test_a_login_is_a_cookie_that_no_script_reads_and_no_other_site_sends(
    client: httpx.Client, tokens: dict[str, str]
) -> None:
    answer = client.post("/login", json={"token": tokens["capture"]})
    assert answer.json() == {"name": "one who may capture", "role": "capture", "login": "cookie"}
    cookie = answer.headers["set-cookie"]
    for word in ("HttpOnly", "SameSite=strict", "Path=/", "Max-Age=43200"):
        assert word in cookie
    assert "Secure" not in cookie  # this server speaks http
    assert "Domain" not in cookie
    assert tokens["capture"] not in cookie
    assert client.get("/me").json()["role"] == "capture"
    own = {"Origin": site_of(client)}
    assert client.post("/sessions", json=BODY, headers=own).status_code == 201
    assert_problem(client.post("/sessions", json=BODY), 403, "without an Origin")
    kept = dict(client.cookies)
    assert client.post("/logout", headers=own).status_code == 204
    client.cookies.clear()
    client.cookies.update(kept)
    assert client.get("/me").json() == {"name": "nobody", "role": None, "login": "missing"}
    assert client.get("/sessions").status_code == 401


def test_wrong_tokens_do_not_log_in_and_soon_have_to_wait(tmp_path: Path) -> None:
    with guarded(tmp_path) as (client, tokens):
        for token in ("", "x", tokens["expired"], tokens["revoked"], tokens["admin"][:-1], "ä" * 65):
            assert_problem(client.post("/login", json={"token": token}), 401, "token")
        answers = [client.post("/login", json={"token": "x"}) for _ in range(6)]
        assert [answer.status_code for answer in answers] == [401, 401, 401, 401, 429, 429]
        assert_problem(answers[-1], 429, "in a row")
        assert 1 <= int(answers[-1].headers["retry-after"]) <= 5
        assert client.get("/sessions", headers=bearer(tokens["read"])).status_code == 200
        assert client.post("/login", json={"token": tokens["read"]}).status_code == 200


@pytest.mark.thorough
def test_tokens_are_shown_once_and_kept_as_hashes(tmp_path: Path) -> None:
    with guarded(tmp_path) as (client, tokens):
        admin = bearer(tokens["admin"])
        body = {"name": "robot", "role": "capture", "days": 1}
        made = client.post("/tokens", json=body, headers={**admin, "Idempotency-Key": "k"})
        assert made.status_code == 201
        token = made.json()["token"]
        again = client.post("/tokens", json=body, headers={**admin, "Idempotency-Key": "k"})
        assert again.json() == {**made.json(), "token": None}
        assert client.get("/me", headers=bearer(token)).json()["name"] == "robot"
        assert (
            client.get(made.headers["Location"].removeprefix("/api/v1"), headers=admin).json()["name"] == "robot"
        )
        listed = client.get("/tokens", headers=admin)
        assert token not in listed.text
        assert [item["name"] for item in listed.json()["items"]].count("robot") == 1
        cookie = log_in(client, token)["Cookie"].split("=", 1)[1]
        secrets = [token, cookie, *tokens.values()]
        for secret in secrets:
            for file in tmp_path.rglob("*"):
                assert not file.is_file() or secret.encode() not in file.read_bytes(), file
    assert (tmp_path / "login.key").stat().st_mode & 0o777 == 0o600
    (tmp_path / "login.key").unlink()  # without its key the database opens nothing
    with guarded(tmp_path) as (client, fresh):
        assert client.get("/me", headers=bearer(token)).status_code == 401
        assert client.get("/me", headers=bearer(fresh["read"])).status_code == 200


@pytest.mark.parametrize(
    "change",
    [{"name": " "}, {"name": "a\nb"}, {"name": "x" * 201}, {"role": "god"}, {"days": 0}, {"days": 1e9}, {"x": 1}],
)
def test_tokens_that_cannot_be_made(client: httpx.Client, tokens: dict[str, str], change: dict[str, Any]) -> None:
    body = {"name": "robot", "role": "capture", **change}
    assert_problem(client.post("/tokens", json=body, headers=bearer(tokens["admin"])), 422)


def test_a_revoked_token_ends_at_once_with_its_logins_and_streams(tmp_path: Path) -> None:
    with guarded(tmp_path) as (client, tokens):
        admin = bearer(tokens["admin"])
        made = client.post("/tokens", json={"name": "n", "role": "read"}, headers=admin).json()
        session = make_session_as(client, tokens["capture"])
        cookie = log_in(client, made["token"])
        with (
            client.stream(
                "GET", f"/sessions/{session}/events", headers=bearer(made["token"]), timeout=20
            ) as by_token,
            client.stream("GET", f"/sessions/{session}/events", headers=cookie, timeout=20) as by_cookie,
        ):
            assert by_token.status_code == by_cookie.status_code == 200
            assert client.delete(f"/tokens/{made['id']}", headers=admin).status_code == 204
            assert client.get("/sessions", headers=bearer(made["token"])).status_code == 401
            assert client.get("/sessions", headers=cookie).status_code == 401
            start_s = time.monotonic()
            for stream in (by_token, by_cookie):
                assert b"event: session" in b"".join(stream.iter_raw())
            assert time.monotonic() - start_s < 12
        assert client.delete(f"/tokens/{made['id']}", headers=admin).status_code == 204
        own = tokens["admin"].split("_")[1]
        assert_problem(client.delete(f"/tokens/{own}", headers=admin), 409, "another admin")
        assert_problem(client.delete("/tokens/none", headers=admin), 404, "listed")


def make_session_as(client: httpx.Client, token: str) -> str:
    answer = client.post("/sessions", json=BODY, headers=bearer(token))
    assert answer.status_code == 201
    return answer.json()["id"]


def test_a_reader_takes_the_answer_into_a_backup_and_changes_nothing(
    client: httpx.Client, tokens: dict[str, str]
) -> None:
    session = make_session_as(client, tokens["admin"])
    reader = bearer(tokens["read"])
    backup = {"backup": ("$config.dat", b"TOOL_DATA[1]={X 0,Y 0,Z 0,A 0,B 0,C 0}\n")}
    asked = client.post(f"/sessions/{session}/exports/kuka", files=backup, headers=reader)
    assert asked.status_code == 409, asked.text  # nothing is solved there; it is not for want of a role
    typed: Any = {"numbers": (None, "0 0 184 0 45 0")}
    assert client.post(f"/sessions/{session}/read-back", files=typed, headers=reader).status_code == 409
    refused = client.patch(f"/sessions/{session}", json={"name": "mine"}, headers=reader)
    assert refused.status_code == 403


@pytest.mark.thorough
def test_the_log_tells_who_did_what_and_only_grows(tmp_path: Path) -> None:
    with guarded(tmp_path) as (client, tokens):
        session = make_session_as(client, tokens["capture"])
        client.patch(f"/sessions/{session}", json={"name": "n"}, headers=bearer(tokens["admin"]))
        client.patch(f"/sessions/{session}", json={"name": 1}, headers=bearer(tokens["admin"]))  # does nothing
        client.delete(f"/sessions/{session}", headers=bearer(tokens["capture"]))  # may not
        log_in(client, tokens["read"])
        client.post("/login", json={"token": "wrong"})
        pages = [client.get("/audit", params={"limit": 2}, headers=bearer(tokens["admin"])).json()]
        while pages[-1]["next"]:
            query = {"limit": 2, "cursor": pages[-1]["next"]}
            pages.append(client.get("/audit", params=query, headers=bearer(tokens["admin"])).json())
        rows = [row for page in pages for row in page["items"]]
        of_session = f"/api/v1/sessions/{session}"
        assert [tuple(row[n] for n in ("who", "method", "path", "outcome")) for row in rows] == [
            ("nobody", "POST", "/api/v1/login", "refused"),
            ("one who may read", "POST", "/api/v1/login", "done"),
            ("one who may capture", "DELETE", of_session, "refused"),
            ("one who may admin", "PATCH", of_session, "done"),
            ("one who may capture", "POST", "/api/v1/sessions", "done"),
        ]
        assert {row["address"] for row in rows} == {"127.0.0.1"}
    store = Store(Settings(data=tmp_path), lambda _: None)
    for change in ("UPDATE audit SET who = 'x'", "DELETE FROM audit"):
        with pytest.raises(DatabaseError, match="only grow"), store.write() as db:
            db.execute(text(change))
    store.close()


def test_on_loopback_nobody_needs_a_login_and_a_token_still_counts(start: Any, tmp_path: Path) -> None:
    with start() as client:
        assert client.get("/me").json() == {"name": "this machine", "role": "admin", "login": "not-needed"}
        token = client.post("/tokens", json={"name": "n", "role": "read"}).json()["token"]
        assert client.get("/me", headers=bearer(token)).json()["role"] == "read"
        assert_problem(client.post("/sessions", json=BODY, headers=bearer(token)), 403, "capture")
        assert_problem(client.get("/sessions", headers=bearer("wrong")), 401)
        session = make_session(client)
        rows = client.get("/audit").json()["items"]
        assert rows[0]["path"] == "/api/v1/sessions"
        assert rows[0]["who"] == "this machine"
        assert rows[0]["address"] == "127.0.0.1"
        assert client.delete(f"/sessions/{session}").status_code == 204


@pytest.mark.parametrize("changes", [{"host": "0.0.0.0"}, {"require_login": True}])
def test_without_an_admin_there_is_no_serving_where_a_login_is_needed(
    tmp_path: Path, changes: dict[str, Any]
) -> None:
    with pytest.raises(InputError, match="scancell token create --role admin"):
        WorkbenchServer(Settings(data=tmp_path, port=0, warm_up=False, **changes)).run()


@pytest.mark.thorough
def test_the_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = ["--data", str(tmp_path)]
    assert main(["token", "create", "--role", "admin", "--name", "Ada", *data]) == 0
    token, words = capsys.readouterr()
    assert re.fullmatch(r"scancell_[0-9a-f]{12}_[\w-]{43}\n", token)
    assert "not shown again" in words
    assert main(["token", "create", "--role", "read", "--name", "Bob", "--days", "2", *data]) == 0
    capsys.readouterr()
    assert main(["token", "list", *data]) == 0
    listed = capsys.readouterr().out
    assert "Ada" in listed
    assert "until 20" in listed
    assert token.strip() not in listed
    token_id = token.split("_")[1]
    assert main(["token", "revoke", token_id, *data]) == 0
    assert main(["token", "list", *data]) == 0
    assert re.search(rf"{token_id}  admin    revoked .* Ada", capsys.readouterr().out)
    assert main(["audit", *data]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("scancell token ")[1] for line in lines] == [
        f"revoke {token_id}",
        "create read",
        "create admin",
    ]
    for wrong in (
        ["token", "revoke", "none"],
        ["token", "create", "--role", "read", "--name", ""],
        ["audit", "--limit", "0"],
    ):
        assert main([*wrong, *data]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_too_many_requests_wait(tmp_path: Path) -> None:
    with guarded(tmp_path, rate_per_s=0.02, rate_burst=2) as (client, tokens):  # ten times of it on this machine
        statuses = [client.get("/health").status_code for _ in range(25)]
        assert statuses[:20] == [200] * 20
        answer = client.get("/health")
        assert_problem(answer, 429, "Send the next request in")
        assert 1 <= int(answer.headers["retry-after"]) <= 5
        # A token has a bucket of its own.
        assert client.get("/me", headers=bearer(tokens["read"])).status_code == 200


@pytest.mark.thorough
def test_the_description_says_how_to_log_in_and_what_each_operation_takes(
    client: httpx.Client, tokens: dict[str, str]
) -> None:
    described = client.get(site_of(client) + "/openapi.json", headers=bearer(tokens["read"])).json()
    assert described["components"]["securitySchemes"]["token"]["scheme"] == "bearer"
    for path, operations in described["paths"].items():
        for method, operation in operations.items():
            role = role_that_should_do(method.upper(), path)
            assert operation["x-role"] == role, path
            assert [next(iter(way)) for way in operation["security"]] == (
                [] if role == "nobody" else ["token", "login"]
            )
