"""What the poses of a set tell before anything is solved: wrong units, duplicates, motions that are missing."""

import hashlib
from collections.abc import Mapping, Sequence

import numpy as np

from calib_core.captures.content import pose_of
from calib_core.captures.sweep import sweep_poses
from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.poses.conventions import CONVENTIONS
from calib_core.records import Capture, Cell, ReadFile

_NEARER_THAN_A_ROBOT_CAN_MM = 10.0
_FARTHER_THAN_A_ROBOT_CAN_M = 50.0
_TURN_RAD = 2 * np.pi


def base_from_tool0_by_capture(cell: Cell, captures: Sequence[Capture]) -> dict[str, RigidTransform]:
    """Return the captures' poses by their ids; of a sweep the middle one, where all have been understood.

    Raises
    ------
    InputError
        If a pose is missing or wrong, or all are plainly in another unit than the convention says.
    """
    poses = {capture.id: middle_pose(cell, capture) for capture in captures}
    require_unit(cell, captures)
    return poses


def middle_pose(cell: Cell, capture: Capture) -> RigidTransform:
    """Return a capture's pose; of a sweep the middle one."""
    if capture.kind != "sweep":
        return pose_of(cell, capture)
    poses = sweep_poses(cell, capture)
    return poses[len(poses) // 2]


def _pose_rows(captures: Sequence[Capture]) -> list[list[float]]:
    """Return the numbers of all poses that the captures give, those of sweeps and their tracks too."""
    rows: list[list[float]] = []
    for capture in captures:
        rows += [capture.pose] if capture.pose is not None else []
        rows += capture.poses or []
        rows += [sample.pose for sample in capture.pose_track or []]
    return rows


def require_unit(cell: Cell, captures: Sequence[Capture]) -> None:
    """Refuse poses that are all plainly in another unit than the convention says; raises InputError."""
    convention = CONVENTIONS[cell.pose_convention]
    rows = _pose_rows(captures)
    if not rows:
        return
    numbers = np.array(rows, dtype=float)
    positions = numbers[:, [3, 7, 11]] if convention.form == "matrix" else numbers[:, :3]
    far = float(np.median(np.linalg.norm(positions, axis=1)))
    where = "captures: pose"
    if convention.mm_per_unit == 1 and 0 < far < _NEARER_THAN_A_ROBOT_CAN_MM:
        raise InputError(
            "flange positions in millimetres (pose_convention '{convention}')",
            "positions about {far:.3g} from the base: they look like metres",
            "Multiply x y z by 1000, or name the convention that counts in metres.",
            where,
            convention=convention.name,
            far=far,
        )
    if convention.mm_per_unit == 1000 and far > _FARTHER_THAN_A_ROBOT_CAN_M:
        raise InputError(
            "flange positions in metres (pose_convention '{convention}')",
            "positions about {far:.0f} from the base: they look like millimetres",
            "Divide x y z by 1000, or name the convention that counts in millimetres.",
            where,
            convention=convention.name,
            far=far,
        )
    if convention.form == "rotation-vector" and np.linalg.norm(numbers[:, 3:], axis=1).max() > 1.1 * _TURN_RAD:
        need = "rotation vectors in radians"
        to_do = "Multiply rx ry rz by π/180."
        raise InputError(need, "one of more than a full turn: it looks like degrees", to_do, where)


def angles_look_like_radians(cell: Cell, captures: Sequence[Capture]) -> bool:
    """Return whether all angles of a convention in degrees are so small that they may be radians."""
    convention = CONVENTIONS[cell.pose_convention]
    rows = _pose_rows(captures)
    if len(rows) < 3 or convention.form not in ("ZYX", "XYZ", "ZYZ"):
        return False
    angles = np.array(rows, dtype=float)[:, 3:]
    return bool(0 < np.abs(angles).max() <= np.pi + 1e-3)


def duplicates(captures: Sequence[Capture], read: ReadFile) -> dict[str, str]:
    """Return captures whose files are, byte for byte, those of an earlier one: id → the earlier one's id.

    Real measurements never repeat exactly, so one of the two is a copy.
    """
    first: dict[bytes, str] = {}
    repeated: dict[str, str] = {}
    for capture in captures:
        if capture.kind == "center":
            key = repr((capture.center_mm, capture.pose, capture.table_deg)).encode()
        else:
            key = b"".join(hashlib.sha256(read(name)).digest() for name in capture.files)
        earlier = first.setdefault(key, capture.id)
        if earlier != capture.id:
            repeated[capture.id] = earlier
    return repeated


def same_place(captures: Mapping[str, Capture], one: str, other: str) -> bool:
    """Return whether two captures were taken at the same pose, or poses, and table angle."""
    return _place(captures[one]) == _place(captures[other])


def _place(capture: Capture) -> tuple[object, ...]:
    track = [(sample.t_s, sample.pose) for sample in capture.pose_track or []]
    return (capture.pose, capture.poses, capture.timestamps_s, track, capture.table_deg, capture.mount)
