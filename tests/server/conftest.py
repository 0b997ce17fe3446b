"""Servers for the tests: one that they share, and ones that a test starts and restarts itself."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.settings import Settings
from tests.server.live_server import serving, simulated_session, wait_for
from tests.server.stores import new_place, published, settings, store  # noqa: F401 (fixtures)


@pytest.fixture(scope="session")
def shared_client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    shared = Settings(
        data=tmp_path_factory.mktemp("data"),
        port=0,
        warm_up=False,
        max_json_bytes=200_000,
        max_upload_bytes=2_000_000,
        webhooks_to_this_machine=True,
    )
    with serving(shared) as client:
        yield client


@pytest.fixture
def client(shared_client: httpx.Client) -> httpx.Client:
    """A client of a server that all tests share; each makes its own sessions."""
    return shared_client


@pytest.fixture(scope="session")
def solved(shared_client: httpx.Client) -> str:
    """A solved session of the simulated cell; who changes it changes it back."""
    session = simulated_session(shared_client, captures=14)
    shared_client.patch(f"/sessions/{session}", json={"cell": {"id": "solved-cell"}})
    job = shared_client.post(f"/sessions/{session}/solve/tcp").json()["id"]
    assert wait_for(shared_client, job)["status"] == "done"
    return session


@pytest.fixture
def start(tmp_path: Path) -> Callable[..., Any]:
    """Start a server of the test's own, on the same data folder each time: `with start() as client`."""

    def begin(**changes: Any) -> Any:
        return serving(Settings(**{"data": tmp_path / "data", "port": 0, "warm_up": False, **changes}))

    return begin
