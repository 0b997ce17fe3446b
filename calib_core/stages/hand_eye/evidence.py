"""What the board's hand-eye calibration says of itself, and whether the sphere agrees."""

from typing import Final

from calib_core.cell.found import on_flange, scanner_answered
from calib_core.evidence.numbers import fixed, plus_minus, quantity
from calib_core.messages import message
from calib_core.records import Session
from calib_core.records.evidence import AnyBlock, Column, Figure, Row, Table
from calib_core.stages.evidence_parts import captures_used, provenance, residual_table
from calib_core.stages.frame_blocks import frame_block, pose_sigmas
from calib_core.stages.frames_left_out import frames_left_out
from calib_core.stages.hand_eye.record import HandEyeResult

_COLUMNS: Final = (("angle_deg", "Turned", "°"), ("shift_mm", "Shifted", "mm"), ("mahalanobis", "Distance", "σ"))
_ON_FLANGE: Final = message("Camera on the flange, {axis}")
_IN_BASE: Final = message("Camera in base, {axis}")
_AXES: Final = ("rx", "ry", "rz", "x", "y", "z")


def evidence(session: Session, result: HandEyeResult) -> list[AnyBlock]:
    """Return the hand-eye calibration told in blocks, the agreement with the sphere first."""
    place = [row[3] for row in result.camera_on_mount[:3]]
    label = _ON_FLANGE if result.tool0_from_camera is not None else _IN_BASE
    sigmas = [result.covariance[k][k] ** 0.5 for k in (3, 4, 5)]
    return [
        *_agreement(result),
        *(
            Figure(label=message(label, axis=axis), quantity=quantity(value, "mm", sigma))
            for axis, value, sigma in zip("xyz", place, sigmas, strict=True)
        ),
        *_pitch(result),
        Figure(label="Robot's position, as the frames show it", quantity=quantity(result.position_sigma_mm, "mm")),
        captures_used(result),
        *_scanner(session, result),
        *frames_left_out(session, result),
        *residual_table(result.residuals, _COLUMNS),
        *provenance(result),
    ]


def _pitch(result: HandEyeResult) -> list[AnyBlock]:
    if result.pitch_sigma is None:
        return []
    shown = quantity(100 * (result.pitch_factor - 1), "%", 100 * result.pitch_sigma)
    return [Figure(label="Board's pitch by the robot's lengths, beside the told one", quantity=shown)]


def _scanner(session: Session, result: HandEyeResult) -> list[AnyBlock]:
    """Return the scanner that follows, where no sphere's answer is there to be typed into the controller."""
    if result.scanner_by_board is None or result.agreement is not None:
        return []
    frame, covariance = scanner_answered(result.to_json())
    title = "Scanner on the flange" if on_flange(frame) else "Scanner in base"
    return [frame_block(session.cell.pose_convention, frame, covariance.tolist(), id="tool", title=title)]


def _agreement(result: HandEyeResult) -> list[AnyBlock]:
    found = result.agreement
    if found is None and result.laser_covariance is not None:
        position_mm, orientation_deg = pose_sigmas(result.laser_covariance)
        return [
            Figure(
                label="Scanner's position",
                quantity=plus_minus(position_mm, "mm"),
                remark="worst direction",
                headline=True,
            ),
            Figure(
                label="Scanner's orientation", quantity=plus_minus(orientation_deg, "°"), remark="worst direction"
            ),
            Figure(label="Agreement with the sphere", text="no answer by the sphere yet"),
        ]
    if found is None:
        return [Figure(label="Agreement with the sphere", text="no plane of light was solved here", headline=True)]
    rows = [Row(cells=[axis, value]) for axis, value in zip(_AXES, found.sigmas, strict=True)]
    return [
        Figure(
            label="Board and sphere apart, in units of both uncertainties",
            quantity=fixed(found.distance, 2, "σ"),
            remark=message("of six; a right pair is as far apart in {chance:.0f} %", chance=100 * found.chance),
            headline=True,
        ),
        Figure(label="Apart", quantity=quantity(found.shift_mm, "mm")),
        Figure(label="Turned", quantity=fixed(found.angle_deg, 4, "°")),
        Table(
            id="agreement",
            title="Board beside sphere",
            caption=message(
                "The scanner by the board less that of {with_stage}, in units of both "
                "uncertainties. Both rest on one camera and one plane of light.",
                with_stage=found.with_stage,
            ),
            columns=[Column(label="Axis", align="left"), Column(label="Difference", unit="σ", decimals=2)],
            rows=rows,
        ),
    ]
