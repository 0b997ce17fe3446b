"""What was seen in a capture as it came in is what its solve, its scene and its answer take."""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from calib_core.captures.observation_bytes import to_bytes
from calib_core.errors import MeasurementError
from tests.server.live_server import simulated_session, wait_for


@pytest.mark.thorough
def test_a_solve_takes_what_was_seen_as_the_captures_came_in(start: Callable[..., Any], tmp_path: Path) -> None:
    with start() as client:
        session = simulated_session(client, captures=14)
        with closing(sqlite3.connect(tmp_path / "data" / "observations" / "observations.sqlite")) as file:
            nothing = to_bytes(MeasurementError("the sphere", "what was kept", "Look again."))
            changed = file.execute("UPDATE kept SET value = ? WHERE instr(value, ?)", (nothing, b'"Seen"'))
            assert changed.rowcount == 14
            file.commit()
        job = client.post(f"/sessions/{session}/solve/tcp").json()["id"]
        done = wait_for(client, job)
        assert done["status"] == "failed"
        assert "what was kept" in str(done["error"])
