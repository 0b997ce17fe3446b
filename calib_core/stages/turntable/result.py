"""The turntable's solution as the record that is stored, sent and archived."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from calib_core.cell.axes import frame_of
from calib_core.chain.observations import TableObservations
from calib_core.chain.table_frame import TableCovariance, TableFrame, frame_by_rule, frame_covariance
from calib_core.chain.turntable import TurntableSolution
from calib_core.findings import Finding, judgement, reasons_of
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import VarianceComponents
from calib_core.records.results import FoundFrame
from calib_core.records.topology import FoundSphere
from calib_core.stages.axes_found import axes_found
from calib_core.stages.tcp.result import components, estimated_of_robot
from calib_core.stages.turntable.record import (
    EncoderScaleError,
    TableCircle,
    TableMount,
    TurntableResidual,
    TurntableResult,
)
from calib_core.stages.turntable.verdict import undetermined_of_table

METHOD = "joint maximum likelihood over points, errors of poses and angles integrated out, scanner held"


def turntable_result(
    solution: TurntableSolution,
    observations: TableObservations,
    software: str,
    inputs_sha256: str,
    findings: Sequence[Finding],
) -> TurntableResult:
    """Return a solution of captures as a record, with what was noticed."""
    return TurntableResult(
        stage="turntable",
        method=METHOD,
        software=software,
        inputs_sha256=inputs_sha256,
        **judgement(findings),
        **mount_fields(solution),
        covariance=solution.covariance.pose.tolist(),
        undetermined=undetermined_of_table(solution),
        variance_components=variance_components(solution),
        residuals=table_rows(observations, solution, findings),
        axes=axes_found(solution.state, solution.unknowns_covariance, known="robot"),
        spheres=balls_on_axes(observations, solution),
        frames=frames_of_axes(solution),
        **table_fields(observations, solution),
    )


def mount_fields(solution: TurntableSolution) -> dict[str, Any]:
    """Return the first scanner's pose on what carries it, by its name in results."""
    mount = solution.state.mount_from_laser
    return {f"{mount.into}_from_laser": mount.to_rows()}


def table_fields(observations: TableObservations, table: TurntableSolution) -> dict[str, Any]:
    """Return the fields of `TableFields` by name."""
    frame, covariance, residuals, used = table.frame, table.covariance, table.residuals, table.used
    counts = Counter(o.mount for o, u in zip(observations, used, strict=True) if u)
    names = [o.sphere.capture for o in observations]
    return {
        "base_from_turntable": frame.base_from_turntable.to_rows(),
        "axis_direction_in_base": frame.axis.tolist(),
        "axis_point_in_base_mm": frame.base_from_turntable.translation_mm.tolist(),
        "direction": frame.direction,
        "axis_direction_covariance": covariance.axis_direction.tolist(),
        "axis_point_covariance": covariance.axis_point.tolist(),
        "axis_direction_sigma_deg": float(np.rad2deg(covariance.axis_direction_sigma_rad)),
        "axis_point_sigma_mm": float(np.sqrt(np.trace(covariance.axis_point))),
        "mounts": [
            TableMount(
                mount=name,
                center_in_turntable_mm=place.tolist(),
                radius_mm=float(np.hypot(place[0], place[1])),
                captures=counts[name],
            )
            for name, place in zip(table.mounts, frame.mounts_mm, strict=True)
        ],
        "circles": [
            TableCircle(
                mount=table.mounts[circle.mount],
                center_in_base_mm=circle.center.tolist(),
                normal_in_base=_towards(circle.normal, frame.axis).tolist(),
                radius_mm=circle.radius_mm,
                circle_rms_mm=circle.circle_rms_mm,
                plane_rms_mm=circle.plane_rms_mm,
                captures=list(dict.fromkeys(names[int(k)] for k in circle.captures)),
            )
            for circle in table.circles.circles
        ],
        "circles_axis_direction_in_base": None
        if table.circles.direction is None
        else _towards(table.circles.direction, frame.axis).tolist(),
        "angle_sigma_deg": float(np.rad2deg(table.reading_sigma)) if table.turns else 0.0,
        "reading_sigma_mm": None if table.turns else table.reading_sigma,
        "encoder_scale": EncoderScaleError.model_validate(asdict(table.encoder)),
        "radial_rms_mm": _rms(residuals.radial_mm[used]),
        "axial_rms_mm": _rms(residuals.axial_mm[used]),
        "angle_rms_deg": float(np.rad2deg(_rms(residuals.angle_rad[used]))) if table.turns else 0.0,
    }


def balls_on_axes(observations: TableObservations, table: TurntableSolution) -> list[FoundSphere]:
    """Return each mounting's ball on the axis that carries it, those on the last one first, and who saw it."""
    layout = table.state.walk.layout
    some = [o for o, used in zip(observations, table.used, strict=True) if used]
    return [
        FoundSphere.model_validate(
            {
                "name": name or "sphere-on-table",
                "in": frame_of(layout.axes[axis].name),
                "center_mm": place.tolist(),
                "covariance": covariance.mounts[3 * n : 3 * n + 3, 3 * n : 3 * n + 3].tolist(),
                "captures": list(dict.fromkeys(o.sphere.capture for o in some if o.mount == name)),
            }
        )
        for axis, frame, covariance in [(layout.table, table.frame, table.covariance), *_other_axes(table)]
        for n, (place, (_, name)) in enumerate(
            zip(frame.mounts_mm, (layout.places[k] for k in layout.on_axis(axis)), strict=True)
        )
    ]


def frames_of_axes(table: TurntableSolution) -> list[FoundFrame]:
    """Return the frames of other axes than the last one that carry balls, by the same rule, all axes at zero."""
    return [
        FoundFrame(
            into="base",
            outof=frame_of(table.state.walk.layout.axes[axis].name),
            matrix=frame.base_from_turntable.to_rows(),
            covariance=covariance.pose.tolist(),
        )
        for axis, frame, covariance in _other_axes(table)
    ]


def mounts_by_table(table: TurntableSolution) -> list[FoundFrame]:
    """Return where scanners are that were sought with the table beside an exact one, also as seen from that."""
    layout, first = table.state.walk.layout, table.state.mount(0)
    found: list[FoundFrame] = []
    for n, (name, carrier) in enumerate(layout.mounts[1:], 1):
        mount, columns = table.state.mount(n), layout.mount(n)
        covariance = table.unknowns_covariance[columns, columns]
        found.append(
            FoundFrame(
                into=carrier, outof="laser", scanner=name, matrix=mount.to_rows(), covariance=covariance.tolist()
            )
        )
        if carrier == first.into:
            seen = first.inverse() @ mount
            found.append(
                FoundFrame(
                    into=f"laser:{layout.mounts[0][0]}",
                    outof=f"laser:{name}",
                    matrix=seen.to_rows(),
                    covariance=seen_from(first, covariance).tolist(),
                )
            )
    return found


def seen_from(outer: RigidTransform, covariance: FloatArray) -> FloatArray:
    """Return the covariance (6, 6) of a pose as seen from a frame that is exact, by that in the outer frame."""
    moves = np.eye(6)
    moves[3:, 3:] = outer.rotation.T
    return moves @ covariance @ moves.T


def _other_axes(table: TurntableSolution) -> Iterator[tuple[int, TableFrame, TableCovariance]]:
    layout = table.state.walk.layout
    for axis in layout.carrying:
        if axis != layout.table and layout.on_axis(axis):
            told, size = layout.axes[axis].direction, layout.axis_and_places(axis)
            state, own = table.state.axis_with_places(axis), table.unknowns_covariance[np.ix_(size, size)]
            yield axis, frame_by_rule(state, told), frame_covariance(state, own, told)


def table_rows(
    observations: TableObservations, table: TurntableSolution, findings: Sequence[Finding]
) -> list[TurntableResidual]:
    """Return one row a capture of the table, those that are not used with the reasons that findings give."""
    residuals, reasons = table.residuals, reasons_of(findings)
    return [
        TurntableResidual(
            capture=o.sphere.capture,
            used=bool(table.used[k]),
            reason=None if table.used[k] else reasons.get(o.sphere.capture),
            mount=o.mount or None,
            table_deg=float(np.rad2deg(o.angle_rad)) if table.turns else None,
            points=len(o.sphere.points_in_laser_mm),
            surface_rms_mm=float(residuals.surface_rms_mm[k]),
            center_distance_mm=float(residuals.distance_mm[k]),
            radial_mm=float(residuals.radial_mm[k]),
            tangential_mm=float(residuals.tangential_mm[k]),
            axial_mm=float(residuals.axial_mm[k]),
            angle_deg=float(np.rad2deg(residuals.angle_rad[k])) if table.turns else None,
            center_in_base_mm=residuals.centers_in_base[k].tolist(),
            mahalanobis=float(np.sqrt(table.squared_distance[k])),
            side=int(residuals.sides[k]) or None,
        )
        for k, o in enumerate(observations)
    ]


def variance_components(table: TurntableSolution) -> VarianceComponents:
    """Return the standard deviations, and which of them were estimated."""
    sigmas, options = table.sigmas, table.options
    estimated = ["point_sigma_mm"] if options.point_sigma_mm is None else []
    estimated += estimated_of_robot(sigmas, options.position_sigma_mm, options.orientation_sigma_rad)
    estimated += [] if options.angle_sigma_rad == sigmas.angle_rad else ["angle_sigma_rad"]
    estimated += ["play_sigma_mm"] if sigmas.play_mm else []
    return components(sigmas, table.point_sigma_mm, 1.0, estimated)


def _towards(direction: FloatArray, axis: FloatArray) -> FloatArray:
    return direction if direction @ axis >= 0 else -direction


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
