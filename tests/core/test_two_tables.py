"""Two tables: a trouble of one of them is named, and which one it is."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from calib_core.cell.axes import axis_of_mounts
from calib_core.exports.workpiece import point_jacobian
from calib_core.findings import Finding
from calib_core.frames import RigidTransform
from calib_core.records import Session, Sphere
from calib_core.simulation.topology_cell import simulate_topology
from calib_core.simulation.topology_scenarios import TOPOLOGY_SCENARIOS
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.turntable.record import TurntableResult

TWO = TOPOLOGY_SCENARIOS["two-tables"]


def said(which: str, seed: int, told: Any = None, read_as: float = 1.0, **wrong: float) -> Iterable[Finding]:
    """Return what is noticed where one of the tables errs, or is told or read wrongly."""
    axes = tuple(replace(axis, **wrong) if axis.name == which else axis for axis in TWO.axes)
    session, files, _ = simulate_topology(replace(TWO, axes=axes), "two-tables", seed)
    captures = [
        one.model_copy(update={"axes_deg": {**one.axes_deg, which: read_as * one.axes_deg[which]}})
        if one.axes_deg
        else one
        for one in session.captures
    ]
    cell_axes = [
        axis.model_copy(update={"direction": told if axis.name == which else 1})
        for axis in session.cell.axes or ()
    ]
    cell = session.cell.model_copy(update={"axes": cell_axes})
    changed: Session = session.model_copy(update={"captures": captures, "cell": cell})
    found = solve_stage(changed, "turntable", files.__getitem__)
    return [one for one in found.findings if one.severity != "note"]


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("which", ["one", "two"])
def test_the_table_that_is_told_to_turn_the_other_way_round_is_named(which: str) -> None:
    (direction,) = said(which, 1, told=-1)
    assert (direction.code, direction.values["axis"]) == ("table-direction", which)
    assert direction.remedy is not None
    assert direction.remedy.changes is not None
    mended = direction.remedy.changes.cell["axes"]
    assert {axis["name"]: axis["direction"] for axis in mended} == {"one": 1, "two": 1}


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("which", ["one", "two"])
def test_the_table_whose_encoder_is_eccentric_is_named(which: str) -> None:
    codes = {one.code: one.values["axis"] for one in said(which, 1, told=1, eccentric=0.002)}
    assert codes["encoder-eccentric"] == which  # the first of two was not looked at: 88 times its ± off
    assert set(codes.values()) == {which}


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("which", ["one", "two"])
def test_the_table_whose_readings_count_too_much_is_named_and_its_scale_found(which: str) -> None:
    (scale,) = said(which, 1, told=1, read_as=1.004)
    assert (scale.code, scale.values["axis"], scale.values["of"]) == ("encoder-scale", which, "rotary")
    assert float(scale.values["error_percent"]) == pytest.approx(100 * (1 / 1.004 - 1), abs=0.02)


@pytest.mark.parametrize("stage", [pytest.param("turntable"), pytest.param("chain", marks=pytest.mark.thorough)])
def test_balls_on_every_table_are_told_where_they_are_on_it(stage: str) -> None:
    session, files, truth = simulate_topology(TWO, "two-tables", 1)
    result = solve_stage(session, stage, files.__getitem__)
    assert isinstance(result, TurntableResult | ChainResult)
    frames = {one.outof: (one.matrix, one.covariance) for one in result.frames if one.into == "base"}
    covariance = result.covariance if stage == "turntable" else result.turntable_covariance
    frames["two"] = result.base_from_turntable, covariance  # the last axis that carries a ball
    on_tables = {one["name"]: one for one in truth["spheres"] if one["in"] != "base"}
    told = {one.name: one for one in result.spheres if one.carrier != "base"}
    assert {name: one.carrier for name, one in told.items()} == {
        name: one["in"] for name, one in on_tables.items()
    }
    for name, ball in told.items():
        frame = RigidTransform.from_rounded(frames[ball.carrier][0], "base", "turntable")
        moves = point_jacobian(frame, np.array(ball.center_mm))
        spread = moves @ np.array(frames[ball.carrier][1])[:6, :6] @ moves.T
        spread += frame.rotation @ np.array(ball.covariance) @ frame.rotation.T
        off = frame.apply(np.array(ball.center_mm)) - np.array(on_tables[name]["center_mm"])
        assert off @ np.linalg.solve(spread, off) < 16.3, name  # χ² of three, 99.9 %; apart both are wider
        assert np.sqrt(np.trace(spread)) < 1.0, name
        assert ball.captures, name


def test_a_ball_told_to_be_on_a_table_is_there_though_the_other_turned_meanwhile() -> None:
    session, files, _ = simulate_topology(TWO, "two-tables", 1)
    carriers = axis_of_mounts(session.cell, [one for one in session.captures if one.step == "turntable"])
    assert {*carriers.values()} == {"one", "two"}
    angles = np.random.default_rng(1).uniform(-180.0, 180.0, len(session.captures)).tolist()
    captures = [
        one.model_copy(update={"axes_deg": {"one": angle, "two": angle, own: (one.axes_deg or {})[own]}})
        if one.step == "turntable" and (own := carriers[one.mount or ""])
        else one
        for one, angle in zip(session.captures, angles, strict=True)
    ]
    told = [Sphere(name=mount, on=axis) for mount, axis in carriers.items()]
    cell = session.cell.model_copy(update={"spheres": [*told, Sphere(name="still", on="base")]})
    found = [
        solve_stage(session.model_copy(update=update), "turntable", files.__getitem__)
        for update in ({"cell": cell}, {"cell": cell, "captures": captures})
    ]
    apart, together = ({axis.name: axis for axis in one.axes} for one in found if isinstance(one, TurntableResult))
    assert apart.keys() == together.keys()
    for name, axis in apart.items():
        assert np.allclose(axis.axis_direction, together[name].axis_direction, atol=1e-7)
