"""What the TCP's result says of itself."""

from typing import Final

import numpy as np

from calib_core.cell.found import on_flange
from calib_core.evidence.numbers import fixed, plus_minus, quantity
from calib_core.exports.workpiece import turned_deg
from calib_core.messages import message
from calib_core.records import Session
from calib_core.records.evidence import AnyBlock, Axis, Column, Figure, Plot, Row, Table
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.evidence_parts import (
    capture_series,
    captures_used,
    label_of,
    left_out,
    noise_table,
    provenance,
    residual_plot,
    residual_table,
    workpiece_headline,
    workpiece_places,
    workpiece_table,
)
from calib_core.stages.frame_blocks import frame_block, open_frame, pose_sigmas
from calib_core.stages.tcp.arm_found import arm_table
from calib_core.stages.tcp.pose_repeatability import repeatability_table
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.tcp.warm_up import drift_blocks
from calib_core.stages.topology_found import axes_table, scanner_frames
from calib_core.stages.two_step_blocks import two_step_blocks

_SCANNER_LABELS: Final = {
    "radius_mm": ("Sphere's radius", "mm"),
    "scale_x": ("Scale of x", "%"),
    "scale_z": ("Scale of z", "%"),
    "shear": ("Shear of x by z", "%"),
    "bow": ("Bow of z", ""),
    **{f"incidence_{n}_mm": (message("Error by angle of incidence, degree {n}", n=n), "mm") for n in (1, 2, 4)},
}
COLUMNS: Final = (
    ("points", "Points", ""),
    ("surface_rms_mm", "Surface RMS", "mm"),
    ("leave_one_out_rms_mm", "Surface RMS, left out", "mm"),
    ("center_distance_mm", "Centre", "mm"),
    ("mahalanobis", "Distance", "σ"),
    ("weight", "Weight", ""),
    ("zone", "r/R", ""),
    ("shift_without_mm", "Shift if excluded", "mm"),
)


def evidence(session: Session, result: TcpResult) -> list[AnyBlock]:
    """Return the TCP told in blocks, the answer first."""
    places = workpiece_places(session, result)
    return [
        *workpiece_headline(places),
        *tool_sigmas(result),
        captures_used(result),
        *tool_frames(session, result),
        *axes_table(result),
        *workpiece_table(places),
        *residual_plot(result.residuals),
        *by_turn(session, result),
        *drift_blocks(result),
        *two_step_blocks(result),
        noise_table(result.variance_components),
        *scanner_table(result),
        *arm_table(None if result.verdict == "fail" else result.arm_model),
        *repeatability_table(session, result),
        *sphere_figures(result),
        *left_out(result.residuals),
        *residual_table(result.residuals, COLUMNS),
        *provenance(result),
    ]


def tool_sigmas(result: TcpResult | ChainResult) -> list[AnyBlock]:
    """Return how well the tool's position and orientation are known; of what failed no ± is believed."""
    if result.verdict == "fail":
        return []
    if result.up_to_shift is not None:
        turns = np.array(result.covariance, dtype=float)[:3, :3]
        if not np.isfinite(turns).all():
            return []
        worst_deg = float(np.rad2deg(np.sqrt(np.linalg.eigvalsh(turns)[-1])))
        quantity_deg = plus_minus(worst_deg, "°")
        return [Figure(label="Scanner's orientation", quantity=quantity_deg, remark="worst direction")]
    position_mm, orientation_deg = pose_sigmas(result.covariance)
    return [
        Figure(label="Scanner's position", quantity=plus_minus(position_mm, "mm"), remark="worst direction"),
        Figure(label="Scanner's orientation", quantity=plus_minus(orientation_deg, "°"), remark="worst direction"),
    ]


def tool_frames(session: Session, result: TcpResult | ChainResult) -> list[AnyBlock]:
    """Return the frame of the scanner, or of each of several, to be typed into the controller."""
    return scanner_frames(session, result) or [_tool_frame(session, result)]


def _tool_frame(session: Session, result: TcpResult | ChainResult) -> AnyBlock:
    title = "Scanner on the flange" if on_flange(result.mount_from_laser) else "Scanner in base"
    covariance = None if result.verdict == "fail" else result.covariance
    if result.up_to_shift is not None:
        return open_frame(session, result.mount_from_laser, title, result.up_to_shift, covariance)
    return frame_block(session.cell.pose_convention, result.mount_from_laser, covariance, id="tool", title=title)


def scanner_table(result: TcpResult | ChainResult) -> list[AnyBlock]:
    """Return what was found of sphere and scanner together with the tool, nothing with one that failed."""
    found = result.errors_of_scanner
    if found is None or result.verdict == "fail":
        return []
    rows: list[Row] = []
    for name, value, sigma in zip(found.names, found.values, found.sigmas, strict=True):
        label, unit = _SCANNER_LABELS.get(name) or label_of(name)
        factor = 100.0 if unit == "%" else 1.0
        rows.append(Row(cells=[label, quantity(factor * value, unit, factor * sigma)]))
    columns = [Column(label="Error", align="left"), Column(label="Found")]
    caption = message(
        "Each with its prior; errors of scale, shear and bow are in the uncertainty, not taken out of the points."
    )
    if found.applied:
        caption = message("Each with its prior; errors of scale, shear and bow are taken out of the points.")
    return [
        Table(id="scanner", title="Sphere and scanner", detail=True, caption=caption, columns=columns, rows=rows)
    ]


def sphere_figures(result: TcpResult | ChainResult) -> list[AnyBlock]:
    """Return where the sphere is."""
    if result.up_to_shift is not None:
        return []
    names = ("x", "y", "z")
    values = zip(names, result.sphere_center_mm, strict=True)
    where = message("in base" if result.sphere_center_in_base_mm is not None else "on the flange")
    figures = [
        Figure(
            detail=True, label=message("Centre {axis}, {where}", axis=n, where=where), quantity=fixed(v, 3, "mm")
        )
        for n, v in values
    ]
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
