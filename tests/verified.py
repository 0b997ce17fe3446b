"""Sessions that are calibrated, then verified with a tool that was shifted meanwhile."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from calib_core.archive.folder import result_data, save_session, write_result
from calib_core.frames import RigidTransform
from calib_core.records import Capture, Session
from calib_core.robots import parse_pose, to_pose
from calib_core.simulation import SimulatedSession, simulate_verify
from calib_core.simulation.verify_cell import VERIFY_SCENARIOS
from calib_core.stages.pipeline import run
from tests.trouble import Troubled, all_troubles, troubled

LIMIT_MM = 0.4


def verified_session(
    seed: int, shift_mm: float = 0.0, of_sphere: int = 14, limits: Mapping[str, float] | None = None
) -> SimulatedSession:
    """Return a session whose scanner was shifted along the flange's x between calibration and verification."""
    options = replace(
        VERIFY_SCENARIOS["verify"],
        of_sphere=of_sphere,
        of_bar=0,
        of_plate=0,
        limits={"tool_mm": LIMIT_MM} if limits is None else limits,
    )
    made = simulate_verify(seed, options)
    captures = [shifted(made.session, c, [shift_mm, 0.0, 0.0]) for c in made.session.captures]
    return replace(made, session=made.session.model_copy(update={"captures": captures}))


def shifted(session: Session, capture: Capture, by_mm: list[float], step: str = "verify") -> Capture:
    """Return a capture of a step with its flange told elsewhere, by so much along its own axes."""
    if capture.step != step or capture.pose is None or not np.any(by_mm):
        return capture
    convention = session.cell.pose_convention
    told = parse_pose(convention, capture.pose, "pose")
    moved = told @ RigidTransform.of(np.eye(3), np.array(by_mm, dtype=float), "tool0", "tool0")
    return capture.model_copy(update={"pose": to_pose(convention, moved)})


def solved(made: SimulatedSession, stage: str = "all") -> dict[str, dict[str, Any]]:
    """Return the results of a simulated session, as JSON data."""
    found = run(made.session, made.files.__getitem__, stage)
    return {name: result_data(result) for name, result in found.items()}


def written(made: SimulatedSession, folder: Path, *, with_results: bool = True) -> Path:
    """Write a simulated session as a folder, solved."""
    save_session(folder, made.session, made.files)
    if with_results:
        for name, result in run(made.session, made.files.__getitem__, "all").items():
            write_result(folder, name, result, made.session)
    return folder


def brought_tool(seed: int, off_mm: float, shuffled: bool = False) -> Troubled:
    """Return a verification of a tool that was brought and is off, with a limit of 1 mm and nothing else told.

    `shuffled`: half of the captures have each other's poses.
    """
    cell = troubled(all_troubles()["arms: clean"], seed)
    direction = np.random.default_rng([seed, 42]).standard_normal(3)
    tool = np.array(cell.tool0_from_laser)
    tool[:3, 3] += off_mm * direction / np.linalg.norm(direction)
    record = cell.session.to_json()
    record["cell"] |= {"known": {"tool0_from_laser": tool.tolist()}, "verification": {"tool_mm": 1.0}}
    for capture in record["captures"]:
        capture["step"] = "verify"
    if shuffled:
        poses = [capture["pose"] for capture in record["captures"][4:12]]
        for capture, pose in zip(record["captures"][4:12], [*poses[1:], poses[0]], strict=True):
            capture["pose"] = pose
    return replace(cell, session=Session.model_validate(record))
