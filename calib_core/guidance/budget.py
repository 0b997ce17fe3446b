"""The error budget of a measured point: what tool, scanner, table, arm and noise each put into it, in mm.

A point p of L, measured from pose k with the table at angle θ, comes out in T at

    Rz(−θ) · base_from_turntable⁻¹ · base_from_tool0(k) · mount_from_laser · p.

Tool, table and scanner are what was calibrated: their errors are alike in every scan, and partly cancel, because
the same captures gave them.  What the arm does alike where poses are alike it did to these too, so that part of
it cancels as well (`arm_share`).  Errors of a pose, of the table's angle and of a point are new in each scan:
the mean of many scans knows less of them.
"""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from calib_core.chain.chain_data import Sigmas
from calib_core.chain.held import point_rows
from calib_core.chain.noise import pose_spread
from calib_core.evidence.numbers import COVERAGE, plus_minus, quantity_text
from calib_core.frames import FloatArray, rotation_from_vector, skew
from calib_core.guidance.calibrated import Calibrated, View
from calib_core.messages import message
from calib_core.records import Record

PartName = Literal[
    "tool", "scanner", "camera", "plane", "table", "arm", "arm_alike", "temperature", "angle", "points"
]

_HELPS: Mapping[str, str] = {
    "tool": "more captures for the tool where the guide proposes them",
    "scanner": "a sphere whose diameter is better known, and captures over the whole field of the scanner",
    "camera": "more boards for the camera, over its whole field and depth",
    "plane": "more boards with the stripe, near and far",
    "table": "more angles and a second height of the sphere on the table",
    "arm": "averaging several scans from poses that differ: the arm's own scatter is alike in none",
    "arm_alike": "the arm's own calibration: its errors are alike where poses are alike",
    "temperature": "calibrating and scanning with the arm at one temperature, warmed up",
    "angle": "a better encoder, or scans at several angles",
    "points": "filtering or more points: their noise averages out",
}


class BudgetPart(Record):
    """What one source puts into a measured point: standard deviations, RMS of the axes and in the worst direction.

    `shared` is the same in every scan; what is not, averages out over scans.
    """

    name: PartName
    sigma_mm: float
    worst_sigma_mm: float
    shared: bool


class Budget(Record):
    """The error budget at a point of the workpiece, in T with a table, else of L along the flange's axes.

    `uncertainty_mm` is k = 2 in the worst direction for one scan, `shared_uncertainty_mm` what any number of
    scans leaves. The parts do not add up in squares: tool, scanner and table were found together, and
    `cancelled_mm` (RMS of the axes) is what their errors take off each other, negative where they add: with what
    the arm does alike where poses are alike, where the result says how that is in them. `sigmas_mm` are along
    the axes of the frame of `point_mm`. `known_offset_mm` is where a point lies off for errors of the scanner
    that were found and stay in its files, mean over the views; within ± `within_95_mm` of a measured point the
    true one lies with 95 %, axis by axis: less than 1.96 sigmas where much of them is a known offset.
    """

    frame: Literal["turntable", "laser"]
    point_mm: list[float]
    sigmas_mm: list[float]
    known_offset_mm: list[float]
    within_95_mm: list[float]
    uncertainty_mm: float
    shared_uncertainty_mm: float
    cancelled_mm: float
    parts: list[BudgetPart]
    helps_most: str


def calibrated_rows(known: Calibrated, view: View, point_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how a measured point moves with tool, table and scanner, (3, 12 + n), and the axes' turn (3, 3).

    `point_mm` is in T at angle zero; without a table it is not needed. The rows are along T's axes at angle zero,
    without a table along the flange's; the second matrix turns from the flange's axes into these.
    """
    seen, tool = view.seen(known), known.mount_from_laser
    by_flange = point_rows(tool.rotation, seen, known.half_width_mm, known.facing)
    rows = np.zeros((3, len(known.covariance)))
    table = known.base_from_turntable
    out, count = np.eye(3), 12 + len(known.nuisances)
    if table is not None:
        angle = known.direction * view.angle_rad
        cosine, sine = np.cos(angle), np.sin(angle)
        turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        axes = (table.rotation @ turn).T
        out = axes @ view.base_from_mount(known)
        turned = turn @ point_mm
        rows[:, 6:12] = -axes @ np.hstack([-table.rotation @ skew(turned), np.eye(3)])
    rows[:, :6] = out @ by_flange[:, :6]
    rows[:, 12:count] = out @ by_flange[:, 6 + np.array(known.nuisances, dtype=int)]
    # The point moves by its own, and with what they did to tool and table.
    own = [np.array(one.point_mm) + np.array(one.by_place) @ (seen - one.at_mm) for one in known.optics]
    rows[:, count:] = out @ tool.rotation @ np.array(own).reshape(-1, 3).T
    rows[:, count:] += rows[:, :count] @ known.moves_by_optics
    return rows, out


def covariances(known: Calibrated, view: View, point_mm: FloatArray) -> dict[PartName, FloatArray]:
    """Return each source's own covariance (3, 3), mm², of a measured point."""
    rows, out = calibrated_rows(known, view, point_mm)
    seen, tool, sigmas = view.seen(known), known.mount_from_laser, known.sigmas
    # What moves the sphere's centre in L moves a measured point the other way: the same covariance.
    lever = seen + tool.rotation.T @ tool.translation_mm
    own = pose_spread(lever[None], Sigmas(sigmas.position_mm, sigmas.orientation_rad))[0]
    axes = out @ tool.rotation
    found: dict[PartName, FloatArray] = {}
    for name, part in _calibrated_parts(known).items():
        found[name] = rows[:, part] @ known.covariance[np.ix_(part, part)] @ rows[:, part].T
    found["arm"] = axes @ own @ axes.T
    found["arm_alike"] = arm_at_points(known, view, point_mm[None])[0][0]
    if known.arm_growth:
        found["temperature"] = arm_growth_at_points(known, view, point_mm[None])[0]
    if known.base_from_turntable is not None:
        lever = np.array([-point_mm[1], point_mm[0], 0.0])
        found["angle"] = sigmas.angle_rad**2 * np.outer(lever, lever)
    ray = axes[:, 2]
    found["points"] = known.point_sigma_mm**2 * np.outer(ray, ray)
    return found


def _calibrated_parts(known: Calibrated) -> dict[PartName, np.ndarray]:
    """Return which members of the covariance each source of what was calibrated has."""
    last = 12 + len(known.nuisances)
    parts: dict[PartName, np.ndarray] = {
        "tool": np.arange(6),
        "table": np.arange(6, 12),
        "scanner": np.arange(12, last),
    }
    sources = np.array([one.source for one in known.optics])
    for name in _OPTICS:
        if (sources == name).any():
            parts[name] = last + np.flatnonzero(sources == name)
    return parts


_OPTICS: tuple[PartName, ...] = ("camera", "plane")
_HELD, _HALVINGS = 0.95, 30
_TOGETHER: tuple[PartName, ...] = ("tool", "table", "scanner")
_CALIBRATED: frozenset[PartName] = frozenset({*_TOGETHER, *_OPTICS})
_SHARED: frozenset[PartName] = frozenset({*_CALIBRATED, "arm_alike", "temperature"})


def together(known: Calibrated, view: View, point_mm: FloatArray) -> FloatArray:
    """Return the covariance (3, 3) by tool, table, scanner and optics, with what cancels between them."""
    rows, _ = calibrated_rows(known, view, point_mm)
    return rows @ known.covariance @ rows.T


def arm_at_points(known: Calibrated, view: View, points_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what the arm's shared errors put into points (P, 3), by themselves and with what was calibrated.

    Both are to be added, (P, 3, 3), mm². The second is mostly less than nothing: tool and table erred with the
    arm.
    """
    rows, out = calibrated_rows(known, view, np.zeros(3))
    in_base = view.base_from_mount(known) @ known.mount_from_laser.apply(view.seen(known))
    axes = out @ view.base_from_mount(known).T
    shared = Sigmas(known.sigmas.alike_position_mm, known.sigmas.alike_orientation_rad)
    alike = np.broadcast_to(axes @ pose_spread(in_base[None], shared)[0] @ axes.T, (len(points_mm), 3, 3))
    if known.arm is None:
        return alike, np.zeros((len(points_mm), 3, 3))
    places = view.places(known, points_mm)
    own = known.arm.by_lengths(places) + known.arm.by_terms(view.rotation, places, in_base)
    alike = alike + axes @ own @ axes.T
    together = known.arm.with_answer(view.rotation, places, in_base)
    half = rows[:, : together.shape[1]] @ together
    if known.base_from_turntable is not None:  # a turn of the table moves a point by how far it is from the origin
        turned = turned_back(known.direction * view.angle_rad)
        half = half + np.array([skew(point) for point in points_mm]) @ turned @ together[:, 6:9]
    half = half @ axes.T
    return alike, half + np.swapaxes(half, 1, 2)


def corrected_arm_at_point(known: Calibrated, view: View, point_mm: FloatArray) -> FloatArray:
    """Return what an arm whose poses are corrected puts into a point, (3, 3), mm²; nothing of another arm.

    With what tool, table and scanner have swallowed of it: to be added to what these put in, mostly less than
    nothing.
    """
    if known.arm is None or known.arm.terms is None:
        return np.zeros((3, 3))
    own, with_others = arm_at_points(known, view, point_mm[None])
    return np.asarray(own[0] + with_others[0])


def arm_growth_at_points(known: Calibrated, view: View, points_mm: FloatArray) -> FloatArray:
    """Return what an arm puts into points (P, 3) that is longer than it was when calibrated, (P, 3, 3), mm²."""
    _, out = calibrated_rows(known, view, np.zeros(3))
    moved = known.arm_growth * view.places(known, points_mm) @ (out @ view.base_from_mount(known).T).T
    return moved[:, :, None] * moved[:, None, :]


def turned_back(angle_rad: float) -> FloatArray:
    """Return the turn by −angle about z, (3, 3)."""
    return rotation_from_vector(np.array([0.0, 0.0, -angle_rad]))


def stated(known: Calibrated, view: View, point_mm: FloatArray) -> FloatArray:
    """Return the covariance (3, 3), mm², of one measured point from one scan."""
    parts = covariances(known, view, point_mm)
    new = sum((parts[name] for name in parts if name not in _CALIBRATED), np.zeros((3, 3)))
    return together(known, view, point_mm) + new + arm_at_points(known, view, point_mm[None])[1][0]


def known_offset(known: Calibrated, view: View, point_mm: FloatArray) -> FloatArray:
    """Return where a measured point lies off for what is known of the scanner and stays in its files, (3,), mm."""
    if known.left is None:
        return np.zeros(3)
    rows, _ = calibrated_rows(known, view, point_mm)
    return rows[:, : len(known.left)] @ known.left


def within_95(offsets_mm: FloatArray, covariances_mm2: FloatArray) -> FloatArray:
    """Return half the width about measured points that holds the true ones with 95 %, axis by axis, (3,), mm.

    Parameters
    ----------
    offsets_mm, covariances_mm2 : (V, 3), (V, 3, 3)
        Of each view, all alike likely; the offsets' squares are in the covariances.
    """
    from scipy.special import ndtr

    variances = np.diagonal(covariances_mm2, axis1=1, axis2=2)
    sigmas = np.sqrt(np.maximum(variances - offsets_mm**2, 1e-6 * variances + 1e-18))
    low, high = np.zeros(3), np.abs(offsets_mm).max(axis=0) + 3 * sigmas.max(axis=0)
    for _ in range(_HALVINGS):
        half = (low + high) / 2
        held = (ndtr((half - offsets_mm) / sigmas) - ndtr((-half - offsets_mm) / sigmas)).mean(axis=0)
        low, high = np.where(held < _HELD, half, low), np.where(held < _HELD, high, half)
    return high


def budget(known: Calibrated, views: Sequence[View], point_mm: Sequence[float] | None = None) -> Budget:
    """Return the error budget at a point, the mean over scans from some views.

    Parameters
    ----------
    known : Calibrated
    views : sequence of View
        At least one.
    point_mm : (3,), optional
        In T at angle zero; without a table in L, where the scanner sees it.
    """
    on_table = known.base_from_turntable is not None
    point = np.array(known.point_in_laser_mm if point_mm is None else point_mm, dtype=float)
    each = [covariances(known, view, point) for view in views]
    mean: dict[PartName, FloatArray] = {
        name: np.asarray(np.mean([parts[name] for parts in each], axis=0), dtype=float) for name in each[0]
    }
    calibrated = np.mean([together(known, view, point) for view in views], axis=0)
    apart = sum((mean[name] for name in mean if name in _CALIBRATED), np.zeros((3, 3)))
    each_scan = np.array([stated(known, view, point) for view in views])
    total = each_scan.mean(axis=0)
    shared = total - sum((mean[name] for name in mean if name not in _SHARED), np.zeros((3, 3)))
    offsets = np.array([known_offset(known, view, point) for view in views])
    parts = [
        BudgetPart(name=name, sigma_mm=_rms(one), worst_sigma_mm=_worst(one), shared=name in _SHARED)
        for name, one in mean.items()
        if name != "table" or on_table
    ]
    parts.sort(key=lambda part: -part.worst_sigma_mm)
    warm = mean.get("temperature", np.zeros((3, 3)))
    cancelled = float(np.trace(apart + mean["arm_alike"] + warm - shared)) / 3
    return Budget(
        frame="turntable" if on_table else "laser",
        point_mm=point.tolist(),
        sigmas_mm=np.sqrt(np.maximum(np.diag(total), 0.0)).tolist(),
        known_offset_mm=offsets.mean(axis=0).tolist(),
        within_95_mm=within_95(offsets, each_scan).tolist(),
        uncertainty_mm=COVERAGE * _worst(total),
        shared_uncertainty_mm=COVERAGE * _worst(shared),
        cancelled_mm=float(np.sign(cancelled) * np.sqrt(abs(cancelled))),
        parts=parts,
        helps_most=_helps_most(mean, calibrated, total, _by_arm(known, views, point, shared)),
    )


def _by_arm(known: Calibrated, views: Sequence[View], point: FloatArray, shared: FloatArray) -> FloatArray | None:
    """Return by how much less an arm whose shared errors are known would leave."""
    if known.arm is None:
        return None
    explained = known.arm.explained(known.sigmas)
    size = len(explained)
    rows = [calibrated_rows(known, view, point)[0] for view in views]
    left = [r @ known.covariance @ r.T - r[:, :size] @ explained @ r[:, :size].T for r in rows]
    return shared - np.mean(left, axis=0)


def _helps_most(
    mean: Mapping[PartName, FloatArray], calibrated: FloatArray, total: FloatArray, by_arm: FloatArray | None
) -> str:
    """Return what would help most, as a sentence: the source without which least would be left."""
    alone = {name: one for name, one in mean.items() if name not in _TOGETHER}
    optics = sum((mean[name] for name in _OPTICS if name in mean), np.zeros((3, 3)))
    largest = max(_TOGETHER, key=lambda name: float(np.trace(mean[name])))
    without = {name: _worst(total - one) for name, one in alone.items()}
    new = sum((one for name, one in mean.items() if name not in _SHARED), np.zeros((3, 3)))
    without[largest] = _worst(optics + mean["arm_alike"] + mean.get("temperature", 0.0) + new)
    if by_arm is not None:
        without["arm_alike"] = _worst(total - by_arm)
    best = min(without, key=lambda name: without[name])
    return message(
        "What would help most: {helps}. Without it {without} instead of {total} would be left.",
        helps=_HELPS[best],
        without=quantity_text(plus_minus(without[best], "mm")),
        total=quantity_text(plus_minus(_worst(total), "mm")),
    )


def _rms(covariance: FloatArray) -> float:
    return float(np.sqrt(max(float(np.trace(covariance)), 0.0) / 3))


def _worst(covariance: FloatArray) -> float:
    return float(np.sqrt(max(float(np.linalg.eigvalsh(covariance)[-1]), 0.0)))
