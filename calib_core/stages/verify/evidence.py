"""What the verification says of itself: how far an answer holds on captures that it was not solved from."""

from typing import Final

import numpy as np

from calib_core.evidence.numbers import fixed, limit_of, quantity, rms, same_decimals
from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import message
from calib_core.records import Capture, Session
from calib_core.records.decided_before import DECISIONS
from calib_core.records.evidence import AnyBlock, Column, Figure, Quantity, Row, Table
from calib_core.robots import parse_pose
from calib_core.stages.capability import (
    LEAST_REPEATED,
    capability_of_repeated,
    capability_table,
    tolerance_of,
)
from calib_core.stages.evidence_parts import (
    captures_used,
    left_out,
    provenance,
    residual_plot,
    residual_table,
    source_text,
)
from calib_core.stages.verify.calibrated import is_same_pose
from calib_core.stages.verify.limits import changes_table
from calib_core.stages.verify.record import VerifyCheck, VerifyResult

_COLUMNS: Final = (
    ("points", "Points", ""),
    ("surface_rms_mm", "Surface RMS", "mm"),
    ("center_distance_mm", "Centre", "mm"),
    ("expected_center_distance_mm", "Expected", "mm"),
    ("mahalanobis", "Distance", "σ"),
    ("zone", "r/R", ""),
    ("plane_offset_mm", "Off the plate's plane", "mm"),
)


def evidence(session: Session, result: VerifyResult) -> list[AnyBlock]:
    """Return the verification told in blocks, the answer first."""
    return [
        *_decision(result),
        *_scatter(result),
        Figure(label="Verified", text=source_text(result.verified, session.cell)),
        captures_used(result),
        *_chance(result),
        *_checks(result),
        *capability_of_captures(session, result),
        *changes_table(session.cell.verification),
        *residual_plot(result.residuals),
        *left_out(result.residuals),
        *residual_table(result.residuals, _COLUMNS),
        *provenance(result),
    ]


def _scatter(result: VerifyResult) -> list[AnyBlock]:
    """Return the sphere's scatter; of a plate alone its flatness leads where no limit decides."""
    expected, scatter = result.expected_scatter_rms_mm, result.held_out_scatter_rms_mm
    headline = result.decision is None
    if scatter is None:
        flat = [check for check in result.checks if check.name == "flatness" and headline]
        return [Figure(label=one.title, quantity=_measured(one), headline=True) for one in flat]
    shown, *beside = same_decimals([rms(one, "mm") for one in (scatter, expected) if one is not None])
    return [
        Figure(
            label="Held-out scatter of the sphere's centre, RMS",
            quantity=shown,
            limit=next(iter(beside), None),
            limit_label="expected",
            headline=headline,
        )
    ]


def _measured(check: VerifyCheck) -> Quantity:
    return quantity(check.value_mm, "mm", check.uncertainty_mm / 2)


def _decision(result: VerifyResult) -> list[AnyBlock]:
    if result.decision is None:
        return []
    remark = "by limits changed after the first capture" if result.limits_changed else None
    return [Figure(label="Decision", text=DECISIONS[result.decision], remark=remark, headline=True)]


def _checks(result: VerifyResult) -> list[AnyBlock]:
    """Return the figures beside the limits that were set for them before."""
    rows = [
        Row(
            cells=[
                check.title,
                _measured(check),
                None if check.limit_mm is None else limit_of(check.limit_mm, _measured(check)),
                DECISIONS[check.decision] if check.decision else "not judged",
            ]
        )
        for check in result.checks
    ]
    if not rows:
        return []
    columns = [Column(label="Figure", align="left"), Column(label="Measured"), Column(label="Limit")]
    return [
        Table(
            id="checks",
            title="Figures and limits",
            caption="2634-style. Passed up to the limit less U, conditional pass up to the "
            "limit, conditional fail up to the limit plus U (k = 2).",
            columns=[*columns, Column(label="Decision", align="left")],
            rows=rows,
        )
    ]


def _chance(result: VerifyResult) -> list[AnyBlock]:
    if result.chi_squared is None or result.chance is None:
        return []
    remark = message("{degrees_of_freedom} degrees of freedom", degrees_of_freedom=result.degrees_of_freedom)
    return [
        Figure(label="χ² of the scatter", quantity=quantity(result.chi_squared), remark=remark),
        Figure(label="A right answer shows as much in", quantity=fixed(100 * result.chance, 1, "%")),
    ]


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
