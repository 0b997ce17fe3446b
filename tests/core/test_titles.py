"""What steps are called, by what a cell is made of."""

from typing import Any

import pytest

from calib_core.cell.titles import step_title
from calib_core.records import Cell

TURN = {"name": "turn", "kind": "rotary"}
FEED = {"name": "feed", "kind": "linear"}
RAIL = {"name": "rail", "kind": "linear", "carries": "robot"}
STILL: dict[str, Any] = {"gate": {"on": "base"}}


@pytest.mark.parametrize(
    ("told", "tcp", "axes"),
    [
        ({}, None, None),
        ({"turntable": {}}, None, None),
        ({"axes": [{"name": "table", "kind": "rotary"}]}, None, None),
        ({"axes": [RAIL]}, None, None),
        ({"axes": [RAIL, FEED]}, None, "Linear axis feed"),
        ({"axes": [TURN]}, None, "Rotary axis turn"),
        ({"axes": [FEED, TURN, RAIL]}, None, "Axes feed, turn"),
        ({"arrangement": "sphere-on-robot"}, "Scanner in base", None),
        ({"scanners": STILL}, "Scanner in base", None),
        ({"scanners": {**STILL, "arm": {"on": "tool0"}}}, None, None),
    ],
)
def test_a_step_is_called_by_what_the_cell_is_made_of(
    told: dict[str, Any], tcp: str | None, axes: str | None
) -> None:
    cell = Cell.model_validate({"pose_convention": "abb", **told})
    assert (step_title(cell, "tcp"), step_title(cell, "turntable"), step_title(cell, "merge")) == (tcp, axes, None)
