"""Whether a turntable can be trusted: everything that is noticed of a solution, as findings."""

from collections.abc import Container, Sequence
from dataclasses import replace

import numpy as np

from calib_core.causes.table import axis_direction_findings, direction_findings
from calib_core.cell.carriers import carrier_of_all
from calib_core.chain.mirrored import MirrorImage
from calib_core.chain.observations import TableObservations, named
from calib_core.chain.table_frame import TableCovariance
from calib_core.chain.table_reasons import remounted, table_reasons
from calib_core.chain.turntable import TurntableSolution
from calib_core.findings import Finding
from calib_core.findings.codes import turntable as codes
from calib_core.findings.codes.placed_scanners import SCANNER_MOVE_NOT_CHECKED
from calib_core.frames import FloatArray, skew
from calib_core.messages import message
from calib_core.records import Capture, Cell, Undetermined
from calib_core.stages.axes_found import encoder_findings
from calib_core.stages.tcp.verdict import is_beyond

_UNDETERMINED_RAD = np.deg2rad(0.5)
_UNDETERMINED_MM = 3.0
_MIRRORED_CHANCE = 0.01
_WEAK_RAD = np.deg2rad(0.1)
_MOST_REJECTED = 1 / 3
_ONE_HEIGHT_MM = 20.0
_LARGE_ANGLE_RAD = np.deg2rad(0.05)
_HOPELESS_MM = 5.0
_MUCH_LIKELIER = float(np.log(1e6))


def table_findings(
    table: TurntableSolution, observations: TableObservations, cell: Cell, known_in: str = "base"
) -> list[Finding]:
    """Return what is noticed of a turntable: root causes first, and not what follows from them.

    `known_in`: "base", "axis" where the cell names its axes, or "scanner" where nothing ties it to base.
    """
    failures = [*_undetermined(table, known_in), *_failures(table, observations)]
    found = [*failures, *_doubts_about_captures(table, observations), *direction_findings(cell, table.frame)]
    found += axis_direction_findings(cell, table.state)
    if not failures:
        found += [*_doubts_about_axis(table), *_doubts_about_encoder(table)]
    return found


def _undetermined(table: TurntableSolution, known_in: str) -> list[Finding]:
    sure = _without_mirror(table)
    tilts, shifts = _open_tilts(sure), _open_shifts(sure)
    found: list[Finding] = []
    if image := _mirrored(table):
        lean_deg, told_by = float(np.rad2deg(image.lean_rad)), known_in if image.by_sense else "side"
        found.append(codes.AXIS_MIRRORED(lean_deg=lean_deg, apart_mm=image.apart_mm, known_in=told_by))
    if tilts:
        axes = ", ".join(f"{_words(axis)} (±{_degrees(value)})" for value, axis in tilts)
        found.append(codes.AXIS_TILT_OPEN(axes=axes, uncertainty_deg=_two_sigma_deg(tilts[-1][0])))
    if shifts:
        axes = ", ".join(f"{_words(axis)} (±{2 * np.sqrt(value):.1f} mm)" for value, axis in shifts)
        found.append(codes.AXIS_PLACE_OPEN(axes=axes, uncertainty_mm=float(2 * np.sqrt(shifts[-1][0]))))
    return found


def _without_mirror(table: TurntableSolution) -> TableCovariance:
    """Return the covariance without what the mirrored answer adds to it: that is said by itself."""
    if (mirror := table.mirror) is None:
        return table.covariance
    own = table.covariance
    return replace(
        own,
        axis_direction=own.axis_direction - mirror.axis_direction,
        axis_point=own.axis_point - mirror.axis_point,
    )


def _mirrored(table: TurntableSolution) -> MirrorImage | None:
    """Return the mirrored answer where it is to be reckoned with and is another one."""
    image = table.image
    if image is None or image.chance < _MIRRORED_CHANCE:
        return None
    return image if image.lean_rad > _UNDETERMINED_RAD or image.apart_mm > _UNDETERMINED_MM else None


def _open_tilts(covariance: TableCovariance) -> list[tuple[float, FloatArray]]:
    values, vectors = np.linalg.eigh(covariance.axis_direction)
    return [(float(v), axis) for v, axis in zip(values, vectors.T, strict=True) if v > _UNDETERMINED_RAD**2]


def _open_shifts(covariance: TableCovariance) -> list[tuple[float, FloatArray]]:
    values, vectors = np.linalg.eigh(covariance.axis_point)
    return [(float(v), axis) for v, axis in zip(values, vectors.T, strict=True) if v > _UNDETERMINED_MM**2]


def undetermined_of_table(table: TurntableSolution) -> list[Undetermined]:
    """Return the directions in which the axis is not fixed: tilts beyond 0.5°, shifts beyond 3 mm."""
    found: list[Undetermined] = []
    covariance = _without_mirror(table)
    if table.mirror is not None and (image := _mirrored(table)):
        leans = image.lean_rad > _UNDETERMINED_RAD
        off = np.linalg.eigh(table.mirror.axis_direction if leans else table.mirror.axis_point)[1][:, -1]
        said = message(
            "the axis may be its mirror image at the plane of light: tell in which sense its readings count, or "
            "the side of one capture"
        )
        if not image.by_sense:
            said = message("the axis may be its mirror image at the plane of light: tell the side of one capture")
        found.append(Undetermined(direction=off.tolist(), description=str(said)))
    for value, axis in _open_tilts(covariance):
        said = message(
            "the axis may lean towards {axis} (±{tilt}): capture the sphere all around, well off the axis and at "
            "two heights",
            axis=_words(axis),
            tilt=_degrees(value),
        )
        found.append(Undetermined(direction=axis.tolist(), description=str(said)))
    for value, axis in _open_shifts(covariance):
        said = message(
            "the axis may lie further along {axis} (±{shift_mm:.1f} mm): capture the sphere all around, well off "
            "the axis and at two heights",
            axis=_words(axis),
            shift_mm=float(2 * np.sqrt(value)),
        )
        found.append(Undetermined(direction=axis.tolist(), description=str(said)))
    return found


def _failures(table: TurntableSolution, observations: TableObservations) -> list[Finding]:
    found: list[Finding] = []
    rejected, count = int(np.count_nonzero(~table.used)), len(table.captures)
    if rejected > _MOST_REJECTED * count:
        each, names = table_reasons(observations, table), named(table.captures, table.used)
        found.append(codes.MANY_CONTRADICT(list(each), each=each, rejected=rejected, count=count, names=names))
    return [*found, *angles_that_do_not_fit(table)]


def angles_that_do_not_fit(
    table: TurntableSolution, tool_sigma_mm: float = 0.0, otherwise_mm: float | None = None
) -> list[Finding]:
    """Return the finding where spheres lie farther off their circles than a tool within three sigmas explains.

    Or, on a circle however small, where angles read otherwise, which leave them `otherwise_mm` off (RMS), are a
    million times likelier: a normal density's two numbers across each circle.
    """
    scatter = float(np.sqrt(np.mean(table.residuals.distance_mm[table.used] ** 2)))
    log_odds = 0.0 if otherwise_mm is None else 2 * table.used.sum() * float(np.log(scatter / otherwise_mm))
    if scatter <= max(_HOPELESS_MM, 3 * tool_sigma_mm) and log_odds <= _MUCH_LIKELIER:
        return []
    axis = _worst_axis(table)
    return [codes.ANGLES_DO_NOT_FIT(scatter_mm=scatter, of="several" if axis else "one", axis=axis)]


def _worst_axis(table: TurntableSolution) -> str:
    """Return the name of the axis whose balls lie farthest off, where several carry some; else nothing."""
    walk, off = table.state.walk, table.residuals.distance_mm
    place = walk.place[-len(off) :]
    scatter: dict[str, float] = {}
    for axis in walk.layout.carrying:
        own = table.used & walk.layout.rides[place, axis]
        scatter[walk.layout.named(axis)] = float(np.mean(off[own] ** 2)) if own.any() else 0.0
    return max(scatter, key=lambda name: scatter[name], default="")


def _doubts_about_captures(table: TurntableSolution, observations: TableObservations) -> list[Finding]:
    tool = table.tool_move.finding if table.tool_move else None
    moved = table.move.finding(table.captures) if table.move else None
    found = [finding for finding in (moved, tool, remounted(observations, table)) if finding]
    if 0 < np.count_nonzero(~table.used) <= _MOST_REJECTED * len(table.captures):
        each, names = table_reasons(observations, table), named(table.captures, table.used)
        found.append(codes.CAPTURES_CONTRADICT(list(each), each=each, names=names))
    scatter_mm, told_mm = table.sigmas.largest_position_mm, table.options.position_sigma_mm
    handled = "enlarged" if table.excess > 1 else "held"
    if table.excess > 1 or scatters_by_table(table):
        found.append(
            codes.TABLE_SCATTER_BEYOND_TOLD(
                handled=handled, scatter_mm=scatter_mm, told_mm=told_mm or 0.0, times=float(np.sqrt(table.excess))
            )
        )
    return found


def scanner_move_not_checked(captures: Sequence[Capture], still: Container[str]) -> list[Finding]:
    """Return that nothing shows whether scanners that stand still moved before the table was captured."""
    own = [capture.step for capture in captures if not capture.excluded and (capture.scanner or "") in still]
    at_rest = [place for place, step in enumerate(own) if step == "tcp"]
    on_table = [place for place, step in enumerate(own) if step == "turntable"]
    around = bool(at_rest and on_table) and at_rest[0] < on_table[0] and at_rest[-1] > on_table[-1]
    if not at_rest or around:
        return []
    return [SCANNER_MOVE_NOT_CHECKED()]


def scatters_by_table(table: TurntableSolution) -> bool:
    """Return whether captures of the table scatter more than is told of the robot, and than the arm explains."""
    told_mm = table.options.position_sigma_mm
    return told_mm is not None and is_beyond(table.sigmas.largest_position_mm, max(told_mm, table.by_arm_mm))


def _doubts_about_axis(table: TurntableSolution) -> list[Finding]:
    found: list[Finding] = []
    values, vectors = np.linalg.eigh(table.covariance.axis_direction)
    weakest, tilt_deg = _words(vectors[:, -1]), _two_sigma_deg(values[-1])
    if table.options.angles_unknown:
        place_mm = float(2 * np.sqrt(np.trace(table.covariance.axis_point)))
        direction = "told" if table.options.direction else "open"
        found.append(
            codes.ANGLES_NOT_READ(weakest=weakest, tilt_deg=tilt_deg, place_mm=place_mm, direction=direction)
        )
    if not table.turns:
        return found
    weak = _largest_tilt_of_table(table) > _WEAK_RAD**2
    low = np.ptp(table.frame.mounts_mm[:, 2]) < _ONE_HEIGHT_MM and not table.tilted
    if low and (weak or table.state.walk.over_robot[_on_it(table)].any()):
        found.append(codes.ONE_HEIGHT(weakest=weakest, tilt_deg=tilt_deg, scanners=_scanners(table)))
    elif weak:
        found.append(codes.AXIS_WEAK(weakest=weakest, tilt_deg=tilt_deg))
    return found


def _largest_tilt_of_table(table: TurntableSolution) -> float:
    """Return the variance of the axis's direction where it is weakest, rad².

    Where the one scanner that sees the sphere stands still: as that scanner sees it.  How it is turned in base no
    capture of the table tells, and none more would.
    """
    walk, at, layout = table.state.walk, table.state.position, table.state.walk.layout
    on_it = _on_it(table)
    seeing = np.unique(walk.scanner[on_it])
    if len(seeing) > 1 or walk.over_robot[on_it].any():
        return float(np.linalg.eigvalsh(table.covariance.axis_direction)[-1])
    laser_from_base, axis = at.mount_rotations[seeing[0]].T, at.axes[layout.table].rotation
    turned = np.hstack([skew(laser_from_base @ axis[:, 2]), laser_from_base @ axis @ -skew(np.eye(3)[2])[:, :2]])
    every = np.arange(layout.unknowns)
    columns = np.append(every[layout.mount(int(seeing[0]))][:3], every[layout.axis(layout.table)][:2])
    return float(np.linalg.eigvalsh(turned @ table.unknowns_covariance[np.ix_(columns, columns)] @ turned.T)[-1])


def _scanners(table: TurntableSolution) -> str:
    """Return whether the flange carries a scanner that sees the table's sphere, or all of them stand still."""
    walk = table.state.walk
    return carrier_of_all(walk.layout.mounts[n][1] for n in walk.scanner[_on_it(table)].tolist())


def _on_it(table: TurntableSolution) -> np.ndarray:
    """Return which captures see the table's sphere, (K,)."""
    walk = table.state.walk
    return np.isin(walk.place, walk.layout.on_axis(walk.layout.table))


def _doubts_about_encoder(table: TurntableSolution) -> list[Finding]:
    found = [table.pattern.finding] if table.pattern else []
    found += encoder_findings(table.encoders, table.state.walk.layout, table.options.scale_asked)
    if (
        table.pattern is None
        and table.move is None
        and not table.options.axes
        and table.options.angle_sigma_rad is None
        and table.sigmas.angle_rad > _LARGE_ANGLE_RAD
    ):
        found.append(codes.ANGLES_SCATTER(scatter_deg=float(np.rad2deg(table.sigmas.angle_rad))))
    return found


def _two_sigma_deg(variance: float) -> float:
    return float(np.rad2deg(2 * np.sqrt(variance)))


def _degrees(variance: float) -> str:
    return f"{_two_sigma_deg(variance):.3f}°"


def _words(direction: FloatArray) -> str:
    signed = direction * np.sign(direction[np.argmax(np.abs(direction))])
    largest = int(np.argmax(np.abs(signed)))
    if signed[largest] > np.cos(np.deg2rad(15)):
        return message("base {value}", value="xyz"[largest])
    return message(
        "base ({signed:.2f}, {signed_other:.2f}, {signed_2:.2f})",
        signed=signed[0],
        signed_other=signed[1],
        signed_2=signed[2],
    )
