"""Server-sent events: in order, numbered, and going on where a connection broke."""

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import httpx

from tests.server.live_server import assert_problem, make_session, simulated_session

Event = dict[str, Any]


@contextmanager
def listening(client: httpx.Client, path: str, after: int | None = None) -> Iterator[Iterator[Event]]:
    headers = {} if after is None else {"Last-Event-ID": str(after)}
    with client.stream("GET", path, headers=headers) as answer:
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith("text/event-stream")
        yield _parsed(answer.iter_lines())


def _parsed(lines: Iterator[str]) -> Iterator[Event]:
    event: Event = {}
    for line in lines:
        name, _, value = line.partition(": ")
        if not line and event:
            yield event
            event = {}
        elif name in ("event", "id"):
            event[name] = value
        elif name == "data":
            event["data"] = json.loads(value)


def numbers(events: list[Event]) -> list[int]:
    return [int(event["id"]) for event in events]


def test_events_tell_what_happens_in_order(client: httpx.Client) -> None:
    session = simulated_session(client)
    with listening(client, f"/sessions/{session}/events") as events:
        assert next(events) == {"event": "session", "id": "1", "data": {"action": "added"}}
        client.post(f"/sessions/{session}/sources/simulated/capture")
        client.patch(f"/sessions/{session}/captures/p01", json={"excluded": True})
        client.patch(f"/sessions/{session}", json={"name": "other"})
        client.delete(f"/sessions/{session}/captures/p01")
        seen = [next(events) for _ in range(4)]
        assert [(event["event"], event["data"].get("action")) for event in seen] == [
            ("capture", "added"),
            ("capture", "changed"),
            ("session", "changed"),
            ("capture", "removed"),
        ]
        assert {event["data"].get("capture") for event in seen} == {"p01", None}
        assert numbers(seen) == [2, 3, 4, 5]


def test_a_broken_connection_goes_on_where_it_was(client: httpx.Client) -> None:
    session = make_session(client)
    for number in range(4):
        client.patch(f"/sessions/{session}", json={"name": str(number)})
    with listening(client, f"/sessions/{session}/events", after=2) as events:
        assert numbers([next(events) for _ in range(3)]) == [3, 4, 5]
    with listening(client, f"/sessions/{session}/events", after=999) as events:
        assert next(events)["id"] == "5"  # a number of another time begins with the newest
    assert_problem(client.get(f"/sessions/{session}/events", headers={"Last-Event-ID": "x"}), 422, "last-event-id")


def test_events_go_on_over_a_restart(start: Callable[..., Any]) -> None:
    with start() as client:
        session = make_session(client)
        client.patch(f"/sessions/{session}", json={"name": "before"})
    with start() as client:
        client.patch(f"/sessions/{session}", json={"name": "after"})
        with listening(client, f"/sessions/{session}/events", after=1) as events:
            assert numbers([next(events), next(events)]) == [2, 3]


def test_a_stream_ends_with_its_session(client: httpx.Client) -> None:
    session = make_session(client)
    with listening(client, f"/sessions/{session}/events") as events:
        next(events)
        client.delete(f"/sessions/{session}")
        assert [event["data"] for event in events] == [{"action": "removed"}]


def test_an_open_stream_does_not_hold_a_server_that_stops(start: Callable[..., Any]) -> None:
    ended = threading.Event()

    def watch(address: httpx.URL, path: str, begun: threading.Event) -> None:
        with httpx.Client(base_url=address, timeout=300, trust_env=False) as own, listening(own, path) as events:
            next(events)
            begun.set()
            assert list(events) == []
        ended.set()

    with start() as client:
        begun = threading.Event()
        path = f"/sessions/{make_session(client)}/events"
        thread = threading.Thread(target=watch, args=(client.base_url, path, begun))
        thread.start()
        assert begun.wait(300)
    thread.join(10)
    assert ended.is_set()
