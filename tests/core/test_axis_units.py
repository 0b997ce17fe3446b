"""Readings of an axis in another unit: one sentence that names the unit and by what to multiply."""

from typing import Any

import numpy as np
import pytest

from calib_core.cell.axes import moved_axes, reading_sigmas, scales_asked
from calib_core.errors import InputError, MotionError
from calib_core.library.opened import in_memory
from calib_core.records import Cell, parse_session
from calib_core.simulation import TOPOLOGY_SCENARIOS
from calib_core.simulation.topology_cell import simulate_topology


def solved_with(name: str, field: str, axis: str, factor: float) -> dict[str, Any]:
    session, files, _ = simulate_topology(TOPOLOGY_SCENARIOS[name], name, 3)
    record = session.to_json()
    for capture in record["captures"]:
        if axis in capture.get(field, {}):
            capture[field][axis] *= factor
    return in_memory(parse_session(record), files).run()


def test_a_slide_in_metres_is_told_before_anything_is_solved() -> None:
    with pytest.raises(InputError, match=r"'slide' in mm, got from 0 to .*, which looks like metres"):
        solved_with("slide", "axes_mm", "slide", 1e-3)


def test_a_slide_in_inches() -> None:
    with pytest.raises(
        MotionError, match=r"'slide' in mm, got readings that fit in inches\. Multiply them by 25\.4"
    ):
        solved_with("slide", "axes_mm", "slide", 1 / 25.4)


def test_a_tilt_in_radians() -> None:
    with pytest.raises(MotionError, match="axis 'tilt' in degrees, got readings that fit in radians"):
        solved_with("positioner", "axes_deg", "tilt", float(np.deg2rad(1.0)))


def test_a_rail_in_inches() -> None:
    with pytest.raises(
        MotionError, match=r"'rail' in mm, got readings that fit in inches\. Multiply them by 25\.4"
    ):
        solved_with("rail", "axes_mm", "rail", 1 / 25.4)


def test_where_no_capture_on_the_axes_says_how_they_stood_that_is_said() -> None:
    session, files, _ = simulate_topology(TOPOLOGY_SCENARIOS["positioner"], "positioner", 3)
    record = session.to_json()
    for capture in record["captures"]:
        if capture["step"] == "turntable":
            del capture["axes_deg"]
    with pytest.raises(MotionError, match=r"got 0\. p.* are not used: they do not say where the axis tilt stood"):
        in_memory(parse_session(record), files).run()


def test_all_axes_of_a_positioner_in_radians() -> None:
    session, files, _ = simulate_topology(TOPOLOGY_SCENARIOS["positioner"], "positioner", 3)
    record = session.to_json()
    for capture in record["captures"]:
        for name in capture.get("axes_deg", {}):
            capture["axes_deg"][name] = float(np.deg2rad(capture["axes_deg"][name]))
    with pytest.raises(MotionError, match="'tilt, turn' in degrees, got readings that fit in radians"):
        in_memory(parse_session(record), files).run()


def test_what_is_told_of_each_axis_is_what_its_solver_gets() -> None:
    """In the order of the axes: whether its scale is sought, never, or where plainly off; sigmas."""
    cell = Cell.model_validate(
        {
            "pose_convention": "kuka",
            "sphere_diameter_mm": 40.0,
            "axes": [
                {"name": "rail", "kind": "linear", "carries": "robot", "sigma_mm": 0.02, "encoder": "exact"},
                {"name": "tilt", "kind": "rotary", "carries": "object", "sigma_deg": 0.5},
                {"name": "turn", "kind": "rotary", "carries": "object", "encoder": "scale"},
            ],
        }
    )
    told = {
        axis.name: (scale, sigma)
        for axis, scale, sigma in zip(moved_axes(cell), scales_asked(cell), reading_sigmas(cell), strict=True)
    }
    assert told == {"rail": (False, 0.02), "tilt": (None, np.deg2rad(0.5)), "turn": (True, None)}
