"""Raw frames over REST: camera and plane of light as they were solved make points of them as they come in."""

import json
import time
from typing import Any

import httpx
import pytest

from tests.server.live_server import assert_problem, simulated_session, wait_for

LAST_BOARD, FIRST_BALL = "l08", "p01"


def take(client: httpx.Client, session: str, step: str, count: int = 1) -> list[dict[str, Any]]:
    path = f"/sessions/{session}/sources/simulated/capture"
    answers = [client.post(path, params={"step": step}) for _ in range(count)]
    assert {answer.status_code for answer in answers} == {201}, answers[-1].text
    return [answer.json()["measured"] for answer in answers]


def solve(client: httpx.Client, session: str, stage: str) -> dict[str, Any]:
    job = wait_for(client, client.post(f"/sessions/{session}/solve/{stage}").json()["id"])
    assert job["status"] == "done", job
    return client.get(f"/sessions/{session}/results/{stage}").json()


def measured(client: httpx.Client, session: str, capture: str) -> dict[str, Any]:
    return client.get(f"/sessions/{session}/captures/{capture}").json()["measured"]


def measured_anew(client: httpx.Client, session: str, capture: str, before: dict[str, Any]) -> dict[str, Any]:
    end_s = time.monotonic() + 300
    while (now := measured(client, session, capture)) == before:
        assert time.monotonic() < end_s, now
        time.sleep(0.05)
    return now


@pytest.mark.thorough
def test_frames_of_the_sphere_are_measured_with_the_plane_of_light_that_was_solved(client: httpx.Client) -> None:
    session = simulated_session(client, scenario="frames-tcp")
    (early,) = take(client, session, "tcp")
    assert early["verdict"] == "warn"
    assert "plane of light are not known yet" in early["reason"]
    assert early["image_size"] == [640, 480]
    assert len(early["preview"]) > 100  # the stripe in pixels
    assert "center_mm" not in early or early["center_mm"] is None

    boards = [*take(client, session, "camera", 10), *take(client, session, "laser-plane", 8)]
    assert {seen["verdict"] for seen in boards} == {"pass"}
    plane = solve(client, session, "laser-plane")
    first = measured_anew(client, session, FIRST_BALL, early)
    assert first["verdict"] == "pass"
    assert first["point_sigma_mm"] < 0.1
    (second,) = take(client, session, "tcp")
    assert second["verdict"] == "pass"
    assert 0 < second["radius_mm"] < 30

    # A board less: what is measured from now on says that its plane of light is not up to date.
    client.patch(f"/sessions/{session}/captures/{LAST_BOARD}", json={"excluded": True})
    (third,) = take(client, session, "tcp")
    assert third["verdict"] == "warn"
    assert "before its captures changed" in third["reason"]
    again = solve(client, session, "laser-plane")
    assert again["plane_in_camera"] != plane["plane_in_camera"]
    fresh = measured_anew(client, session, "p03", third)
    assert fresh["verdict"] == "pass"
    assert fresh["center_mm"] != third["center_mm"]


def test_a_frame_that_is_none_is_refused_before_anything_is_solved(client: httpx.Client) -> None:
    session = simulated_session(client, scenario="frames-tcp")
    record = {"id": "x", "step": "tcp", "kind": "frame", "files": ["x.png"], "pose": [0, 0, 0, 1, 0, 0, 0]}
    answer = client.post(
        f"/sessions/{session}/captures",
        data={"record": json.dumps(record)},
        files=[("files", ("x.png", b"no image"))],
    )
    problem = assert_problem(answer, 422, "an image in PNG")
    assert "x.png" in str(problem)
