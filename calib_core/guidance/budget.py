"""The error budget of a measured point: what tool, scanner, table, arm and noise each put into it, in mm.

A point p of L, measured from pose k with the table at angle θ, comes out in T at

    Rz(−θ) · base_from_turntable⁻¹ · base_from_tool0(k) · tool0_from_laser · p.

Tool, table and scanner are what was calibrated: their errors are alike in every scan, and partly cancel, because
the same captures gave them.  Errors of a pose, of the table's angle and of a point are new in each scan: the mean
of many scans knows less of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from calib_core.chain.held import point_rows
from calib_core.chain.likelihood import pose_spread
from calib_core.chain.model import Sigmas
from calib_core.chain.scanner import NAMES
from calib_core.errors import InputError
from calib_core.evidence.numbers import COVERAGE, plus_minus, quantity_text
from calib_core.frames import FloatArray, RigidTransform, skew
from calib_core.records import Record
from calib_core.records.results import OpticsShift

PartName = Literal["tool", "scanner", "camera", "plane", "table", "arm", "arm_alike", "angle", "points"]

_HELPS: Mapping[str, str] = {
    "tool": "more captures for the tool where the guide proposes them",
    "scanner": "a sphere whose diameter is better known, and captures over the whole field of the scanner",
    "camera": "more boards for the camera, over its whole field and depth",
    "plane": "more boards with the stripe, near and far",
    "table": "more angles and a second height of the sphere on the table",
    "arm": "averaging several scans from poses that differ: the arm's own scatter is alike in none",
    "arm_alike": "the arm's own calibration: its errors are alike where poses are alike",
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
    `cancelled_mm` (RMS of the axes) is what their errors take off each other, negative where they add. `sigmas_mm`
    are along the axes of the frame of `point_mm`.
    """

    frame: Literal["turntable", "laser"]
    point_mm: list[float]
    sigmas_mm: list[float]
    uncertainty_mm: float
    shared_uncertainty_mm: float
    cancelled_mm: float
    parts: list[BudgetPart]
    helps_most: str


@dataclass(frozen=True, eq=False)
class Calibrated:
    """Tool, table and scanner as a result has them, with all their covariances.

    Attributes
    ----------
    tool0_from_laser : RigidTransform
    base_from_turntable : RigidTransform or None
    direction : {1, -1}
        Of the table's angles.
    nuisances : tuple of int
        Which of the scanner's errors the covariance has.
    covariance : (6 + 6 + n + m, …)
        Of tool, table (zero without one), the scanner's errors, and m unit variances of camera and plane of light.
    half_width_mm, facing, point_in_laser_mm
        See `chain.held`; where the scanner sees the workpiece, (3,).
    sigmas : Sigmas
    point_sigma_mm : float
    optics : tuple of OpticsShift
        What those m do; the tool's, table's and scanner's covariances are without them.
    """

    tool0_from_laser: RigidTransform
    base_from_turntable: RigidTransform | None
    direction: int
    nuisances: tuple[int, ...]
    covariance: FloatArray
    half_width_mm: float
    facing: int
    point_in_laser_mm: FloatArray
    sigmas: Sigmas
    point_sigma_mm: float
    optics: tuple[OpticsShift, ...] = ()

    @classmethod
    def of(cls, result: Mapping[str, Any], point_in_laser_mm: Sequence[float] | None = None) -> "Calibrated":
        """Return what a result of `chain` or `tcp` has.

        A result of before the whole chain told how scanner and table are correlated is taken without the scanner.

        Raises
        ------
        InputError
            If its covariances are none, or nothing says where the scanner sees the workpiece.
        """
        scanner: Mapping[str, Any] | None = result.get("scanner")
        found: Mapping[str, Any] = result.get("variance_components") or {}
        table = result.get("base_from_turntable") if result.get("stage") == "chain" else None
        if scanner is None or (table is not None and scanner.get("covariance_with_table") is None):
            scanner = {
                "names": [],
                "covariance": [],
                "covariance_with_tool": [[]] * 6,
                "covariance_with_table": [[]] * 6,
            }
        seen = (result.get("workpiece") or {}).get("point_in_laser_mm")
        point = point_in_laser_mm if point_in_laser_mm is not None else seen
        if point is None:
            where = f"results/{result.get('stage')}.json: workpiece"
            raise InputError("where the scanner sees the workpiece", "nothing", "Solve the session again.", where)
        names = tuple(NAMES.index(name) for name in scanner["names"])
        count = len(names)
        covariance = np.zeros((12 + count, 12 + count))
        covariance[:6, :6] = result["covariance"]
        covariance[12:, 12:] = np.reshape(scanner["covariance"], (count, count))
        covariance[:6, 12:] = scanner["covariance_with_tool"]
        if table is not None:
            covariance[6:12, 6:12] = result["turntable_covariance"]
            covariance[:6, 6:12] = result["cross_covariance"]
            covariance[6:12, 12:] = scanner["covariance_with_table"]
        covariance = np.triu(covariance) + np.triu(covariance, 1).T
        if not np.isfinite(covariance).all():
            raise InputError("covariances of finite numbers", "others", "Solve the session again.")
        optics = tuple(OpticsShift.model_validate(one) for one in result.get("optics") or [])
        covariance = _with_optics_apart(covariance, optics)
        angle = float(np.deg2rad(result.get("angle_sigma_deg") or 0.0))
        return cls(
            tool0_from_laser=RigidTransform.from_rounded(result["tool0_from_laser"], "tool0", "laser"),
            base_from_turntable=None if table is None else RigidTransform.from_rounded(table, "base", "turntable"),
            direction=int(result.get("direction") or 1),
            nuisances=names,
            covariance=covariance,
            half_width_mm=float(scanner.get("half_width_mm") or 1.0),
            facing=int(scanner.get("facing") or 1),
            point_in_laser_mm=np.array(point, dtype=float),
            sigmas=Sigmas(
                found.get("position_sigma_mm") or 0.0,
                found.get("orientation_sigma_rad") or 0.0,
                angle,
                found.get("alike_position_sigma_mm") or 0.0,
                found.get("alike_orientation_sigma_rad") or 0.0,
            ),
            point_sigma_mm=float(found.get("point_sigma_mm") or 0.0),
            optics=optics,
        )

    @property
    def moves_by_optics(self) -> FloatArray:
        """By how much camera's and plane's errors move tool, table and scanner, (12 + n, m)."""
        return _moves_by(self.optics, 12 + len(self.nuisances))


def _moves_by(optics: Sequence[OpticsShift], size: int) -> FloatArray:
    """Return by how much each of camera's and plane's errors moves tool, table and scanner (size), (size, m)."""
    columns = [[*one.tool, *(one.turntable or [0.0] * 6), *one.scanner][:size] for one in optics]
    return np.array(columns, dtype=float).reshape(-1, size).T


def _with_optics_apart(covariance: FloatArray, optics: Sequence[OpticsShift]) -> FloatArray:
    """Return a covariance with the errors of camera and plane of light as members of their own."""
    size, many = len(covariance), len(optics)
    moves = _moves_by(optics, size)
    apart = np.eye(size + many)
    apart[:size, :size] = covariance - moves @ moves.T
    return apart


@dataclass(frozen=True, eq=False)
class View:
    """One scan: the flange's orientation in base (3, 3), the table's angle as read, and where L sees the point."""

    rotation: FloatArray
    angle_rad: float = 0.0
    point_in_laser_mm: FloatArray | None = None


def calibrated_rows(known: Calibrated, view: View, point_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how a measured point moves with tool, table and scanner, (3, 12 + n), and the axes' turn (3, 3).

    `point_mm` is in T at angle zero; without a table it is not needed. The rows are along T's axes at angle zero,
    without a table along the flange's; the second matrix turns from the flange's axes into these.
    """
    seen = known.point_in_laser_mm if view.point_in_laser_mm is None else view.point_in_laser_mm
    tool = known.tool0_from_laser
    by_flange = point_rows(tool.rotation, seen, known.half_width_mm, known.facing)
    rows = np.zeros((3, len(known.covariance)))
    table = known.base_from_turntable
    out, count = np.eye(3), 12 + len(known.nuisances)
    if table is not None:
        angle = known.direction * view.angle_rad
        cosine, sine = np.cos(angle), np.sin(angle)
        turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        axes = (table.rotation @ turn).T
        out = axes @ view.rotation
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
    seen = known.point_in_laser_mm if view.point_in_laser_mm is None else view.point_in_laser_mm
    tool, sigmas = known.tool0_from_laser, known.sigmas
    # What moves the sphere's centre in L moves a measured point the other way: the same covariance.
    in_laser = tool.rotation.T @ tool.translation_mm
    own = pose_spread(seen[None], in_laser, Sigmas(sigmas.position_mm, sigmas.orientation_rad))[0]
    alike = pose_spread(seen[None], in_laser, Sigmas(sigmas.alike_position_mm, sigmas.alike_orientation_rad))[0]
    axes = out @ tool.rotation
    found: dict[PartName, FloatArray] = {}
    for name, part in _calibrated_parts(known).items():
        found[name] = rows[:, part] @ known.covariance[np.ix_(part, part)] @ rows[:, part].T
    found["arm"] = axes @ own @ axes.T
    found["arm_alike"] = axes @ alike @ axes.T
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
_TOGETHER: tuple[PartName, ...] = ("tool", "table", "scanner")
_CALIBRATED: frozenset[PartName] = frozenset({*_TOGETHER, *_OPTICS})
_SHARED: frozenset[PartName] = frozenset({*_CALIBRATED, "arm_alike"})


def together(known: Calibrated, view: View, point_mm: FloatArray) -> FloatArray:
    """Return the covariance (3, 3) by tool, table, scanner and optics, with what cancels between them."""
    rows, _ = calibrated_rows(known, view, point_mm)
    return rows @ known.covariance @ rows.T


def stated(known: Calibrated, view: View, point_mm: FloatArray) -> FloatArray:
    """Return the covariance (3, 3), mm², of one measured point from one scan."""
    parts = covariances(known, view, point_mm)
    new = sum((parts[name] for name in parts if name not in _CALIBRATED), np.zeros((3, 3)))
    return together(known, view, point_mm) + new


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
    total = calibrated + sum((mean[name] for name in mean if name not in _CALIBRATED), np.zeros((3, 3)))
    shared = calibrated + mean["arm_alike"]
    parts = [
        BudgetPart(name=name, sigma_mm=_rms(one), worst_sigma_mm=_worst(one), shared=name in _SHARED)
        for name, one in mean.items()
        if name != "table" or on_table
    ]
    parts.sort(key=lambda part: -part.worst_sigma_mm)
    cancelled = float(np.trace(apart - calibrated)) / 3
    return Budget(
        frame="turntable" if on_table else "laser",
        point_mm=point.tolist(),
        sigmas_mm=np.sqrt(np.maximum(np.diag(total), 0.0)).tolist(),
        uncertainty_mm=COVERAGE * _worst(total),
        shared_uncertainty_mm=COVERAGE * _worst(shared),
        cancelled_mm=float(np.sign(cancelled) * np.sqrt(abs(cancelled))),
        parts=parts,
        helps_most=_helps_most(mean, calibrated, total),
    )


def _helps_most(mean: Mapping[PartName, FloatArray], calibrated: FloatArray, total: FloatArray) -> str:
    """Return what would help most, as a sentence: the source without which least would be left."""
    alone = {name: one for name, one in mean.items() if name not in _TOGETHER}
    optics = sum((mean[name] for name in _OPTICS if name in mean), np.zeros((3, 3)))
    largest = max(_TOGETHER, key=lambda name: float(np.trace(mean[name])))
    without = {name: _worst(total - one) for name, one in alone.items()}
    without[largest] = _worst(total - calibrated + optics)
    best = min(without, key=lambda name: without[name])
    return (
        f"What would help most: {_HELPS[best]}. Without it {quantity_text(plus_minus(without[best], 'mm'))} "
        f"instead of {quantity_text(plus_minus(_worst(total), 'mm'))} would be left."
    )


def _rms(covariance: FloatArray) -> float:
    return float(np.sqrt(max(float(np.trace(covariance)), 0.0) / 3))


def _worst(covariance: FloatArray) -> float:
    return float(np.sqrt(max(float(np.linalg.eigvalsh(covariance)[-1]), 0.0)))
