"""The guide of scanning and merging: views all around, heights, the merge and its answer."""

import re
from typing import Any

import numpy as np
import pytest

from calib_core.graph.keys import Graph, stage_captures
from calib_core.records import Capture, Guide, Measured, Session, parse_cell
from calib_core.simulation import SimulatedSession, simulate
from calib_core.stages.guide import guide


@pytest.fixture(scope="module")
def cell() -> SimulatedSession:
    return simulate("cell", 4)


def solved(simulated: SimulatedSession, session: Session, *stages: str, **more: Any) -> dict[str, dict[str, Any]]:
    """Results as they would be, with the truth for an answer."""
    results: dict[str, dict[str, Any]] = {}
    for stage in stages:
        rows = [{"capture": c.id, "used": True} for c in stage_captures(session, stage) if not c.excluded]
        key = Graph(session, str).key(stage)
        results[stage] = {
            "stage": stage,
            "inputs_sha256": key,
            "verdict": "pass",
            "warnings": [],
            "undetermined": [],
            "residuals": rows,
        }
        results[stage] |= {"tool0_from_laser": simulated.truth["tool0_from_laser"]}
        if stage != "tcp":
            results[stage] |= {"base_from_turntable": simulated.truth["base_from_turntable"], "direction": 1}
    if stages:
        results[stages[-1]] |= more
    return results


def with_scans(simulated: SimulatedSession, scans: list[Capture]) -> Session:
    spheres = [c for c in simulated.session.captures if c.step != "scan"]
    return simulated.session.model_copy(update={"captures": [*spheres, *scans]})


def guided(session: Session, results: dict[str, Any], refused: tuple[str, ...] = ()) -> Guide:
    measured = [
        Measured(capture=c.id, kind=c.kind, verdict="fail" if c.id in refused else "pass")
        for c in session.captures
    ]
    return guide(session, measured, results, Graph(session, str).stale(results))


def scans_of(simulated: SimulatedSession) -> list[Capture]:
    return [c for c in simulated.session.captures if c.step == "scan"]


@pytest.mark.thorough
def test_every_scan_leaves_fewer_to_take_and_the_table_is_sent_where_it_goes_next(cell: SimulatedSession) -> None:
    scans = scans_of(cell)
    for count in range(len(scans) + 1):
        session = with_scans(cell, scans[:count])
        now = guided(session, solved(cell, session, "tcp", "turntable", "chain")).current
        assert now.still_needed == len(scans) - count
        assert (now.step, now.stage) == (("scan", "merge") if count < len(scans) else ("merge", "merge"))
        if 0 < count < len(scans):
            assert f"about {scans[count].table_deg:.0f}°" in now.instruction
    assert now.action == "solve"
    assert "12 scans" in now.instruction


def test_the_other_sense_of_turning_is_followed(cell: SimulatedSession) -> None:
    mirrored = [c.model_copy(update={"table_deg": -(c.table_deg or 0.0)}) for c in scans_of(cell)]
    session = with_scans(cell, mirrored[:3])
    results = solved(cell, session, "tcp", "turntable", "chain")
    for result in results.values():
        result["direction"] = -1
    assert "about 270°" in guided(session, results).current.instruction  # −90°, as the encoder would have it


def test_scans_from_one_height_and_scans_of_one_side_do_not_count_as_enough(cell: SimulatedSession) -> None:
    low, *_ = scans_of(cell)
    at_one_height = [low.model_copy(update={"id": f"w{k}", "table_deg": 30.0 * k}) for k in range(12)]
    session = with_scans(cell, at_one_height)
    results = solved(cell, session, "tcp", "turntable", "chain")
    now = guided(session, results).current
    assert (now.action, now.progress) == ("capture", "one height only")
    assert "from steeper above" in now.instruction
    assert re.search(r"about (19|20|21)° above", now.why)
    same = [low.model_copy(update={"id": f"w{k}"}) for k in range(3)]
    assert guided(with_scans(cell, same), results).current.progress == "1 of 12 scans around"
    refused = guided(with_scans(cell, scans_of(cell)[:3]), results, refused=("v02",)).current
    assert refused.progress == "2 of 12 scans around"


def test_a_scan_without_angle_or_pose_is_named(cell: SimulatedSession) -> None:
    one, two, three, *_ = scans_of(cell)
    for change, word in (({"table_deg": None}, "angle"), ({"pose": None}, "pose"), ({"pose": [1.0, 2.0]}, "7")):
        session = with_scans(cell, [one, two.model_copy(update=change), three])
        now = guided(session, solved(cell, session, "tcp", "turntable", "chain")).current
        assert now.action == "capture"
        assert word in now.instruction + now.why
        assert "v02" in now.instruction, now.instruction


def test_merged_stale_and_failed(cell: SimulatedSession) -> None:
    session = with_scans(cell, scans_of(cell))
    results = solved(cell, session, "tcp", "turntable", "chain", "merge")
    done = guided(session, results)
    assert (done.current.action, done.current.step, done.current.drawing) == ("review", "merge", "merge-done")
    status = {step.step: step.status for step in done.steps}
    assert (status["scan"], status["merge"]) == ("done", "done")
    fewer = with_scans(cell, scans_of(cell)[:-1])
    again = guided(fewer, results)
    assert {s.step: s.status for s in again.steps}["merge"] == "stale"
    results["merge"]["verdict"] = "fail"
    assert {s.step: s.status for s in guided(session, results).steps}["merge"] == "failing"


def test_scans_wait_for_the_calibration_and_not_for_verifying(cell: SimulatedSession) -> None:
    session = with_scans(cell, [])
    before = {s.step: s.status for s in guided(session, {}).steps}
    assert (before["scan"], before["merge"]) == ("later", "later")
    after = {s.step: s.status for s in guided(session, solved(cell, session, "tcp", "turntable", "chain")).steps}
    assert (after["scan"], after["merge"]) == ("todo", "later")


def test_without_a_table_other_sides_are_asked_for(cell: SimulatedSession) -> None:
    """A robot alone goes round the object; six sides are wanted, and the same side twice counts once."""
    captures = [c for c in cell.session.captures if c.step == "tcp"]
    scan = scans_of(cell)[0].model_copy(update={"table_deg": None})
    assert scan.pose is not None
    record = cell.session.cell.to_json()
    record.pop("turntable")
    alone = cell.session.model_copy(update={"cell": parse_cell(record)})
    seen: list[str] = []
    for count in range(7):
        turned = []
        for k in range(count):
            half = np.deg2rad(15.0 * k)
            pose = [*scan.pose[:3], float(np.cos(half)), float(np.sin(half)), 0.0, 0.0]
            turned.append(scan.model_copy(update={"id": f"w{k}", "pose": pose}))
        session = alone.model_copy(
            update={
                "captures": [*captures, *turned, *([turned[0].model_copy(update={"id": "x"})] if turned else [])]
            }
        )
        seen.append(str(guided(session, solved(cell, session, "tcp")).current.progress))
    assert seen[1:] == [*(f"{k} of 6 sides" for k in range(1, 6)), "enough scans"]
