"""What is open of an arm whose poses are corrected: tool and table have swallowed most of it, and it is told."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from calib_core.archive.folder import result_data
from calib_core.captures.arm_joints import applied_moves, corrected_by, moves_of
from calib_core.cell.found import placed_table
from calib_core.exports.workpiece import at_workpiece
from calib_core.frames import FloatArray, RigidTransform
from calib_core.guidance.budget import stated, turned_back
from calib_core.guidance.calibrated import Calibrated, View
from calib_core.records import Session, parse_session
from calib_core.records.results import ArmModelFound
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.pipeline import solve_stage
from tests.benchmarks import paper_cell


@cache
def solved(seed: int) -> tuple[paper_cell.PaperCell, Session, dict[str, Any], ArmModelFound]:
    cell = paper_cell.simulate(seed, "arm")
    session = parse_session(cell.record(arm_known=True), "session")
    result = solve_stage(session, "chain", lambda _name: b"")
    assert isinstance(result, ChainResult)
    assert result.arm_model is not None
    assert result.arm_model.applied
    return cell, session, result_data(result), result.arm_model


def looks(seed: int) -> list[tuple[Calibrated, View, FloatArray, FloatArray, float]]:
    """Return each scan of the ball on the table: what is known, view, point in T, way off the axis, its error."""
    cell, session, result, model = solved(seed)
    known = Calibrated.of(result, cell.scans[0].center_mm.tolist())
    table, found = placed_table(result), list[tuple[Calibrated, View, FloatArray, FloatArray, float]]()
    away = cell.on_table_mm[0] - (cell.on_table_mm[0] @ cell.axis_direction) * cell.axis_direction
    for shot in cell.scans:
        capture = session.captures[0].model_copy(update={"joints_deg": np.rad2deg(shot.joints_rad).tolist()})
        moves = moves_of(session.cell, capture)
        assert moves is not None
        told = RigidTransform.of(shot.told[:3, :3], shot.told[:3, 3], "base", "tool0")
        flange = corrected_by(session.cell, model, told, moves)
        turned = table.inverse().apply(flange.apply(known.mount_from_laser.apply(shot.center_mm)))
        point = turned_back(known.direction * shot.angle_rad) @ turned
        off = np.hypot(point[0], point[1])
        outwards = np.array([point[0] / off, point[1] / off, 0.0])
        view = View(flange.rotation, shot.angle_rad, shot.center_mm)
        found.append((known, view, point, outwards, float(off - np.linalg.norm(away))))
    return found


def test_a_point_is_known_better_than_tool_table_and_arm_each() -> None:
    errors, now, before = list[float](), list[float](), list[float]()
    for seed in (601, 602):
        for known, view, point, outwards, error in looks(seed):
            assert known.arm is not None
            assert known.arm.terms is not None
            older = replace(known, arm=replace(known.arm, terms=None))  # as if the corrected arm were exact
            whole = stated(known, view, point)
            assert np.linalg.eigvalsh(whole)[0] > 0
            now.append(float(outwards @ whole @ outwards))
            before.append(float(outwards @ stated(older, view, point) @ outwards))
            errors.append(error)
    assert np.mean(np.square(errors)) < np.mean(now) < 0.5 * np.mean(before)


def test_moves_at_other_poses_are_about_those_of_their_joints() -> None:
    cell, session, result, model = solved(601)
    known = Calibrated.of(result, cell.scans[0].center_mm.tolist())
    assert known.arm is not None
    assert known.arm.terms is not None
    told = np.array([shot.told for shot in cell.scans])
    poses = known.arm.rotations, known.arm.translations
    found = known.arm.terms.moves_at(poses, (told[:, :3, :3], told[:, :3, 3]))
    exact: list[FloatArray] = []
    for shot in cell.scans:
        capture = session.captures[0].model_copy(update={"joints_deg": np.rad2deg(shot.joints_rad).tolist()})
        moves = applied_moves(session.cell, capture, model)
        assert moves is not None
        exact.append(moves)
    true = np.array(exact)
    for some, share in ((slice(0, 3), 0.05), (slice(3, 6), 0.15)):
        assert np.linalg.norm((found - true)[:, some]) < share * np.linalg.norm(true[:, some])


def test_what_is_stated_at_the_workpiece_counts_what_tool_and_table_have_swallowed_of_the_arm() -> None:
    _, session, result, _ = solved(601)
    older = {**result, "arm_errors": {**result["arm_errors"], "term_moves": None}}  # as if it were exact
    now, before = (
        {place.of: place.worst_sigma_mm for place in at_workpiece(session, one)} for one in (result, older)
    )
    assert 0.0 < now["both"] < 0.8 * before["both"]  # the table's place in base is the arm's, and so is the tool's
    assert before["tool"] < now["tool"] < 1.1 * before["tool"]  # an arm that errs otherwise elsewhere
