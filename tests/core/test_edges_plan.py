"""A cell that does not stand yet is planned from its edges alone, and simulated by the same description."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib_core.errors import InputError
from calib_core.guidance.cell_plan import CellToPlan, plan_cell
from calib_core.guidance.edges_plan import EdgesPlan
from calib_core.library.opened import in_memory
from calib_core.records.described import DescribedCell
from calib_core.simulation import simulate_described
from server.cli import main

FIELD = {"near_mm": 130, "far_mm": 230, "near_width_mm": 80}
PLAIN: dict[str, Any] = {"scanner": FIELD, "sphere_diameter_mm": 40, "most_captures": 20}
TURN = {"name": "turn", "kind": "rotary"}
CELLS: dict[str, dict[str, Any]] = {
    "fixed": {"arrangement": "sphere-on-robot"},
    "both": {"scanners": {"arm": {}, "gate": {"on": "base"}}},
    "plate": {"spheres": [{"name": "a"}, {"name": "b"}, {"name": "c"}]},
    "rail": {"axes": [{"name": "rail", "kind": "linear", "carries": "robot"}]},
    "positioner": {"axes": [{"name": "tilt", "kind": "rotary"}, TURN]},
    "gantry": {"machine": "gantry", "axes": [TURN]},
    "scara": {"machine": "scara"},
}


def planned(name: str, **more: Any) -> EdgesPlan:
    plan = plan_cell(CellToPlan.model_validate({**PLAIN, **CELLS[name], **more})).edges
    assert plan is not None
    return plan


@pytest.mark.parametrize("name", CELLS)
def test_every_edge_is_told_with_its_figure_or_what_stays_open(name: str) -> None:
    plan = planned(name)
    assert not plan.unseen
    assert plan.uncertainty_mm is not None
    assert plan.uncertainty_mm < 1.0
    for edge in plan.edges:
        told = [figure for figure in (edge.position_mm, edge.orientation_deg) if figure is not None]
        assert all(figure < 2.0 for figure in told)
        assert len(told) == 2 or edge.open or edge.name == "rail"  # a shift has no place
    still_open = {edge.name for edge in plan.edges if edge.open}
    assert still_open == {"gantry": {"tool0_from_laser", "turn"}, "scara": {"tool0_from_laser"}}.get(name, set())
    if name in ("gantry", "scara"):
        down = {tuple(np.round(np.array(one.base_from_tool0)[:3, 2], 9)) for one in plan.captures}
        assert down == {(0.0, 0.0, -1.0)}  # as these machines hold the flange
    seen = [(one.scanner, one.sphere) for one in plan.captures]
    assert min(seen.count(pair) for pair in seen) >= 6


def test_fewer_captures_do_where_less_is_wanted() -> None:
    few, many = planned("both", wanted_mm=2.0), planned("both", wanted_mm=0.01)
    assert few.reachable
    assert few.uncertainty_mm is not None
    assert few.uncertainty_mm <= 2.0
    assert many.reachable is False
    assert len(few.captures) < len(many.captures)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["both", "positioner"])
def test_the_described_cell_is_simulated_and_solved_about_as_well_as_planned(name: str) -> None:
    simulated = simulate_described(DescribedCell.model_validate({**PLAIN, **CELLS[name], "scans": 4}), name, 1)
    results = in_memory(simulated.session, simulated.files).run()
    assert all(result.verdict != "fail" for result in results.values())
    assert results["merge"].points > 0
    last = results["chain" if "chain" in results else "tcp"]
    stated = {
        f"{frame.into}_from_laser" + (f":{frame.scanner}" if frame.scanner else ""): np.array(frame.covariance)
        for frame in last.frames
        if frame.outof == "laser" and frame.into in ("tool0", "base")
    }
    plan = {edge.name: edge for edge in planned(name).edges}
    for edge, covariance in stated.items():
        own_mm = 2 * float(np.sqrt(np.linalg.eigvalsh(covariance[3:, 3:])[-1]))
        assert 1 / 3 < (plan[edge].position_mm or 0.0) / own_mm < 3


def test_a_lone_scanners_edge_is_named_as_in_results_whatever_its_name() -> None:
    assert [edge.name for edge in planned("scara", scanners={"one": {}}).edges] == ["tool0_from_laser"]


BAD = [
    ({"scanners": {"gate": {"on": "base"}}, "spheres": [{"name": "a", "on": "base"}]}, "something moves before"),
    ({"axes": [{**TURN, "on": "b"}, {"name": "b", "kind": "rotary", "on": "turn"}]}, "a loop"),
    ({"axes": [{**TURN, "on": "nothing"}]}, "'nothing'"),
    ({"axes": [TURN, TURN]}, "'turn' twice"),
    ({"axes": [{**TURN, "axis_direction": [0, 0, 0]}]}, "axis_direction"),
]


@pytest.mark.parametrize(("cell", "said"), BAD)
def test_edges_that_make_no_cell_are_refused_in_one_sentence(
    cell: dict[str, Any], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(InputError, match=said):
        plan_cell(CellToPlan.model_validate({**PLAIN, **cell}))
    file = tmp_path / "cell.json"
    file.write_text(json.dumps({**PLAIN, **cell}))
    for command in (["plan", str(file)], ["simulate", str(file), "--seed", "1", "--out", str(tmp_path / "out")]):
        assert main(command) == 2 or "axis_direction" in cell.get("axes", [{}])[0]
        assert len(capsys.readouterr().err.strip().splitlines()) <= 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("cell", "named"),
    [({"wanted_m": 0.2}, "wanted_mm"), ({"axes": [{**TURN, "cariers": "robot"}]}, "carries"), ({"colour": 1}, "")],
)
def test_a_misspelt_field_is_refused_with_the_near_one(
    cell: dict[str, Any], named: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "cell.json"
    file.write_text(json.dumps({**PLAIN, "scans": 1, **cell}))
    simulate = ["simulate", str(file), "--seed", "1", "--out", str(tmp_path / "out")]
    for command in (["plan", str(file)], *([] if named == "wanted_mm" else [simulate])):
        assert main(command) == 2
        said = capsys.readouterr().err
        assert "which is unknown" in said
        assert (f"Did you mean '{named}'?" if named else "Leave it out.") in said
        assert len(said.strip().splitlines()) == 1


def test_the_command_prints_captures_and_edges(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "cell.json"
    file.write_text(json.dumps({**PLAIN, **CELLS["both"], "scans": 1}))
    assert main(["plan", str(file)]) == 0
    told = capsys.readouterr().out
    assert "Scanner arm on the flange: ± " in told
    assert "Scanner gate in base: ± " in told
    assert "gate  sphere-on-flange  flange at " in told
    assert main(["simulate", str(file), "--seed", "1", "--out", str(tmp_path / "out")]) == 0
    record = json.loads((tmp_path / "out" / "session.json").read_text())
    assert {one["scanner"] for one in record["captures"] if one["step"] == "scan"} == {"arm"}
