"""Captures of a verification that were taken of one pose more than once: what the cell repeats."""

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import message
from calib_core.records import Capture, Session
from calib_core.records.evidence import AnyBlock
from calib_core.robots import parse_pose
from calib_core.stages.capability import (
    LEAST_REPEATED,
    capability_of_repeated,
    capability_table,
    tolerance_of,
)
from calib_core.stages.verify.calibrated import is_same_pose
from calib_core.stages.verify.record import VerifyResult


def capability_of_captures(session: Session, result: VerifyResult) -> list[AnyBlock]:
    """Return the table of a cell with a tolerance, where enough captures repeat poses of the verification."""
    limit_mm = tolerance_of(session)
    error = next((check for check in result.checks if check.name == "tool"), None)
    groups = [one for one in _by_pose(session, result) if len(one) > 1]
    repeats, count = sum(len(one) - 1 for one in groups), sum(map(len, groups))
    if limit_mm is None or error is None or repeats < LEAST_REPEATED - 1:
        return []
    of = message(
        "Of {count} captures that repeat a pose (poses: {poses}), along base's worst axis; the bias is the tool's "
        "error.",
        count=count,
        poses=len(groups),
    )
    return capability_table(of, capability_of_repeated(groups, error.value_mm, 2 * limit_mm), limit_mm)


def _by_pose(session: Session, result: VerifyResult) -> list[FloatArray]:
    """Return where the captures of each pose saw the sphere's centre (N, 3)."""
    seen = {row.capture: row.center_offset_in_base_mm for row in result.residuals if row.used}
    groups: list[tuple[RigidTransform, object, list[list[float]]]] = []
    for capture in session.captures:
        offset = seen.get(capture.id)
        if offset is None or capture.step != "verify" or capture.pose is None:
            continue
        pose = parse_pose(session.cell.pose_convention, capture.pose, capture.id)
        elsewhere = _readings(capture)
        own = next((of for at, other, of in groups if other == elsewhere and is_same_pose(at, pose)), None)
        if own is None:
            groups.append((pose, elsewhere, own := []))
        own.append(offset)
    return [np.array(of) for _, _, of in groups]


def _readings(capture: Capture) -> object:
    return capture.scanner, capture.mount, capture.table_deg, capture.axes_deg, capture.axes_mm
