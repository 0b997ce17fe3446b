"""Poses as they truly are: a list of joints or poses, corrected by the errors of the arm that a session found."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from calib_core.arms.errors import arm_moves
from calib_core.arms.inverse import joints_of_pose
from calib_core.arms.kinematics import arm_of, flange_of_joints
from calib_core.captures.arm_joints import corrected_by
from calib_core.captures.content import pose_of
from calib_core.errors import ConflictError, InputError
from calib_core.formats.shared.number import number
from calib_core.frames import FloatArray, RigidTransform
from calib_core.library.opened import OpenSession
from calib_core.poses.numbers import parse_pose, to_pose
from calib_core.records.results import ArmModelFound
from calib_core.robots.table.columns import joint_columns
from calib_core.robots.text import source_of
from calib_core.steps import tool_stages


@dataclass(frozen=True, eq=False)
class CorrectedPose:
    """A pose, corrected, in the session's convention; `joints_deg` are those it was worked out with.

    `beyond_captures_deg` is how far one of them lies beyond the captures', where nothing was left out to see how
    well poses are predicted; the first joint is apart, as it only turns the whole arm.
    """

    name: str
    pose: list[float]
    convention: str
    base_from_tool0: list[list[float]]
    joints_deg: list[float]
    moved_mm: float
    line: int
    beyond_captures_deg: float

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON data."""
        return dict(vars(self))


@dataclass(frozen=True, eq=False)
class CorrectedPoses:
    """Poses of a file, what was skipped, and how well poses were predicted, without and with the correction."""

    poses: list[CorrectedPose]
    skipped: list[dict[str, Any]]
    held_out_rms_mm: list[float]


@dataclass(frozen=True, eq=False)
class _Row:
    name: str
    line: int
    joints: list[float] | None
    pose: RigidTransform | None


def corrected_poses(
    opened: OpenSession, path: str | Path, brand: str | None = None, told: Mapping[str, str] | None = None
) -> CorrectedPoses:
    """Return the poses of a file as they truly are, by what a session found of the arm.

    Parameters
    ----------
    opened : OpenSession
        Solved, with `cell.robot.errors` at `apply`.
    path : str or Path
        A table with the columns j1_deg … (and name), or anything that `read_poses` reads.
    brand, told
        As of `read_poses`.

    Raises
    ------
    InputError
        If the file is none of poses.
    ConflictError
        If the session applies no errors of an arm.
    """
    found, cell = _model(opened), opened.cell
    assert cell.robot.arm is not None
    arm = arm_of(cell.robot.arm)
    seeds = [
        (pose_of(cell, one), [float(v or 0.0) for v in one.joints_deg])
        for one in opened.captures
        if one.joints_deg and one.pose is not None
    ]
    reached = np.array([seed[1] for seed in seeds]).reshape(-1, len(arm.joints))
    named = {"arm": cell.robot.arm} if isinstance(cell.robot.arm, str) else {}
    rows, skipped = _rows(Path(path), len(arm.joints), brand, {**named, **(told or {})})
    corrected: list[CorrectedPose] = []
    for row in rows:
        joints, pose = row.joints, row.pose
        if joints is None and pose is not None:
            near = sorted(seeds, key=partial(_from, pose))[:3]
            solved = (joints_of_pose(arm, pose, seed[1]) for seed in near)
            joints = next((one[0].tolist() for one in solved if one is not None), None)
        if joints is None:
            reason = "its joints are not told, and do not follow from those of the session's captures"
            skipped.append({"line": row.line, "reason": reason, "file": Path(path).name})
            continue
        pose = pose or flange_of_joints(arm, joints, joints)
        true = corrected_by(cell, found, pose, arm_moves(arm, [joints])[0])
        corrected.append(
            CorrectedPose(
                row.name,
                to_pose(cell.pose_convention, true),
                cell.pose_convention,
                true.to_rows(),
                joints,
                float(np.linalg.norm(true.translation_mm - pose.translation_mm)),
                row.line,
                _beyond(reached, joints),
            )
        )
    return CorrectedPoses(corrected, skipped, found.held_out_rms_mm)


def _beyond(reached: FloatArray, joints: list[float]) -> float:
    """Return how far joints but the first lie beyond those of the captures (K, joints), deg."""
    if not len(reached):
        return 0.0
    off = np.maximum(reached.min(axis=0) - joints, np.array(joints) - reached.max(axis=0))
    return max(0.0, float(off[1:].max(initial=0.0)))


def _model(opened: OpenSession) -> ArmModelFound:
    result = next((opened.results[name] for name in tool_stages() if name in opened.results), None)
    if result is None:
        opened.run()
        result = next((opened.results[name] for name in tool_stages() if name in opened.results), None)
    model = getattr(result, "arm_model", None)
    if model is None or not model.applied:
        raise ConflictError(
            "a session that applies the arm's errors",
            "one that does not" if model is None or not model.worth_it else "one that covers them",
            "Give cell.robot.arm and the captures' joints, set cell.robot.errors to 'apply', and solve; where "
            "other poses are not predicted better, nothing is applied.",
            "cell.robot.errors",
        )
    return model


def _from(pose: RigidTransform, seed: tuple[RigidTransform, list[float]]) -> float:
    turned = float(np.linalg.norm(seed[0].rotation - pose.rotation))
    return float(np.linalg.norm(seed[0].translation_mm - pose.translation_mm)) + 300.0 * turned


def _rows(
    path: Path, count: int, brand: str | None, told: Mapping[str, str] | None
) -> tuple[list[_Row], list[dict[str, Any]]]:
    joints = _joint_table(path, count)
    if joints is not None:
        return joints
    from calib_core.library.machines import read_poses

    read = read_poses(path, brand=brand, told=told)
    rows = [
        _Row(
            one.name,
            one.line,
            None if one.joints_deg is None else list(one.joints_deg),
            None if one.pose is None else parse_pose(one.convention, one.pose),
        )
        for one in read.poses
    ]
    return rows, [one.to_json() for one in read.skipped]


def _joint_table(path: Path, count: int) -> tuple[list[_Row], list[dict[str, Any]]] | None:
    """Return the rows of a table whose header names joints; None where it does not."""
    if not path.is_file() or path.suffix.lower() not in (".csv", ".txt", ".tsv", ".dat"):
        return None
    lines = [(n, text) for n, text in source_of(path.read_bytes(), path.name).lines() if text.strip()]
    split = next((mark for mark in (";", "\t", ",") if lines and mark in lines[0][1]), None)
    head = [cell.strip().strip('"').lower() for cell in lines[0][1].split(split)] if lines else []
    if not (columns := joint_columns(head)):
        return None
    if len(columns) < count:
        node = f"j{len(columns) + 1}_deg"
        need = "a column for each of the arm's joints, j1_deg …"
        raise InputError(need, "none of {node}", "Add it.", path.name, node=node)
    named = head.index("name") if "name" in head else -1
    rows: list[_Row] = []
    skipped: list[dict[str, Any]] = []
    for line, text in lines[1:]:
        cells = [cell.strip().strip('"') for cell in text.split(split)]
        try:
            values = [number(cells[place]) * factor for place, factor in columns[:count]]
        except (ValueError, IndexError):
            skipped.append({"line": line, "reason": "not a number for each joint", "file": path.name})
            continue
        name = cells[named] if 0 <= named < len(cells) else f"line {line}"
        rows.append(_Row(name, line, values, None))
    return rows, skipped
