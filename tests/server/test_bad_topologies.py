"""Cells whose edges contradict themselves, over REST: one sentence, and everything that was told stays."""

import json
from typing import Any

import httpx
import pytest

from tests.server.live_server import assert_problem

TILT, TURN = {"name": "tilt", "kind": "rotary"}, {"name": "turn", "kind": "rotary"}
SLIDE = {"name": "slide", "kind": "linear"}
POSE = [900.0, 10.0, 700.0, 170.0, 5.0, 30.0]
BALLS = [{"name": "a"}, {"name": "b"}]


def capture(number: int, **told: Any) -> dict[str, Any]:
    pose = [*POSE[:5], POSE[5] + number]
    return {
        "id": f"p{number}",
        "step": "tcp",
        "kind": "center",
        "center_mm": [0.0, 0.0, 200.0],
        "pose": pose,
        **told,
    }


def stored(client: httpx.Client, session: str, record: dict[str, Any]) -> bool:
    told = {"record": (None, json.dumps(record), "application/json")}
    return client.post(f"{session}/captures", files=told).status_code == 201


def test_a_cell_that_contradicts_itself_is_refused_and_the_old_one_stays(client: httpx.Client) -> None:
    plain = {"pose_convention": "kuka", "sphere_diameter_mm": 40.0}
    session = f"/sessions/{client.post('/sessions', json={'name': 'edges', 'cell': plain}).json()['id']}"
    for cell, sentence in (
        ({"axes": [{**TILT, "on": "turn"}, {**TURN, "on": "tilt"}]}, "a loop: 'tilt' on 'turn' on 'tilt'"),
        ({"axes": [{**TILT, "on": "tlit"}]}, "got 'tlit'"),
        ({"spheres": [BALLS[0], BALLS[0]]}, "'a' twice"),
        ({"spheres": BALLS, "sphere_distances": [{"between": ["a", "b"], "mm": 5.0}]}, "can be told apart"),
    ):
        assert_problem(client.post("/sessions", json={"cell": {**plain, **cell}}), 422, sentence)
        headers = {"If-Match": client.get(session).headers["etag"]}
        assert_problem(client.patch(session, json={"cell": cell}, headers=headers), 422, sentence)
        assert client.get(session).json()["cell"] == plain


@pytest.mark.parametrize(
    ("axis", "readings", "sentence"),
    [(TILT, {}, "none in any capture"), (SLIDE, {"axes_mm": {"slide": 0.5}}, "looks like metres")],
)
def test_readings_that_do_not_fit_the_axes_are_told_and_kept(
    client: httpx.Client, axis: dict[str, Any], readings: dict[str, Any], sentence: str
) -> None:
    cell = {"pose_convention": "kuka", "sphere_diameter_mm": 40.0, "axes": [axis]}
    session = f"/sessions/{client.post('/sessions', json={'name': 'axes', 'cell': cell}).json()['id']}"
    for number in range(2):
        own = {field: {name: number * value for name, value in read.items()} for field, read in readings.items()}
        assert stored(client, session, capture(number, **own))
    assert sentence in client.get(f"{session}/check").text
    assert sentence in client.post(f"{session}/solve/tcp?wait=60").text
    kept = client.get(session).json()
    assert (kept["cell"], len(kept["captures"])) == (cell, 2)


def test_a_misspelt_field_of_a_cell_to_plan_is_named(client: httpx.Client) -> None:
    field = {"near_mm": 130, "far_mm": 230, "near_width_mm": 60}
    assert_problem(
        client.post("/plan", json={"scanner": field, "wanted_m": 0.2}), 422, "Did you mean 'wanted_mm'?"
    )
    cell = {"scanner": field, "axes": [{**SLIDE, "cariers": "robot"}]}
    assert_problem(client.post("/plan", json=cell), 422, "'axes.0.cariers', which is unknown")


def test_a_scanner_that_is_told_twice_is_refused(client: httpx.Client) -> None:
    text = '{"cell": {"pose_convention": "ur", "scanners": {"left": {}, "left": {"on": "base"}}}}'
    headers = {"content-type": "application/json"}
    assert_problem(client.post("/sessions", content=text.encode(), headers=headers), 422, "left", "twice")
