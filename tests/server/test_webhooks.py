"""Webhooks: signed, in order, repeated until they are taken, listed with what became of them."""

import hmac
import json
import threading
import time
from base64 import b64decode, b64encode
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import update

from calib_core.moment import now
from server.settings import Settings
from server.store.database import Store
from server.store.webhooks import DeliveryRow, due_deliveries, note_attempt
from tests.server.live_server import assert_problem, make_session, simulated_session, upload, wait_for
from tests.server.test_programs import RECORD, arc_csv

WORK_S = 30.0


@dataclass
class Receiver:
    """A server that takes what webhooks send; `answers` are given in turn, then 204."""

    address: str
    answers: list[int] = field(default_factory=list)
    came: list[tuple[dict[str, str], bytes]] = field(default_factory=list)
    arrived: threading.Condition = field(default_factory=threading.Condition)

    def wait_for(self, count: int) -> list[dict[str, Any]]:
        with self.arrived:
            assert self.arrived.wait_for(lambda: len(self.came) >= count, WORK_S), self.came
            return [json.loads(body) for _, body in self.came]


@contextmanager
def receiving(*answers: int) -> Generator[Receiver]:
    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            with receiver.arrived:
                receiver.came.append(({name.lower(): value for name, value in self.headers.items()}, body))
                self.send_response(receiver.answers.pop(0) if receiver.answers else 204)
                receiver.arrived.notify_all()
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_: Any, **__: Any) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        receiver = Receiver(f"http://127.0.0.1:{server.server_port}/hook", list(answers))
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield receiver
        finally:
            server.shutdown()
            thread.join()


def make_webhook(client: httpx.Client, receiver: Receiver, **more: Any) -> dict[str, Any]:
    made = client.post("/webhooks", json={"url": receiver.address, **more})
    assert made.status_code == 201, made.text
    return made.json()


def deliveries(client: httpx.Client, webhook: str, **query: Any) -> list[dict[str, Any]]:
    return client.get(f"/webhooks/{webhook}/deliveries", params=query).json()["items"]


def assert_signed(secret: str, headers: dict[str, str], body: bytes) -> None:
    """Check a signature as the Standard Webhooks specification has it, by other means than the program's."""
    signed = f"{headers['webhook-id']}.{headers['webhook-timestamp']}.".encode() + body
    digest = hmac.new(b64decode(secret.removeprefix("whsec_")), signed, "sha256").digest()
    assert headers["webhook-signature"] == f"v1,{b64encode(digest).decode()}"
    assert abs(int(headers["webhook-timestamp"]) - time.time()) < 60
    assert headers["webhook-id"] == json.loads(body)["id"]


def test_captures_results_and_verdicts_are_told_in_their_order_and_signed(client: httpx.Client) -> None:
    with receiving() as receiver:
        webhook = make_webhook(client, receiver, events=["capture", "result", "verdict"], name="cell 4's PLC")
        try:
            session = simulated_session(client, captures=14)
            job = client.post(f"/sessions/{session}/solve/tcp").json()["id"]
            assert wait_for(client, job)["status"] == "done"
            came = [message for message in receiver.wait_for(16) if message["session"] == session]
            assert [message["type"] for message in came] == ["capture"] * 14 + ["result", "verdict"]
            assert came[0]["data"] == {"action": "added", "capture": "p01"}
            assert came[14]["data"] == {
                "stage": "tcp", "solved": client.get(f"/sessions/{session}/results/tcp").json()["solved"],
            }  # fmt: skip
            told = came[15]["data"]
            assert told | {"warnings": [], "findings": []} == {
                "stage": "tcp", "verdict": "pass", "before": None, "warnings": [], "findings": [],
            }  # fmt: skip
            assert {one["severity"] for one in told["findings"]} == {"note"}
            for headers, body in receiver.came:
                assert_signed(webhook["secret"], headers, body)
            # The same verdict again is a result, but nothing new.
            wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"])
            assert receiver.wait_for(17)[16]["type"] == "result"
            page = client.get(f"/webhooks/{webhook['id']}/deliveries", params={"limit": 3}).json()
            assert page["next"]
            assert page["items"][0]["event"] == "result"
        finally:
            assert client.delete(f"/webhooks/{webhook['id']}").status_code == 204
        assert_problem(client.get(f"/webhooks/{webhook['id']}"), 404)


def test_webhooks_are_listed_without_their_secret_and_made_once(client: httpx.Client) -> None:
    with receiving() as receiver:
        key = {"Idempotency-Key": f"webhook {receiver.address}"}
        made = client.post("/webhooks", json={"url": receiver.address}, headers=key)
        again = client.post("/webhooks", json={"url": receiver.address}, headers=key)
        assert made.json() == again.json()
        assert again.headers["Idempotency-Replayed"] == "true"
        webhook = made.json()
        assert made.headers["Location"].endswith(webhook["id"])
        listed = [one for one in client.get("/webhooks").json()["items"] if one["url"] == receiver.address]
        assert listed == [{name: value for name, value in webhook.items() if name != "secret"}]
        assert client.get(f"/webhooks/{webhook['id']}").json() == listed[0]
        sent = client.post(f"/webhooks/{webhook['id']}/ping").json()["id"]
        assert [(message["type"], message["id"]) for message in receiver.wait_for(1)] == [("ping", sent)]
        client.delete(f"/webhooks/{webhook['id']}")


def test_a_webhook_of_one_cell_hears_of_no_other(client: httpx.Client) -> None:
    with receiving() as receiver:
        webhook = make_webhook(client, receiver, events=["capture"], cell="press-7")
        other = make_session(client, name="press 8")
        own = make_session(client, name="Press 7")
        for session in (other, own):
            upload(client, session, RECORD, arc_csv())
        assert [message["session"] for message in receiver.wait_for(1)] == [own]
        assert [one["payload"]["session"] for one in deliveries(client, webhook["id"])] == [own]
        client.delete(f"/webhooks/{webhook['id']}")


@pytest.mark.thorough
def test_what_is_not_taken_is_sent_again_also_by_the_next_server(
    start: Callable[..., Any], tmp_path: Path
) -> None:
    with receiving(500) as receiver:
        with start(webhooks_to_this_machine=True) as client:
            webhook = make_webhook(client, receiver, events=["capture"])
            session = make_session(client)
            upload(client, session, RECORD, arc_csv())
            receiver.wait_for(1)
            waiting = until(lambda: deliveries(client, webhook["id"]), lambda found: found[0]["attempts"] == 1)
            assert (waiting[0]["status"], waiting[0]["answered"]) == ("waiting", 500)
            assert waiting[0]["due"] > waiting[0]["created"]
        make_due(tmp_path / "data")
        with start(webhooks_to_this_machine=True) as client:
            first, second = receiver.wait_for(2)
            assert first == second  # the same message, so that who sees it twice can leave one out
            done = until(
                lambda: deliveries(client, webhook["id"]), lambda found: found[0]["status"] == "delivered"
            )
            assert (done[0]["attempts"], done[0]["answered"], done[0]["due"]) == (2, 204, None)


def test_a_receiver_that_is_gone_ends_its_webhook(client: httpx.Client) -> None:
    with receiving(410) as receiver:
        webhook = make_webhook(client, receiver, events=["session"])
        make_session(client)
        ended = until(lambda: client.get(f"/webhooks/{webhook['id']}").json(), lambda found: found["disabled"])
        assert ended["disabled"]
        make_session(client)
        assert len(deliveries(client, webhook["id"])) == 1
        client.delete(f"/webhooks/{webhook['id']}")


def test_a_receiver_that_never_answers_is_given_up_after_days_and_keeps_no_other_waiting(store: Store) -> None:
    from server.store.webhooks import add_webhook, send

    with store.write() as db:
        dead, alive = (add_webhook(db, f"http://{name}/", "", ["result"], None) for name in ("dead", "alive"))
        db.flush()
        for webhook in (dead, alive):
            for number in range(2):
                send(db, webhook.id, "result", "s", {"number": number})
        names = {dead.id: "dead", alive.id: "alive"}
    attempts = 0
    while attempts < 30:
        with store.write() as db:
            due = due_deliveries(db)
            for delivery in due:
                good = names[delivery.webhook_id] == "alive"
                note_attempt(db, delivery, 200 if good else None, None if good else "no answer")
            db.execute(update(DeliveryRow).where(DeliveryRow.status == "waiting").values(due=now()))
        if not due:
            break
        attempts += 1
    with store.read() as db:
        found = {(names[row.webhook_id], row.status, row.attempts) for row in db.query(DeliveryRow)}
    assert ("alive", "delivered", 1) in found
    assert {one for one in found if one[0] == "dead"} == {("dead", "failed", 10)}


@pytest.mark.parametrize(
    "url", ["plc", "ftp://plc/", "file:///etc/passwd", "http://", "http://u:p@plc/", "http://a b/", "http://[::1"]
)
def test_what_is_no_address_of_a_receiver_is_refused(client: httpx.Client, url: str) -> None:
    assert_problem(client.post("/webhooks", json={"url": url}), 422, "url")


def test_unknown_events_and_fields_are_told(client: httpx.Client) -> None:
    good = {"url": "http://127.0.0.1:9/"}
    assert_problem(client.post("/webhooks", json={**good, "event": ["result"]}), 422, "'event'", "events")
    assert_problem(client.post("/webhooks", json={**good, "events": ["results"]}), 422, "events")


def until(ask: Callable[[], Any], good: Callable[[Any], Any]) -> Any:
    end_s = time.monotonic() + WORK_S
    while not good(found := ask()):
        assert time.monotonic() < end_s, found
        time.sleep(0.05)
    return found


def make_due(data: Path) -> None:
    store = Store(Settings(data=data), lambda _: None)
    with store.write() as db:
        db.execute(update(DeliveryRow).values(due=now()))
    store.close()
