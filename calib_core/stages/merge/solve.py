"""The merge stage: the calibration first, then every scan into T, one cloud, one mesh, one row a capture."""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib_core.archive.spill import FileSpill
from calib_core.archive.stored_clouds import CLOUD_FILE, MESH_FILE, SCAN_COLUMN
from calib_core.captures.arm_joints import corrected_captures
from calib_core.captures.contradictions import unfit
from calib_core.captures.observe import side_of_ball
from calib_core.captures.placement import Placement
from calib_core.captures.poses import require_unit
from calib_core.captures.scans import ScanGroup, SessionScans, local_origin_mm, poses_of, scan_groups
from calib_core.cell.found import told_by
from calib_core.errors import InputError
from calib_core.findings import judgement, reasons_of
from calib_core.findings.codes import merge as codes
from calib_core.formats.format import INTENSITY, Pieces
from calib_core.formats.ply import ply_pieces, ply_pieces_of
from calib_core.frames import FloatArray
from calib_core.fusion.crew import PATCH_VOXELS, Alone, Crew, MergeOptions
from calib_core.fusion.majority import NO_SCAN, HeaviestScans
from calib_core.fusion.mesh_finish import open_edges
from calib_core.fusion.outward import Outward
from calib_core.fusion.overlap import PoseErrors
from calib_core.fusion.scan import Scan
from calib_core.fusion.scatter import Scatter
from calib_core.fusion.solve import Looked, MergeSolution, solve_merge
from calib_core.graph.stage import SOFTWARE
from calib_core.graph.stage_input import StageInput
from calib_core.messages import message, templates
from calib_core.records import Finding
from calib_core.stages.merge.calibration import (
    CALIBRATION_SHARE,
    Calibration,
    calibration_of_session,
    not_placed,
    pose_errors,
    shared_shift,
)
from calib_core.stages.merge.doubts import merge_doubts
from calib_core.stages.merge.mistakes import Mistakes
from calib_core.stages.merge.nominal import Compared, compared
from calib_core.stages.merge.record import Facing, MergeResidual, MergeResult, PoseScatter
from calib_core.stages.merge.trials import PATCH_SPACINGS
from calib_core.stages.undetermined_places import FAR_MM

_USUAL_VOXEL_MM, _COARSE = 0.5, 2.0
_LOOKED_AT = 3  # scans of which the spacing is asked: one of them may be in metres, or hardly see the part
_IN_METRES = 0.02  # of the widest spacing

_METHODS = templates({
    "plain": "chain, cleaning on the scan's grid, voxel means weighted by 1/σ²",
    "registered": "chain, cleaning on the scan's grid, voxel means weighted by 1/σ², point-to-plane registration",
    "moved": "chain, cleaning on the scan's grid, voxel means weighted by 1/σ², "
    "tool and table moved by the scans' overlap",
})  # fmt: skip


def solve(given: StageInput) -> MergeResult:
    """Return all scans in one frame; the cloud and the mesh go to `given.store`, where there is one.

    Raises
    ------
    InputError
        If a file, a pose or a table angle is of no use, or the calibration is missing.
    MeasurementError
        If no scan has points on a surface, or most captures of the calibration do not show the sphere.
    MotionError
        If the calibration's motions do not determine it.
    """
    plan = plan_merge(given)

    def tell(fraction: float, what: str) -> None:
        given.progress(CALIBRATION_SHARE + (1 - CALIBRATION_SHARE) * fraction, what)

    with _crew(given, plan.options) as crew:
        mistakes: list[Finding] = []

        def fits(looked: Looked) -> bool:
            mistakes.extend(_mistakes(given, plan).find(looked))
            return not has_error(mistakes)

        solution = solve_merge(plan.scans, plan.errors, plan.options, tell, crew, plan.ball, fits)
        placement = plan.calibration.placement
        table, origin_mm = placement.base_from_turntable, np.array(placement.origin_mm)
        base_from_cloud = np.eye(4) if table is None or placement.held else table.matrix
        against = Compared()
        if not has_error(mistakes):
            against = compared(given, solution, plan.options.voxel_mm, base_from_cloud, origin_mm)
        result = _result(given, plan, solution, mistakes, against)
        if given.store is not None:
            given.store(CLOUD_FILE, _cloud_pieces(solution, _numbers(plan, result), origin_mm, plan.options))
            if solution.mesh is not None:
                corners_mm = _in_place(solution.mesh.points_mm, origin_mm)
                given.store(MESH_FILE, ply_pieces(corners_mm, triangles=solution.mesh.triangles))
    return result


@contextmanager
def _crew(given: StageInput, options: MergeOptions) -> Generator[Crew]:
    """Give who does the work: those that the caller has, else this process, with a file for what memory lacks."""
    if given.crew is not None:
        with given.crew(options) as crew:
            yield crew
        return
    with FileSpill() as spill:
        yield Alone(options, spill)


@dataclass(frozen=True, eq=False)
class MergePlan:
    """What is to be merged: scans that are read when they are asked for, where they belong, and how well."""

    groups: list[ScanGroup]
    calibration: Calibration
    scans: SessionScans
    errors: PoseErrors | None
    options: MergeOptions
    unused: dict[str, str]
    unfit: tuple[Finding, ...] = ()
    ball: Literal[1, -1] | None = None


def plan_merge(given: StageInput) -> MergePlan:
    """Return the scans to be merged, after solving the calibration; raises as `solve` does."""
    captures = [capture for capture in given.captures if not capture.excluded]
    if not captures:
        to_do = "Scan the object from around."
        raise InputError("captures with step 'scan'", "none that is not excluded", to_do, "captures")
    found = unfit(given.session.cell, captures)
    calibration = calibration_of_session(
        given, with_table=any(capture.table_deg is not None for capture in captures)
    )
    found += not_placed(calibration.placement, given.session.cell, captures, reasons_of(found))
    unused = reasons_of(found)
    fit = [capture for capture in captures if capture.id not in unused]
    if not np.array_equal(calibration.placement.mount_from_laser.matrix, np.eye(4)):  # else no robot's poses
        require_unit(given.session.cell, fit)
    groups = scan_groups(corrected_captures(given.session.cell, fit, calibration.arm))
    settings = given.session.cell.merge
    scans = SessionScans(given.session, groups, calibration.placement, given.read)
    spread = {len(scans) * part // _LOOKED_AT for part in range(_LOOKED_AT)} if len(scans) else set[int]()
    first = [scans[number] for number in sorted(spread)]
    spacing_mm = _spacing_mm(first)
    voxel_mm = settings.voxel_mm or _voxel_mm(spacing_mm)
    options = MergeOptions(
        voxel_mm,
        settings.mesh,
        settings.holes == "fill",
        settings.mesh_tolerance_mm,
        settings.registration,
        settings.self_calibration,
        patch_mm=max(PATCH_VOXELS * voxel_mm, PATCH_SPACINGS * spacing_mm),
        most_bytes=int(1e6 * settings.memory_mb),
        intensity=any(scan.intensity is not None for scan in first),
    )
    origin_mm = _origin_mm(first, calibration.placement)
    if any(origin_mm):
        calibration = replace(calibration, placement=replace(calibration.placement, origin_mm=origin_mm))
        scans = SessionScans(given.session, groups, calibration.placement, given.read)
    errors = pose_errors(given, groups, calibration) if calibration.tells_scatter else None
    ball = None if calibration.by == "known" else side_of_ball(given.session, given.read)
    return MergePlan(groups, calibration, scans, errors, options, unused, tuple(found), ball)


def _spacing_mm(scans: Sequence[Scan]) -> float:
    """Return how far points of scans lie apart, in the mean over the points.

    A scan that hardly sees the part, its edge or a face at a grazing angle, has few points, far apart: patches as
    large as that would take both sides of a thin part together.  One in metres has a thousandth of the others'.
    """
    counts = np.array([np.isfinite(scan.points_in_laser_mm[..., 2]).sum() for scan in scans], dtype=float)
    spacings = np.array([scan.spacing_mm for scan in scans])
    counts[spacings < _IN_METRES * spacings.max(initial=0.0)] = 0.0
    return float(np.average(spacings, weights=counts)) if counts.any() else 0.0


def _voxel_mm(spacing_mm: float) -> float:
    """Return the voxels of a merge for which nobody told any: coarse scans would leave most of them empty."""
    return _USUAL_VOXEL_MM if spacing_mm < _COARSE * _USUAL_VOXEL_MM else float(f"{spacing_mm:.1g}")


def _origin_mm(scans: Sequence[Scan], placement: Placement) -> tuple[float, float, float]:
    """Return where in base the scans are merged about: 0 unless the first of them with points lies far from it."""
    for scan in scans if placement.base_from_turntable is None else ():
        known = scan.points_in_laser_mm[np.isfinite(scan.points_in_laser_mm).all(axis=2)]
        way = scan.turntable_from_laser[len(scan.turntable_from_laser) // 2]
        if len(known):
            return local_origin_mm(known @ way[:3, :3].T + way[:3, 3])
    return (0.0, 0.0, 0.0)


def _in_place(points_mm: NDArray[np.float32], origin_mm: FloatArray) -> NDArray[np.floating]:
    """Return points in base, in double precision where single would not hold them."""
    return points_mm + origin_mm if origin_mm.any() else points_mm


def _numbers(plan: MergePlan, result: MergeResult) -> dict[str, int]:
    """Return each scan's number in the cloud by its name: the place of its first capture among those merged."""
    numbers = {capture: number for number, capture in enumerate(result.scan_names)}
    return {g.name: numbers[first] for g in plan.groups if (first := g.captures[0].id) in numbers}


def _cloud_pieces(
    solution: MergeSolution, numbered: Mapping[str, int], origin_mm: FloatArray, options: MergeOptions
) -> Pieces:
    heaviest = HeaviestScans(solution.patches)
    numbers = np.array([numbered[name] for name in solution.patches.names] + [NO_SCAN])
    names = ("x", "y", "z", "nx", "ny", "nz", "sigma", SCAN_COLUMN, *([INTENSITY] if options.intensity else []))
    tables = (
        np.column_stack(
            [
                _in_place(cloud.points_mm, origin_mm),
                np.nan_to_num(cloud.normals),
                cloud.sigma_mm,
                numbers[heaviest.of(cloud.points_mm)],
                *([cloud.intensity] if options.intensity else []),
            ]
        )
        for cloud in solution.grid.clouds()
    )
    return ply_pieces_of(tables, solution.extent.points, names)


def _mistakes(given: StageInput, plan: MergePlan) -> Mistakes:
    known = given.session.cell.known.base_from_turntable is not None
    return Mistakes(given.session, plan.groups, plan.calibration.placement, plan.scans, known)


def has_error(findings: Sequence[Finding]) -> bool:
    """Return whether one of them makes it a merge that is none."""
    return any(finding.severity == "error" for finding in findings)


def _result(
    given: StageInput, plan: MergePlan, solution: MergeSolution, mistakes: Sequence[Finding], against: Compared
) -> MergeResult:
    apart, calibration = solution.overlap, plan.calibration
    findings = [
        *calibration.findings,
        *mistakes,
        *([codes.NO_MESH(why=solution.no_mesh)] if solution.no_mesh else []),
        *_no_selfcalibration_of_session(given, solution),
        *plan.unfit,
        *merge_doubts(solution, mistakes),
        *_about_scatter(solution.looked.scatter),
        *against.findings,
    ]
    held = calibration.placement.held
    registered, table = solution.registration, None if held else calibration.placement.base_from_turntable
    return MergeResult(
        method=_METHODS["registered" if registered else "moved" if solution.self_calibration else "plain"],
        software=SOFTWARE,
        inputs_sha256=given.inputs_sha256,
        **judgement(findings),
        frame="tool0" if held else "base" if table is None else "turntable",
        cloud=CLOUD_FILE,
        with_intensity=plan.options.intensity,
        points=solution.extent.points,
        scanned_points=sum(counts.points for counts in solution.counts.values()),
        voxel_mm=plan.options.voxel_mm,
        spills=solution.grid.spills,
        overlap_rms_mm=_number(apart.rms_mm),
        expected_overlap_rms_mm=_number(apart.expected_rms_mm),
        overlap_expected_mm=_number(apart.expected_rms_mm),
        normals_outward=solution.looked.outward.how,
        facing=_facing(solution.looked.outward),
        pose_scatter=_scatter(solution.looked.scatter),
        overlap_pairs=apart.pairs,
        registered_overlap_rms_mm=_number(registered.after.rms_mm) if registered else None,
        registration_shift_rms_mm=float(np.sqrt(np.mean(registered.shift_mm**2))) if registered else None,
        self_calibration=shared_shift(calibration, solution.self_calibration),
        surface_sigma_mm=solution.surface_sigma_mm if solution.surface_sigma_mm < FAR_MM else None,
        calibrated_by=calibration.by,
        **told_by(calibration.placement.mount_from_laser),
        base_from_turntable=None if table is None else table.to_rows(),
        mesh=MESH_FILE if solution.mesh else None,
        triangles=len(solution.mesh.triangles) if solution.mesh else 0,
        mesh_open_edges=open_edges(solution.mesh.triangles) if solution.mesh else None,
        low_mm=(solution.extent.low_mm + calibration.placement.origin_mm).tolist(),
        high_mm=(solution.extent.high_mm + calibration.placement.origin_mm).tolist(),
        alignment=against.alignment,
        deviation=against.deviation,
        residuals=_rows(given, plan, solution),
    )


def _facing(found: Outward) -> Facing:
    swap = found.sign < 0
    return Facing(
        certain=found.certain,
        before=found.behind if swap else found.before,
        behind=found.before if swap else found.behind,
        volume=_number(found.sign * found.volume),
        missing=found.missing,
    )


def _scatter(found: Scatter | None) -> PoseScatter | None:
    if found is None:
        return None
    return PoseScatter(
        position_sigma_mm=found.position_sigma_mm,
        orientation_sigma_deg=float(np.rad2deg(found.turn_sigma_rad)),
        surface_sigma_mm=found.surface_sigma_mm,
    )


def _about_scatter(found: Scatter | None) -> list[Finding]:
    if found is None:
        return []
    return [
        codes.SCATTER_OF_POSES(
            position_sigma_mm=found.position_sigma_mm,
            orientation_sigma_deg=float(np.rad2deg(found.turn_sigma_rad)),
        )
    ]


def _no_selfcalibration_of_session(given: StageInput, solution: MergeSolution) -> list[Finding]:
    if not given.session.cell.merge.self_calibration or solution.self_calibration is not None:
        return []
    return [codes.NO_SELF_CALIBRATION()]


def _rows(given: StageInput, plan: MergePlan, solution: MergeSolution) -> list[MergeResidual]:
    rows: dict[str, MergeResidual] = {}
    for group in plan.groups:
        row = _row(group.name, solution)
        if row.used:
            row = row.model_copy(update={"cloud_from_laser": _place(given, plan, solution, group)})
        for number, capture in enumerate(
            group.captures
        ):  # figures of a scan of many captures stand with the first
            own = {"capture": capture.id, "used": row.used, "reason": row.reason}
            rows[capture.id] = row.model_copy(update=own) if number == 0 else MergeResidual.model_validate(own)
    for capture in given.captures:
        reason = "excluded by the user" if capture.excluded else plan.unused.get(capture.id)
        if reason is not None:
            rows[capture.id] = MergeResidual(capture=capture.id, used=False, reason=reason)
    return [rows[capture.id] for capture in given.captures]


def _place(given: StageInput, plan: MergePlan, solution: MergeSolution, group: ScanGroup) -> list[list[float]]:
    """Return where the scanner stood in the middle of a scan, as rows of a 4×4 into the stored cloud's frame."""
    placement = plan.calibration.placement
    pairs = poses_of(given.session, group, placement)
    capture, pose = pairs[len(pairs) // 2]
    place = placement.way(capture, pose).matrix.copy()
    moved = solution.registration or solution.self_calibration
    if moved is not None:
        place = moved.turntable_from_scan[solution.used.index(group.name)] @ place
    place[:3, 3] += placement.origin_mm
    return place.tolist()


def _row(name: str, solution: MergeSolution) -> MergeResidual:
    if name in solution.failed:
        error = solution.failed[name]
        return MergeResidual(
            capture=name, used=False, reason=message("need {need}, got {got}", need=error.need, got=error.got)
        )
    number = solution.used.index(name)
    pairs, mean, rms, expected = solution.overlap.per_scan[number].tolist()
    counts = solution.counts[name]
    moved = solution.registration
    return MergeResidual(
        capture=name,
        used=True,
        points=counts.points,
        kept=counts.kept,
        stray=counts.removed["stray"],
        mixed=counts.removed["mixed"],
        grazing=counts.removed["grazing"],
        overlap_pairs=int(pairs),
        overlap_mean_mm=_number(mean),
        overlap_rms_mm=_number(rms),
        expected_overlap_rms_mm=_number(expected),
        shift_mm=float(moved.shift_mm[number]) if moved else None,
        turn_deg=float(np.rad2deg(moved.turn_rad[number])) if moved else None,
    )


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
