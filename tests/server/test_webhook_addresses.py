"""Which addresses webhooks reach: never clouds' own, this server or, where a login is required, this machine."""

from pathlib import Path

import httpx
import pytest

from server.settings import Settings
from server.webhooks.addresses import CheckedTransport
from server.webhooks.signing import signed_headers
from tests.server.live_server import assert_problem, serving
from tests.server.test_webhooks import receiving


def post(settings: Settings, url: str) -> httpx.Response:
    with httpx.Client(transport=CheckedTransport(settings, httpx.HTTPTransport(trust_env=False))) as client:
        return client.post(url, json={})


@pytest.mark.parametrize(
    "url",
    [
        "http://169.254.169.254/latest/meta-data",
        "http://[fe80::1]/",
        "http://0.0.0.0:9/",
        "http://224.0.0.1/",
        "http://[::ffff:169.254.169.254]/",
        "http://[64:ff9b::a9fe:a9fe]/",
        "http://[2002:a9fe:a9fe::]/",
        "http://[::169.254.169.254]/",
        "http://[fd00:ec2::254]/",
        "http://168.63.129.16/",
        "http://192.0.0.192/",
        "http://2852039166/",
    ],
)
def test_addresses_of_no_receiver_are_refused(tmp_path: Path, url: str) -> None:
    with pytest.raises(httpx.ConnectError, match="no receiver's address"):
        post(Settings(data=tmp_path), url)


@pytest.mark.parametrize(
    "host", ["127.0.0.1", "localhost", "127.1.2.3", "[::1]", "[64:ff9b::7f00:1]", "0x7f000001"]
)
def test_this_server_is_refused_by_every_name_of_this_machine(tmp_path: Path, host: str) -> None:
    with pytest.raises(httpx.ConnectError, match="this server itself"):
        post(Settings(data=tmp_path, port=8123), f"http://{host}:8123/api/v1/sessions")


def test_this_machine_is_reached_where_it_is_allowed_alone(tmp_path: Path) -> None:
    with receiving() as receiver:
        with pytest.raises(httpx.ConnectError, match="SCANCELL_WEBHOOKS_TO_THIS_MACHINE"):
            post(Settings(data=tmp_path), receiver.address)
        allowed = Settings(data=tmp_path, webhooks_to_this_machine=True)
        assert post(allowed, receiver.address.replace("127.0.0.1", "localhost")).status_code == 204
    assert [headers["host"].partition(":")[0] for headers, _ in receiver.came] == ["localhost"]


def test_a_webhook_that_a_proxy_sends_back_does_nothing(tmp_path: Path) -> None:
    """Nobody needs a login on this machine: what a proxy sends on would be trusted like a program."""
    body = b'{"cell": {"pose_convention": "kuka"}}'
    headers = {
        "Content-Type": "application/json",
        **signed_headers("whsec_" + "A" * 44, "m-1", 1_800_000_000, body),
    }
    with serving(Settings(data=tmp_path, port=0, warm_up=False)) as client:
        assert_problem(client.post("/sessions", content=body, headers=headers), 403, "a webhook's delivery")
        assert client.get("/sessions").json()["items"] == []
        del headers["webhook-signature"]
        client.post("/sessions", content=body, headers=headers).raise_for_status()
