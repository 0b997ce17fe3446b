"""Two tables: a trouble of one of them is named, and which one it is."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import pytest

from calib_core.findings import Finding
from calib_core.records import Session
from calib_core.simulation.topology_cell import simulate_topology
from calib_core.simulation.topology_scenarios import TOPOLOGY_SCENARIOS
from calib_core.stages.pipeline import solve_stage

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
