"""Bad input to the turntable: each mistake is named, or found and accounted for."""

import numpy as np
import pytest

from calib_core.errors import CalibrationError, InputError, MotionError
from calib_core.records import parse_session
from calib_core.simulation import simulate
from calib_core.stages.pipeline import run


def solve(cell, change=None):
    data = cell.session.to_json()
    if change is not None:
        change(data)
    return run(parse_session(data), cell.files.__getitem__, "turntable")["turntable"]


def refused(cell, kind, *said, change=None):
    with pytest.raises(kind) as caught:
        solve(cell, change)
    for words in said:
        assert words in str(caught.value)


@pytest.fixture(scope="module")
def cell():
    return simulate("turntable", 5)


def test_a_missing_table_angle_names_its_captures(cell):
    def forget(data):
        for capture in data["captures"]:
            if capture["id"] in ("t03", "t04"):
                del capture["table_deg"]

    refused(cell, InputError, "table_deg", "t03 and t04", change=forget)


def test_radians_for_degrees_are_named():
    refused(simulate("turntable-radians", 5), InputError, "only as radians", "180/π")


def test_small_angles_in_degrees_are_not_taken_for_radians(cell):
    table = simulate("turntable-partial", 5)

    def keep_near(data):
        data["captures"] = [c for c in data["captures"] if c.get("table_deg", 0) < 80]

    result = solve(table, keep_near)
    assert result.base_from_turntable is not None


@pytest.mark.thorough
def test_a_wrong_direction_in_the_cell_is_named_and_found():
    table = simulate("turntable-reversed", 5)
    result = solve(table, lambda data: data["cell"]["turntable"].update(direction=1))
    assert result.direction == -1
    assert any("turns the other way round" in warning for warning in result.warnings)
    axis = np.cross(result.axis_direction_in_base, table.truth["axis_direction_in_base"])
    assert np.rad2deg(np.linalg.norm(axis)) < 0.06
    (cause,) = result.causes
    assert cause.changes is not None
    assert cause.changes.cell == {"turntable": {"direction": -1}}
    assert cause.evidence[0].before == pytest.approx(180 - (cause.evidence[0].after or 0))
    right = solve(table, lambda data: data["cell"]["turntable"].update(direction=-1))
    assert right.causes == []
    assert not any("turns the other way" in warning for warning in right.warnings)


def test_a_sphere_on_the_axis_is_refused():
    refused(simulate("turntable-on-axis", 5), MotionError, "stands on the axis", "off the axis")


def test_equal_angles_are_refused():
    refused(simulate("turntable-equal-angles", 5), MotionError, "three different angles")


def test_mixed_mounts_are_left_out_and_told_where_they_belong():
    table = simulate("turntable-mixed-mounts", 5)
    result = solve(table)
    rejected = {row.capture: row.reason for row in result.residuals if not row.used}
    assert sorted(rejected) == ["t09", "t10"]
    assert all("it fits the mounting 'high'" in reason for reason in rejected.values())
    axis = np.cross(result.axis_direction_in_base, table.truth["axis_direction_in_base"])
    assert np.rad2deg(np.linalg.norm(axis)) < 0.06


def test_heights_without_names_ask_for_names(cell):
    def unname(data):
        for capture in data["captures"]:
            capture.pop("mount", None)

    later = "t09, t10, t11, t12, t13, t14, t15, t16"
    refused(cell, InputError, later, "Give these a `mount` of their own", change=unname)


@pytest.mark.thorough
def test_a_few_captures_of_another_place_ask_for_a_name(cell):
    def mislabel(data):
        for capture in data["captures"]:
            if capture["id"] in ("t09", "t10", "t11"):
                capture["mount"] = "low"
            elif capture.get("mount") == "high":
                capture["excluded"] = True

    result = solve(cell, mislabel)
    assert any("t09–t11 agree on another place" in warning for warning in result.warnings)


def test_too_few_captures(cell):
    def few(data):
        data["captures"] = [c for c in data["captures"] if c["step"] == "tcp" or c["id"] in ("t01", "t02", "t03")]

    refused(cell, MotionError, "at least 4 captures", change=few)


def test_a_chain_without_one_kind_of_captures(cell):
    data = cell.session.to_json()
    data["captures"] = [c for c in data["captures"] if c["step"] == "tcp"]
    with pytest.raises(CalibrationError, match="captures with step 'turntable', got none"):
        run(parse_session(data), cell.files.__getitem__, "chain")
