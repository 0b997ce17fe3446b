"""What the laser plane's result says of itself."""

import math
from typing import Final

from calib_core.evidence.numbers import plus_minus, quantity, rms
from calib_core.frames import RigidTransform
from calib_core.records import Session
from calib_core.records.evidence import AnyBlock, Axis, Figure, Plot
from calib_core.records.laser_plane_result import LaserPlaneResidual, LaserPlaneResult
from calib_core.stages.evidence_parts import capture_series, captures_used, provenance, residual_table
from calib_core.stages.frame_blocks import direction_text, frame_block
from calib_core.stages.frames_left_out import frames_left_out

_COLUMNS: Final = (
    ("board_distance_mm", "Distance", "mm"),
    ("points", "Points", ""),
    ("line_rms_mm", "Off the plane, RMS", "mm"),
    ("line_mean_mm", "Mean", "mm"),
    ("stripe_sigma_px", "Stripe noise", "px"),
    ("board_sigma_px", "Corner noise", "px"),
)


def evidence(session: Session, result: LaserPlaneResult) -> list[AnyBlock]:
    """Return the plane of light told in blocks, the answer first."""
    plane = result.plane_in_camera
    frame = RigidTransform.from_rounded(result.camera_from_laser, "camera", "laser")
    rows = [row for row in result.residuals if row.line_mean_mm is not None]
    return [
        Figure(label="Distance", quantity=plus_minus(result.distance_sigma_mm, "mm"), headline=True),
        Figure(label="Direction", quantity=plus_minus(result.normal_sigma_deg, "°"), headline=True),
        captures_used(result),
        Figure(
            title="Plane of light in the camera's frame",
            label="Normal",
            text=direction_text(plane.normal, math.radians(result.normal_sigma_deg)),
        ),
        Figure(
            label="Distance from the camera", quantity=quantity(plane.distance_mm, "mm", result.distance_sigma_mm)
        ),
        Figure(label="Stripes off the plane, RMS", quantity=rms(result.plane_rms_mm, "mm")),
        *([_stripes(rows)] if rows else []),
        frame_block(
            session.cell.pose_convention,
            frame,
            result.covariance,
            id="laser",
            title="Laser frame in the camera",
            detail=True,
        ),
        *frames_left_out(session, result),
        *residual_table(result.residuals, _COLUMNS, "Each stripe"),
        *provenance(result),
    ]


def _stripes(rows: list[LaserPlaneResidual]) -> Plot:
    return Plot(
        id="residuals",
        title="Residuals",
        shape="xy",
        caption="How far each stripe's points lie from the plane, against the board's distance. A trend means "
        "that camera or board do not fit; crosses are captures that are not used.",
        x=Axis(label="Board's distance", unit="mm"),
        y=Axis(label="Off the plane", unit="mm"),
        series=[
            capture_series(rows, [row.line_mean_mm for row in rows], "Mean", _distances(rows)),
            capture_series(rows, [row.line_rms_mm for row in rows], "RMS", _distances(rows)),
        ],
    )


def _distances(rows: list[LaserPlaneResidual]) -> list[float]:
    return [row.board_distance_mm or 0.0 for row in rows]
