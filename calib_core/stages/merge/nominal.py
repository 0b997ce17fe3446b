"""The merged part beside its nominal: where that lies, and how far the points lie off it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import CalibrationError, MeasurementError
from calib_core.findings.codes import merge as codes
from calib_core.formats.meshes import parse_mesh
from calib_core.frames import FloatArray
from calib_core.fusion.alignment import Alignment, about_origin, best_fit
from calib_core.fusion.certainty import against_nominal
from calib_core.fusion.datums import DatumAlignment, Feature, by_datums, on_nominal
from calib_core.fusion.deviation import Deviations, Nominal, histogram, plane_cut
from calib_core.fusion.sharp_edges import near_sharp_edges
from calib_core.fusion.solve import MergeSolution
from calib_core.graph.stage_input import StageInput
from calib_core.messages import message
from calib_core.records import Finding, PartAlignment
from calib_core.stages.merge import record
from calib_core.stages.merge.record import PartSection

_MOST_DRAWN, _MOST_LINES = 400, 800
_DRAWN = 0.04  # of the section's size: how large the scale's end is drawn
_STEPS = (1.0, 2.0, 5.0)

_MOST_POINTS = 2_000_000
_OF_THE_PART = 0.05  # of the nominal's size: what is farther off is another thing
_FEW = 0.5
_OTHER_UNIT = 0.02
_HEAD_ON = 0.1  # such a share of the points, at least, is seen nearly head-on
_ALIKE = 0.9  # the mean normal's length: a thin sheet's two sides in one voxel have a mean inside of it
_EXTREMES, _APART = 5, 0.05  # of each sign; of the nominal's size


@dataclass(frozen=True, eq=False)
class Compared:
    """What the comparison found."""

    alignment: record.Alignment | None = None
    deviation: record.Deviation | None = None
    findings: tuple[Finding, ...] = ()


def compared(
    given: StageInput, solution: MergeSolution, voxel_mm: float, base_from_cloud: FloatArray, origin_mm: FloatArray
) -> Compared:
    """Return the merged part beside the nominal that the cell names; nothing where it names none.

    Points of the solution count from `origin_mm` in the cloud's frame; so does the nominal here.

    Raises
    ------
    InputError
        If the nominal's file is missing or no mesh.
    """
    settings = given.session.cell.merge
    if settings.reference is None:
        return Compared()
    data = given.read(settings.reference)
    mesh = parse_mesh(data, settings.reference)
    nominal = Nominal(mesh.corners_mm - origin_mm, mesh.triangles)
    wanted = settings.alignment or PartAlignment()
    points, normals, noise_mm2, of_one = _points(solution)
    try:
        _require_alike_size(nominal, points)
        found = _aligned(points, normals, nominal, wanted, base_from_cloud, origin_mm)
    except CalibrationError as error:
        return Compared(findings=(codes.NOMINAL_NOT_FOUND(why=str(error)),))
    told = wanted.method in ("none", "matrix")
    known = against_nominal(
        solution.patches,
        solution.errors,
        found.cloud_from_reference,
        not told,
        found.datums if isinstance(found, DatumAlignment) else (),
        noise_mm2,
    )
    deviation = _deviation(
        points, of_one, origin_mm, nominal, found, settings.tolerance_mm, voxel_mm, known.deviation_sigma_mm
    )
    findings = nominal_findings(found.alike, deviation.counted)
    cloud_from_reference = _shifted(found.cloud_from_reference, origin_mm)
    base_from_reference = base_from_cloud @ cloud_from_reference
    covariance = about_origin(found.covariance + known.covariance, found.cloud_from_reference, origin_mm)
    alignment = record.Alignment(
        method=wanted.method,
        rms_mm=deviation.rms_mm if told else found.rms_mm,
        base_from_reference=base_from_reference.tolist(),
        cloud_from_reference=cloud_from_reference.tolist(),
        covariance=None if told else _in_base(covariance, base_from_cloud).tolist(),
        alike=found.alike,
        datums=_datums_found(found, origin_mm) if isinstance(found, DatumAlignment) else [],
        reference_sha256=sha256(data).hexdigest(),
    )
    return Compared(alignment, deviation, tuple(findings))


def nominal_findings(alike: int, counted: float) -> list[Finding]:
    """Return what is doubtful of a nominal with so many poses alike, near which this share of the points lies."""
    found = [codes.NOMINAL_ALIKE(alike=alike)] if alike else []
    return [*found, codes.NOMINAL_FAR(percent=100 * counted)] if counted < _FEW else found


def cloud_from_reference(merge: Mapping[str, Any] | None, data: bytes) -> FloatArray:
    """Return where a merge's result, as JSON data, has the nominal in this file, as it lies if not at all."""
    found = (merge or {}).get("alignment")
    if not found or found["reference_sha256"] != sha256(data).hexdigest():
        return np.eye(4)
    return np.array(found["cloud_from_reference"], dtype=float)


def _shifted(pose: FloatArray, origin_mm: FloatArray) -> FloatArray:
    """Return a pose between frames whose zeros lie at `origin_mm` of two others as one between those."""
    moved = pose.copy()
    moved[:3, 3] += origin_mm - pose[:3, :3] @ origin_mm
    return moved


def _aligned(
    points: FloatArray,
    normals: FloatArray,
    nominal: Nominal,
    wanted: PartAlignment,
    base_from_cloud: FloatArray,
    origin_mm: FloatArray,
) -> Alignment:
    nothing = np.zeros((6, 6))
    if wanted.method == "none":
        return Alignment(np.eye(4), 0.0, nothing)
    if wanted.method == "matrix":
        pose = np.linalg.inv(base_from_cloud) @ np.array(wanted.base_from_reference, dtype=float)
        return Alignment(_shifted(pose.astype(float), -origin_mm), 0.0, nothing)
    fit = best_fit(points, normals, nominal)
    if wanted.method == "best-fit":
        return fit
    return by_datums(points, normals, nominal, _features(nominal, wanted, origin_mm), fit)


def _features(nominal: Nominal, wanted: PartAlignment, origin_mm: FloatArray) -> list[Feature]:
    if wanted.method == "3-2-1":
        places = np.reshape(wanted.datum_points_mm or [], (-1, 3)) - origin_mm
        return [on_nominal(nominal, "point", place, wanted.datum_radius_mm) for place in places]
    found: list[Feature] = []
    for datum in wanted.datums or ():
        if datum.kind == "sphere" and datum.center_mm is not None:
            centre = np.array(datum.center_mm) - origin_mm
            found.append(Feature("sphere", centre, datum.radius_mm, np.zeros(3)))
            continue
        one = on_nominal(nominal, datum.kind, np.array(datum.point_mm) - origin_mm, datum.radius_mm)
        if datum.kind == "plane" and datum.normal is not None:
            normal = np.array(datum.normal) / np.linalg.norm(datum.normal)
            one = replace(one, normal=normal if normal @ one.normal >= 0 else -normal)
        found.append(one)
    return found


def _datums_found(found: DatumAlignment, origin_mm: FloatArray) -> list[record.DatumFound]:
    return [
        record.DatumFound(
            kind=datum.kind,
            at_mm=(datum.at_mm + origin_mm).tolist(),
            radius_mm=seen.radius_mm,
            off_mm=seen.off_mm,
            rms_mm=seen.rms_mm,
        )
        for datum, seen in zip(found.datums, found.measured, strict=True)
        if datum.kind != "point"
    ]


def _points(solution: MergeSolution) -> tuple[FloatArray, FloatArray, float, NDArray[np.bool_]]:
    """Return the merged points, their normals, their mean variance, and which are of surfaces that face alike.

    Every so many where there are very many.  A point's variance along the normal is that of one seen head-on, over
    how many it stands for.
    """
    every = max(1, -(-solution.extent.points // _MOST_POINTS))
    parts = [
        tuple(column[::every] for column in (c.points_mm, c.normals, c.sigma_mm, c.counts, c.coherence))
        for c in solution.grid.clouds()
    ]
    points, normals, sigmas, counts, alike = (np.concatenate(c).astype(float) for c in zip(*parts, strict=True))
    head_on = float(np.quantile(sigmas**2 * counts, _HEAD_ON))
    return points, normals, head_on * float(np.mean(1 / counts)), alike > _ALIKE


def _require_alike_size(nominal: Nominal, points: FloatArray) -> None:
    scanned_mm = float(np.linalg.norm(np.ptp(points, axis=0)))
    if nominal.extent_mm < _OTHER_UNIT * scanned_mm or nominal.extent_mm > scanned_mm / _OTHER_UNIT:
        raise MeasurementError(
            message(
                "a reference of about the size of what was scanned ({scanned_mm:.0f} mm across)",
                scanned_mm=scanned_mm,
            ),
            message("one of {extent_mm:.3g} mm", extent_mm=nominal.extent_mm),
            "Export it in millimetres.",
            "reference",
        )


def _in_base(covariance: FloatArray, base_from_cloud: FloatArray) -> FloatArray:
    """Return the covariance of a pose into the cloud's frame as that of one into base: its translation turned."""
    turn = np.eye(6)
    turn[3:, 3:] = base_from_cloud[:3, :3]
    return turn @ covariance @ turn.T


def _deviation(
    points: FloatArray,
    of_one: NDArray[np.bool_],
    origin_mm: FloatArray,
    nominal: Nominal,
    found: Alignment,
    tolerance_mm: float | None,
    voxel_mm: float,
    sigma_mm: float,
) -> record.Deviation:
    pose = found.cloud_from_reference
    in_nominal = (points - pose[:3, 3]) @ pose[:3, :3]
    plain = of_one & ~near_sharp_edges(in_nominal, nominal.corners_mm, nominal.triangles, voxel_mm)
    if not plain.any():  # all of it is smaller than the voxels
        plain[:] = True
    points, in_nominal = points[plain], in_nominal[plain]
    values = nominal.distances_mm(in_nominal)
    of_it = np.abs(values) <= _OF_THE_PART * nominal.extent_mm
    counted = float(np.mean(of_it))
    if not counted:
        of_it = np.ones(len(values), dtype=bool)
    seen = Deviations(values[of_it])
    limit_mm = max(seen.largest_mm(0.99), 1e-3)
    told = tolerance_mm is not None
    return record.Deviation(
        rms_mm=seen.rms_mm,
        within_95_mm=seen.largest_mm(0.95),
        signed_mean_mm=seen.mean_mm,
        uncertainty_mm=sigma_mm if np.isfinite(sigma_mm) else None,
        points=len(seen.values_mm),
        counted=counted,
        across_edges=int((~plain).sum()),
        limit_mm=limit_mm,
        histogram=histogram(seen.values_mm, limit_mm).tolist(),
        extremes=_extremes(points[of_it] + origin_mm, seen.values_mm, _APART * nominal.extent_mm),
        tolerance_mm=tolerance_mm,
        within_tolerance=float(np.mean(np.abs(seen.values_mm) <= tolerance_mm)) if told else None,
        above_tolerance=float(np.mean(seen.values_mm > tolerance_mm)) if told else None,
        below_tolerance=float(np.mean(seen.values_mm < -tolerance_mm)) if told else None,
        sections=part_sections(in_nominal[of_it], nominal, origin_mm, voxel_mm, limit_mm),
    )


def _extremes(points: FloatArray, values: FloatArray, apart_mm: float) -> list[record.ExtremePoint]:
    """Return the farthest points, those outside first, each apart from the others of its side."""
    found: list[record.ExtremePoint] = []
    for order in (np.argsort(-values), np.argsort(values)):
        chosen: list[NDArray[np.float64]] = []
        for number in order[: 200 * _EXTREMES]:
            place = points[number]
            if all(np.linalg.norm(place - other) > apart_mm for other in chosen):
                chosen.append(place)
                found.append(record.ExtremePoint(point_mm=place.tolist(), deviation_mm=float(values[number])))
            if len(chosen) == _EXTREMES:
                break
    return found


def part_sections(
    points: FloatArray, nominal: Nominal, origin_mm: FloatArray, width_mm: float, limit_mm: float
) -> list[PartSection]:
    """Return the sections through the nominal's middle across its longest and its shortest side.

    Parameters
    ----------
    points : (N, 3)
        Of the part, in the nominal's frame.
    nominal : Nominal
    origin_mm : (3,)
        What both count from, in the nominal's own frame.
    width_mm : float
        How thick the slice of points is.
    limit_mm : float
        The scale's end of the deviations.
    """
    low, high = nominal.corners_mm.min(axis=0), nominal.corners_mm.max(axis=0)
    sides = high - low
    found: list[PartSection] = []
    for axis in dict.fromkeys((int(np.argmax(sides)), int(np.argmin(sides)))):
        across = [other for other in range(3) if other != axis]
        at = float((low + high)[axis] / 2)
        lines = plane_cut(nominal.corners_mm[:, [*across, axis]], nominal.triangles, at)
        inside = _some(points[np.abs(points[:, axis] - at) <= width_mm / 2], _MOST_DRAWN)
        if not len(lines) or not len(inside):
            continue
        magnified = _round(_DRAWN * float(sides[across].max()) / limit_mm)
        drawn = inside + (magnified - 1) * nominal.away(inside)[0]
        found.append(
            PartSection(
                axis="xyz"[axis],  # pyright: ignore[reportArgumentType]
                at_mm=round(at + float(origin_mm[axis]), 3),
                magnified=magnified,
                nominal=(_some(lines, _MOST_LINES) + origin_mm[across]).reshape(-1, 4).round(3).tolist(),
                points=(drawn[:, across] + origin_mm[across]).round(3).tolist(),
            )
        )
    return found


def _some(rows: FloatArray, most: int) -> FloatArray:
    return rows if len(rows) <= most else rows[np.linspace(0, len(rows) - 1, most).astype(int)]


def _round(times: float) -> float:
    """Return 1, 2, 5, 10, 20 … at most so many times, at least once."""
    power = 10.0 ** np.floor(np.log10(max(times, 1.0)))
    return float(power * max(step for step in _STEPS if power * step <= max(times, 1.0)))
