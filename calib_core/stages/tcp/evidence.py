"""What the TCP's result says of itself."""

from typing import Final

from calib_core.evidence.numbers import fixed, plus_minus
from calib_core.evidence.parts import (
    capture_series,
    captures_used,
    frame_block,
    left_out,
    noise_table,
    open_directions,
    pose_sigmas,
    provenance,
    residual_plot,
    residual_table,
    two_step_blocks,
    workpiece_headline,
    workpiece_places,
    workpiece_table,
)
from calib_core.exports.workpiece import turned_deg
from calib_core.frames import RigidTransform
from calib_core.records import ChainResult, Session, TcpResult
from calib_core.records.evidence import AnyBlock, Axis, Figure, Plot

COLUMNS = (
    ("points", "Points", ""),
    ("surface_rms_mm", "Surface RMS", "mm"),
    ("leave_one_out_rms_mm", "Surface RMS, left out", "mm"),
    ("center_distance_mm", "Centre", "mm"),
    ("mahalanobis", "Distance", "σ"),
    ("zone", "r/R", ""),
)

TITLE: Final = "Scanner on the flange (TCP)"


def evidence(session: Session, result: TcpResult) -> list[AnyBlock]:
    """Return the TCP told in blocks, the answer first."""
    places = workpiece_places(session, result)
    return [
        *workpiece_headline(places),
        *tool_sigmas(result),
        captures_used(result),
        *open_directions(result),
        tool_frame(session, result),
        *workpiece_table(places),
        *residual_plot(result.residuals),
        *by_turn(session, result),
        *two_step_blocks(result),
        noise_table(result.variance_components),
        *sphere_figures(result),
        *left_out(result.residuals),
        *residual_table(result.residuals, COLUMNS),
        *provenance(result),
    ]


def tool_sigmas(result: TcpResult | ChainResult) -> list[AnyBlock]:
    """Return how well the tool's position and orientation are known."""
    position_mm, orientation_deg = pose_sigmas(result.covariance)
    return [
        Figure(label="Scanner's position", quantity=plus_minus(position_mm, "mm"), remark="worst direction"),
        Figure(label="Scanner's orientation", quantity=plus_minus(orientation_deg, "°"), remark="worst direction"),
    ]


def tool_frame(session: Session, result: TcpResult | ChainResult) -> AnyBlock:
    """Return the scanner's frame on the flange, to be typed into the controller."""
    frame = RigidTransform.from_rounded(result.tool0_from_laser, "tool0", "laser")
    return frame_block(session, frame, result.covariance, id="tool", title="Scanner on the flange")


def sphere_figures(result: TcpResult | ChainResult) -> list[AnyBlock]:
    """Return where the sphere is."""
    names = ("x", "y", "z")
    values = zip(names, result.sphere_center_in_base_mm, strict=True)
    figures = [Figure(detail=True, label=f"Centre {n}, in base", quantity=fixed(v, 3, "mm")) for n, v in values]
    return [figures[0].model_copy(update={"title": "Sphere"}), *figures[1:]]


def by_turn(session: Session, result: TcpResult | ChainResult) -> list[AnyBlock]:
    """Return the residuals over the flange's orientation, where it was turned."""
    turned = turned_deg(session, result.model_dump(mode="json"))
    rows = [row for row in result.residuals if row.capture in turned and row.mahalanobis is not None]
    if not rows or max(turned[row.capture] for row in rows) < 1.0:
        return []
    angles = [turned[row.capture] for row in rows]
    return [
        Plot(
            id="residuals-by-turn",
            title="Residuals by the flange's orientation",
            detail=True,
            shape="xy",
            caption="The same distances against the angle by which the flange was turned from the first capture. "
            "A trend points to the robot or to the scanner's rotation.",
            x=Axis(label="Turned by", unit="°", low=0.0),
            y=Axis(label="Distance", unit="σ", low=0.0),
            series=[capture_series(rows, [row.mahalanobis for row in rows], x=angles)],
        )
    ]
