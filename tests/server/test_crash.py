"""A server that is killed: what it acknowledged is there, what it ran says so, nothing of it stays behind."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from kill_server import ServerProcess

from calib_core.errors import ConflictError, InputError
from server.serve import WorkbenchServer
from server.settings import Settings
from tests.server.live_server import make_session, simulated_session


def is_alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.thorough
def test_a_killed_server_has_lost_nothing_that_it_acknowledged(start: Callable[..., Any], tmp_path: Path) -> None:
    process = ServerProcess(tmp_path / "data", program=["tests.server.slow_server"], forked=True).wait()
    try:
        with process.client() as client:
            session = simulated_session(client)
            job = client.post(f"/sessions/{make_session(client)}/solve/tcp").json()["id"]
            while not (told := client.get(f"/jobs/{job}").json()["message"]).startswith("worker "):
                time.sleep(0.02)
            take = f"/sessions/{session}/sources/simulated/capture"
            acknowledged = [client.post(take).json() for _ in range(5)]
    finally:
        process.kill()

    worker = int(told.split()[1])
    end_s = time.monotonic() + 300
    while is_alive(worker) and time.monotonic() < end_s:
        time.sleep(0.05)
    assert not is_alive(worker), "the worker outlives its server"

    with start() as client:
        assert client.get(f"/sessions/{session}/captures").json()["items"] == acknowledged
        for capture in acknowledged:
            name = capture["files"][0]
            assert client.get(f"/sessions/{session}/captures/{capture['id']}/files/{name}").status_code == 200
        assert client.get(f"/jobs/{job}").json()["status"] == "failed"


def test_a_data_folder_is_one_servers_alone(start: Callable[..., Any], tmp_path: Path) -> None:
    with start(), pytest.raises(ConflictError, match="in use"):
        WorkbenchServer(Settings(data=tmp_path / "data", port=0)).run()
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(InputError, match="--data"):
        WorkbenchServer(Settings(data=file, port=0)).run()
