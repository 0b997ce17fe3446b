"""Many captures in one request: stored while they come, answered one by one, measured afterwards."""

import json
import time
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest

from calib_core.simulation import simulate
from server.captures.measuring_queue import to_wait
from server.jobs.measuring_processes import Measuring
from tests.server.live_server import assert_problem, make_session
from tests.server.test_captures import POSE, arc_csv


def one(capture: str, content: bytes, **fields: Any) -> bytes:
    record = {"id": capture, "step": "tcp", "kind": "profile", "pose": POSE, "files": [f"captures/{capture}.csv"]}
    return json.dumps({**record, "sizes": [len(content)], **fields}).encode() + b"\n" + content


def send(client: httpx.Client, session: str, body: bytes | Iterator[bytes], **headers: str) -> httpx.Response:
    return client.post(f"/sessions/{session}/captures/batch", content=body, headers=headers)


def wait_until_measured(client: httpx.Client, session: str) -> list[dict[str, Any]]:
    end_s = time.monotonic() + 300
    while time.monotonic() < end_s:
        items = client.get(f"/sessions/{session}/captures").json()["items"]
        if not any("not measured yet" in (item["measured"]["reason"] or "") for item in items):
            return items
        time.sleep(0.05)
    raise AssertionError("captures are not measured")


@pytest.mark.thorough
def test_a_batch_is_stored_answered_and_then_measured(client: httpx.Client) -> None:
    session = make_session(client)
    names = [f"p{number:03d}" for number in range(260)]  # more than a bunch
    contents = {name: b"# %s\n" % name.encode() + arc_csv() for name in names[:3]}
    contents |= {name: b"0,0\n1,1\n%d,2\n" % number for number, name in enumerate(names[3:])}
    body = b"".join(one(name, content) for name, content in contents.items())
    answer = send(client, session, (body[start : start + 1000] for start in range(0, len(body), 1000)))
    assert answer.status_code == 200, answer.text
    assert answer.json() == {"items": [{"id": name, "status": 201} for name in names], "stored": 260}
    for name in (names[0], names[-1]):
        file = client.get(f"/sessions/{session}/captures/{name}/files/captures/{name}.csv")
        assert file.content == contents[name]
    listed = wait_until_measured(client, session)
    assert [item["id"] for item in listed] == names[:200]
    assert [item["measured"]["verdict"] for item in listed[:4]] == ["pass", "pass", "pass", "fail"]
    assert listed[0]["measured"]["radius_mm"] == pytest.approx(15.0, abs=0.05)


def test_what_is_of_no_use_is_named_and_keeps_nothing_else_back(client: httpx.Client) -> None:
    session = make_session(client)
    content = arc_csv()
    body = (
        one("good", content)
        + one("bad-pose", content, pose=[1, 2])
        + one("good", b"other")
        + one("another-name", content, files=["captures/good.csv"])
        + one("other", b"1", files=["captures/good.csv"])
        + one("two", b"12", files=["a.csv", "b.csv"])
        + one("no-numbers", b"text")
    )
    answer = send(client, session, body).json()
    assert [item["status"] for item in answer["items"]] == [201, 422, 409, 201, 409, 422, 201]
    assert answer["stored"] == 3
    assert answer["items"][1]["id"] == "bad-pose"
    assert answer["items"][1]["problem"]["detail"].endswith(answer["items"][1]["problem"]["to_do"])
    measured = {item["id"]: item["measured"] for item in wait_until_measured(client, session)}
    assert {name: m["verdict"] for name, m in measured.items()} == {
        "good": "pass",
        "another-name": "pass",
        "no-numbers": "fail",
    }
    assert "no line with a number" in measured["no-numbers"]["reason"]


@pytest.mark.parametrize(
    ("tail", "word"),
    [
        (one("cut", b"12345")[:-3], "the end 3 bytes before"),
        (b'{"id": "no-sizes"}\n', "sizes"),
        (b"\xff\xfe\n", "JSON"),
        (b"[1]\n", "sizes"),
        (b"x" * 1_100_000, "a longer one"),
        (b'{"id": "much", "sizes": [999999999999]}\n', "at most"),
    ],
)
def test_a_broken_body_keeps_what_came_before(client: httpx.Client, tail: bytes, word: str) -> None:
    session = make_session(client)
    answer = send(client, session, one("whole", arc_csv()) + tail).json()
    assert [item["status"] // 100 for item in answer["items"]] == [2, 4]
    assert word in answer["items"][1]["problem"]["detail"]
    assert [c["id"] for c in client.get(f"/sessions/{session}").json()["captures"]] == ["whole"]


def test_a_repeated_batch_stores_nothing_twice(client: httpx.Client) -> None:
    session = make_session(client)
    body = one("a", arc_csv()) + b"\n \n" + one("b", arc_csv(seed=1))
    key = {"Idempotency-Key": "batch-1"}
    first = send(client, session, body, **key)
    again = send(client, session, body, **key)
    assert again.json() == first.json()
    assert again.headers["Idempotency-Replayed"] == "true"
    assert_problem(send(client, session, body + one("c", arc_csv()), **key), 409, "Idempotency-Key")
    without_key = send(client, session, body).json()
    assert [item["status"] for item in without_key["items"]] == [200, 200]
    assert client.get("/sessions", params={"limit": 1}).json()["items"][0]["capture_count"] == 2
    assert_problem(send(client, "none", body), 404, "none")


@pytest.mark.thorough
def test_a_restarted_server_goes_on_measuring(start: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> Any:
        raise OSError("no processes today")

    with start() as client:
        monkeypatch.setattr(Measuring, "measure", refuse)
        session = make_session(client)
        assert send(client, session, one("a", arc_csv())).json()["stored"] == 1
        assert "not measured yet" in client.get(f"/sessions/{session}/captures/a").json()["measured"]["reason"]
    monkeypatch.undo()
    with start() as client:
        assert wait_until_measured(client, session)[0]["measured"]["verdict"] == "pass"


def test_what_waits_is_told_by_its_own_name_and_kind_and_by_why_it_waits() -> None:
    captures = simulate("tcp-mixed", 1).session.captures
    told = [to_wait(capture) for capture in captures]
    assert [(one.capture, one.kind) for one in told] == [(capture.id, capture.kind) for capture in captures]
    assert {one.kind for one in told} == {"profile", "cloud", "center"}
    since = {why: to_wait(captures[0], why).findings[0].values["since"] for why in ("batch", "cell", "record")}
    assert since == {"batch": "batch", "cell": "cell", "record": "record"}
