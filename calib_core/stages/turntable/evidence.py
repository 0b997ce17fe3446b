"""What the turntable's result says of itself; the whole chain's tells its table alike."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from calib_core.cell.found import placed_table
from calib_core.evidence.numbers import fixed, number_text, plus_minus, quantity, rms
from calib_core.frames import RigidTransform
from calib_core.messages import message, templates
from calib_core.records import Session
from calib_core.records.evidence import AnyBlock, Axis, Column, Figure, Plot, Row, Table
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.evidence_parts import (
    capture_series,
    captures_used,
    left_out,
    noise_table,
    provenance,
    residual_plot,
    residual_table,
    workpiece_headline,
    workpiece_places,
    workpiece_table,
)
from calib_core.stages.frame_blocks import direction_text, frame_block, open_frame
from calib_core.stages.topology_found import axes_table, carrier_name, scanner_frames, table_title
from calib_core.stages.turntable.record import TurntableResidual, TurntableResult

_HANDS: Final = templates({1: "right-handed", -1: "left-handed"})
TableLike = TurntableResult | ChainResult
COLUMNS = (
    ("mount", "Mounting", ""),
    ("table_deg", "Turntable", "°"),
    ("radial_mm", "Across", "mm"),
    ("tangential_mm", "Around", "mm"),
    ("axial_mm", "Along", "mm"),
    ("mahalanobis", "Distance", "σ"),
)


def evidence(session: Session, result: TurntableResult) -> list[AnyBlock]:
    """Return the turntable told in blocks, the answer first."""
    places, carrier = workpiece_places(session, result), carrier_name(result)
    return [
        *workpiece_headline(places, "On the table" if carrier == message("Turntable") else "On the axes"),
        *axis_sigmas(result),
        captures_used(result),
        table_frame(session, result, result.covariance),
        *scanner_frames(session, result),
        *axis_figures(result),
        *axes_table(result, shown_already=1),
        *mountings(result),
        *workpiece_table(places, carrier),
        *residual_plot(result.residuals),
        *wobble(result.residuals),
        *circles(result),
        table_noise(result),
        *left_out(result.residuals),
        *residual_table(table_rows(result), COLUMNS),
        *provenance(result),
    ]


def axis_sigmas(result: TableLike) -> list[AnyBlock]:
    """Return how well the axis is known; of what failed no ± is believed."""
    if result.verdict == "fail" or np.isnan(result.axis_direction_sigma_deg):
        return []
    if result.up_to_shift is not None:
        return [Figure(label="Axis, direction", quantity=plus_minus(result.axis_direction_sigma_deg, "°"))]
    return [
        Figure(label="Axis, place", quantity=plus_minus(result.axis_point_sigma_mm, "mm")),
        Figure(label="Axis, direction", quantity=plus_minus(result.axis_direction_sigma_deg, "°")),
    ]


def table_frame(session: Session, result: TableLike, covariance: Sequence[Sequence[float]]) -> AnyBlock:
    """Return the table's frame in the robot's base at angle zero; z is the axis."""
    if result.up_to_shift is not None and result.up_to_shift.own_base:
        seen = next(
            frame for frame in result.frames if frame.outof == "turntable" and frame.into.startswith("laser")
        )
        frame = RigidTransform.from_rounded(seen.matrix, "laser", "turntable")
        believed = None if result.verdict == "fail" else seen.covariance
        return frame_block(
            session.cell.pose_convention, frame, believed, id="table", title="Turntable seen from the scanner"
        )
    told = result.model_dump(by_alias=True)
    frame, title = placed_table(told), table_title(told)
    believed = None if result.verdict == "fail" else covariance
    if result.up_to_shift is not None:
        return open_frame(session, frame, title, result.up_to_shift, believed)
    return frame_block(session.cell.pose_convention, frame, believed, id="table", title=title)


def axis_figures(result: TableLike) -> list[AnyBlock]:
    """Return the axis, how the angles count, and how far the sphere is off its circles."""
    sigmas = np.sqrt(np.maximum(np.diag(np.array(result.axis_point_covariance, dtype=float)), 0.0))
    told = not np.isnan(result.axis_direction_sigma_deg)
    direction = (
        direction_text(result.axis_direction_in_base, float(np.deg2rad(result.axis_direction_sigma_deg)))
        if told
        else message("not determined")
    )
    known = [k for k, sigma in enumerate(sigmas) if np.isfinite(sigma)]
    decimals = plus_minus(float(np.nanmax([*sigmas, 0.0])), "mm").decimals
    point = ", ".join(number_text(result.axis_point_in_base_mm[k], decimals) for k in known)
    scale, linear = result.encoder_scale, result.reading_sigma_mm is not None
    return [
        Figure(title="Axis", label="Direction in base", text=direction),
        *([Figure(label="A point on it, in base", text=f"({point})\u202fmm")] if len(known) == 3 else []),
        *([] if linear else [Figure(label="Angles count", text=_HANDS[result.direction])]),
        Figure(
            label="Scale of the readings off by" if linear else "Scale of the angles off by",
            quantity=quantity(1e6 * scale.error, "ppm", 1e6 * scale.sigma),
            remark="accounted for" if scale.applied else "not accounted for",
        ),
        *(_off_line(result) if linear else _off_circle(result)),
    ]


def _off_line(result: TableLike) -> list[AnyBlock]:
    return [
        Figure(label="Sphere off its line, across, RMS", quantity=rms(result.radial_rms_mm, "mm")),
        Figure(label="Sphere off its place along the line, RMS", quantity=rms(result.axial_rms_mm, "mm")),
    ]


def _off_circle(result: TableLike) -> list[AnyBlock]:
    return [
        Figure(label="Sphere off its circle, across, RMS", quantity=rms(result.radial_rms_mm, "mm")),
        Figure(label="Sphere off its circle, along, RMS", quantity=rms(result.axial_rms_mm, "mm")),
        Figure(label="Sphere off its circle, around, RMS", quantity=rms(result.angle_rms_deg, "°")),
    ]


def mountings(result: TableLike) -> list[AnyBlock]:
    """Return where each mounting put the sphere."""
    heads = [Column(label="Mounting", align="left", own=True), Column(label="Captures")]
    heads += [Column(label=label, unit="mm", decimals=3) for label in ("Radius", "x", "y", "z")]
    rows = [
        Row(cells=[one.mount or "–", one.captures, one.radius_mm, *one.center_in_turntable_mm])
        for one in result.mounts
    ]
    caption = message("The sphere's centre in the frame of what carries it.")
    return [Table(title="Mountings of the sphere", caption=caption, columns=heads, rows=rows)]


def table_rows(result: TableLike) -> list[TurntableResidual]:
    """Return the residuals of captures on the table."""
    rows = [r for r in result.residuals if isinstance(r, TurntableResidual)]
    return [r for r in rows if r.table_deg is not None or r.radial_mm is not None]


def wobble(rows: Sequence[object]) -> list[AnyBlock]:
    """Return what is left at each angle of the table, in mm and as an angle."""
    seen = [r for r in rows if isinstance(r, TurntableResidual) and r.table_deg is not None]
    seen = [r for r in seen if r.radial_mm is not None]
    if not seen:
        return []
    angles = [float(r.table_deg or 0.0) for r in seen]
    across = capture_series(seen, [r.radial_mm for r in seen], "across the axis", angles)
    along = capture_series(seen, [r.axial_mm for r in seen], "along the axis", angles)
    around = capture_series(seen, [r.angle_deg for r in seen], "around the axis", angles)
    axis = Axis(label="Angle", unit="°")
    return [
        Plot(
            id="wobble",
            title="Wobble",
            shape="xy",
            caption="What is left at each angle. Noise looks random; a wave that returns each turn is the "
            "axis's own.",
            x=axis,
            y=Axis(label="Left over", unit="mm"),
            series=[across, along],
        ),
        Plot(
            id="wobble-angle",
            title="Wobble, as an angle",
            detail=True,
            shape="xy",
            caption="The part around the axis, as an angle of the table.",
            x=axis,
            y=Axis(label="Left over", unit="°"),
            series=[around],
        ),
    ]


def circles(result: TableLike) -> list[AnyBlock]:
    """Return the paper's circles beside the joint answer."""
    if not result.circles:
        return []
    rows: list[Row] = []
    other = result.circles_axis_direction_in_base
    if other is not None:
        sine = float(np.linalg.norm(np.cross(result.axis_direction_in_base, other)))
        angle = float(np.rad2deg(np.arcsin(min(sine, 1.0))))
        known = plus_minus(result.axis_direction_sigma_deg, "°")
        rows.append(Row(cells=["Axis, direction", known, None, quantity(angle, "°")]))
    joint = {mount.mount: mount.radius_mm for mount in result.mounts}
    for circle in result.circles:
        name, radius = circle.mount or "–", joint.get(circle.mount)
        apart = None if radius is None else quantity(circle.radius_mm - radius, "mm")
        beside = None if radius is None else fixed(radius, 3, "mm")
        rows += [
            Row(cells=[message("Radius, {mount}", mount=name), beside, fixed(circle.radius_mm, 3, "mm"), apart]),
            Row(
                cells=[
                    message("Off the circle, {mount}, RMS", mount=name),
                    None,
                    rms(circle.circle_rms_mm, "mm"),
                    None,
                ]
            ),
            Row(
                cells=[
                    message("Off its plane, {mount}, RMS", mount=name),
                    None,
                    rms(circle.plane_rms_mm, "mm"),
                    None,
                ]
            ),
        ]
    heads = [Column(label="Figure", align="left"), Column(label="Joint")]
    return [
        Table(
            id="circles",
            title="Joint answer beside the paper's circles",
            caption="A circle is fitted at each height; the axis goes through their centres. The joint answer "
            "weighs every capture by its own uncertainty.",
            columns=[*heads, Column(label="Circles"), Column(label="Difference")],
            rows=rows,
        )
    ]


def table_noise(result: TableLike) -> Table:
    """Return the standard deviations that the answer rests on."""
    parts = result.variance_components
    estimated = any(name.startswith("angle") for name in parts.estimated)
    told = "estimated" if estimated else "given"
    linear = result.reading_sigma_mm is not None
    sigma = quantity(result.reading_sigma_mm, "mm") if linear else quantity(result.angle_sigma_deg, "°")
    return noise_table(parts, [("Axis's reading", sigma, told)])
