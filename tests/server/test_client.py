"""Our own client: as current as the API, good for a whole calibration, and patient where a network is not."""

import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from calib_core.simulation import simulate
from scancell_client import ProblemError, Scancell
from scancell_client.models import TcpResult
from server.commands.schema.records import schema_text
from tests.server.live_server import make_session, simulated_session, upload
from tests.server.test_batches import one
from tests.server.test_captures import arc_csv, record

CLIENT = Path(__file__).resolve().parents[2] / "scancell_client"


@pytest.fixture
def api(client: httpx.Client) -> Iterator[Scancell]:
    with Scancell(str(client.base_url).removesuffix("/api/v1/"), trust_env=False) as api:
        yield api


@pytest.mark.parametrize(("schema", "file"), [("client", "operations.py"), ("models", "models.py")])
def test_the_client_is_current(schema: str, file: str) -> None:
    to_do = f"scancell schema python-{schema} > scancell_client/{file}"
    assert (CLIENT / file).read_text(encoding="utf-8") == schema_text(f"python-{schema}"), to_do


@pytest.mark.thorough
def test_the_client_calibrates(api: Scancell) -> None:
    cell = simulate("tcp", 7)
    session_record = cell.session.to_json()
    captures = session_record.pop("captures")
    session_record["cell"]["id"] = "cell-of-the-client"
    session = api.sessions_create(session_record)["id"]
    for capture in captures:
        files = {name: cell.files[name] for name in capture["files"]}
        assert api.captures_add(session, capture, files)["measured"]["verdict"] != "fail"
    name = captures[0]["files"][0]
    assert api.captures_get_file(session, captures[0]["id"], name) == cell.files[name]
    assert len(api.captures_list_all(session, limit=5)["items"]) == 5
    result = api.solve(session, "tcp")["tcp"]
    assert isinstance(result, TcpResult)
    assert result.verdict == "pass"
    assert api.answer(session).faults == []
    archive = api.archives_get_archive(session, scene=False)
    assert api.archives_verify_archive(archive)["captures"] == len(captures)
    assert api.captures_change(session, "p01", {"excluded": True}, if_match="*")["excluded"] is True
    assert api.answer(session).faults == ["stale"]
    with pytest.raises(ProblemError, match="none") as refused:
        api.sessions_get("none")
    assert refused.value.status == 404
    assert api.sessions_delete(session) is None


@pytest.mark.thorough
def test_lists_are_whole_however_many_pages_they_take(api: Scancell, client: httpx.Client) -> None:
    session = make_session(client)
    names = [f"p{number:03d}" for number in range(230)]
    api.captures_add_batch(session, b"".join(one(name, b"0,0\n1,1\n2,%d\n" % k) for k, name in enumerate(names)))
    assert [item["id"] for item in api.captures_list_all(session)["items"]] == names
    page = api.captures_list_all(session, limit=100)
    assert len(page["items"]) == 100
    assert len(api.captures_list_all(session, cursor=page["next"])["items"]) == 130


def test_a_job_that_fails_says_why(api: Scancell, client: httpx.Client) -> None:
    with pytest.raises(ProblemError) as failed:
        api.solve(simulated_session(client, captures=2), "tcp")
    assert failed.value.status == 422
    assert failed.value.details["to_do"]


def test_changes_of_others_are_kept(api: Scancell, client: httpx.Client) -> None:
    session = make_session(client)
    upload(client, session, record(), arc_csv())
    calls = 0

    def change(now: Any) -> dict[str, Any]:
        nonlocal calls
        calls += 1
        if calls == 1:  # somebody else is faster
            client.patch(f"/sessions/{session}/captures/p01", json={"mount": "low"})
        return {"mount": f"{now.get('mount', '')} and more"}

    assert api.change_capture(session, "p01", change)["mount"] == "low and more"
    assert calls == 2


def test_what_was_read_comes_once(api: Scancell, client: httpx.Client) -> None:
    session = make_session(client)
    statuses: list[int] = []
    api._client.event_hooks["response"] = [lambda answer: statuses.append(answer.status_code)]
    first = api.sessions_get(session)
    again = api.sessions_get(session)
    assert first == again
    again["name"] = "mine"  # what a caller does with it is his
    assert api.sessions_get(session) == first
    client.patch(f"/sessions/{session}", json={"name": "other"})
    assert api.sessions_get(session)["name"] == "other"
    assert statuses == [200, 304, 304, 200]


def test_events_go_on_after_the_one_that_came_last(api: Scancell, client: httpx.Client) -> None:
    session = make_session(client)
    upload(client, session, record(), arc_csv())
    events = api.events(session, after=0)
    assert [next(events).kind for _ in range(2)] == ["session", "capture"]
    client.delete(f"/sessions/{session}")
    assert [(event.kind, event.data["action"]) for event in events] == [("session", "removed")]


@pytest.mark.thorough
def test_a_post_whose_answer_got_lost_is_done_once(client: httpx.Client, start: Callable[..., Any]) -> None:
    with (
        dropping_first_answers(client.base_url.port or 0, 2) as address,
        Scancell(address, trust_env=False) as api,
    ):
        name = f"once {address}"
        made = api.sessions_create({"name": name, "cell": {"pose_convention": "abb"}})
        found = client.get("/sessions", params={"search": name}).json()["items"]
        assert [one["id"] for one in found] == [made["id"]]


class dropping_first_answers:  # noqa: N801 (a context manager)
    """A way to a server on which the first answers are lost after the server has given them."""

    def __init__(self, port: int, lost: int) -> None:
        self._port, self._lost = port, lost

    def __enter__(self) -> str:
        self._listening = socket.create_server(("127.0.0.1", 0))
        threading.Thread(target=self._serve, daemon=True).start()
        return f"http://127.0.0.1:{self._listening.getsockname()[1]}"

    def __exit__(self, *_: object) -> None:
        self._listening.close()

    def _serve(self) -> None:
        while True:
            try:
                near, _ = self._listening.accept()
            except OSError:
                return
            with near, socket.create_connection(("127.0.0.1", self._port)) as far:
                head = near.recv(65536)
                while not head.endswith(b"}"):  # the body may come in a piece of its own
                    head += near.recv(65536)
                # Names of another port are foreign to nobody on this machine; the connection is used once.
                far.sendall(head.replace(b"Connection: keep-alive", b"Connection: close"))
                answer = b"".join(iter(lambda far=far: far.recv(65536), b""))
                if self._lost:
                    self._lost -= 1
                else:
                    near.sendall(answer)
