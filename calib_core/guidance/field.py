"""The error budget as a field over the table: what one scan, and any number of them, know of a point anywhere."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from calib_core.evidence.numbers import COVERAGE
from calib_core.frames import FloatArray, skew
from calib_core.guidance.budget import (
    arm_at_points,
    arm_growth_at_points,
    calibrated_rows,
    covariances,
    turned_back,
)
from calib_core.guidance.calibrated import Calibrated, View
from calib_core.records import Record

_RINGS, _AROUND, _LAYERS = 4, 8, 3
_LEAST_RADIUS_MM, _LEAST_HEIGHT_MM = 50.0, 50.0


class FieldPoint(Record):
    """± (k = 2) of one scan at a point of T, mm, and what any number of scans leaves."""

    point_mm: list[float]
    uncertainty_mm: float
    shared_uncertainty_mm: float


def field_over_table(known: Calibrated, views: Sequence[View], result: Mapping[str, Any]) -> list[FieldPoint]:
    """Return the budget's ± at points all over the table of a chain's result, JSON data."""
    points = grid_over_table(result)
    total, shared = at_points(known, views, points)
    worst = zip(points.tolist(), _uncertainty_mm(total), _uncertainty_mm(shared), strict=True)
    return [FieldPoint(point_mm=p, uncertainty_mm=one, shared_uncertainty_mm=many) for p, one, many in worst]


def at_points(known: Calibrated, views: Sequence[View], points_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the covariances (P, 3, 3), mm², of points (P, 3) of T: of one scan, the mean over views, and of many.

    Of a point p only the table's turning knows: what moves it is rows(0) + [p]× · D of each view, so that its mean
    covariance is a polynomial in p whose coefficients are those of all points.
    """
    many = len(known.covariance)
    count = 12 + len(known.nuisances)
    at_axis, by_lever, twice = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    moves = known.moves_by_optics
    for view in views:
        rows, _ = calibrated_rows(known, view, np.zeros(3))
        turned = np.zeros((3, many))
        turned[:, 6:9] = turned_back(known.direction * view.angle_rad)
        turned[:, count:] = turned[:, 6:9] @ moves[6:9]
        at_axis += rows @ known.covariance @ rows.T / len(views)
        by_lever += turned @ known.covariance @ rows.T / len(views)
        twice += turned @ known.covariance @ turned.T / len(views)
    parts = [covariances(known, view, np.zeros(3)) for view in views]
    arm, noise = (np.mean([p[name] for p in parts], axis=0) for name in ("arm", "points"))
    by_arm = [arm_at_points(known, view, points_mm) for view in views]
    alike = np.mean([own + cancelled for own, cancelled in by_arm], axis=0)
    if known.arm_growth:
        alike = alike + np.mean([arm_growth_at_points(known, view, points_mm) for view in views], axis=0)
    crossed = np.array([skew(point) for point in points_mm])
    leaning = crossed @ by_lever
    shared = at_axis + leaning + np.swapaxes(leaning, 1, 2) + crossed @ twice @ np.swapaxes(crossed, 1, 2) + alike
    lever = crossed[:, :, 2]  # what an error of the table's angle moves
    angle = known.sigmas.angle_rad**2 * lever[:, :, None] * lever[:, None, :]
    return shared + arm + noise + angle, shared


def _uncertainty_mm(covariance: FloatArray) -> list[float]:
    return (COVERAGE * np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[:, -1], 0.0))).tolist()


def grid_over_table(result: Mapping[str, Any]) -> FloatArray:
    """Return points (P, 3) of T over the table: as far out and high as the sphere stood, and somewhat beyond."""
    places = np.array([mount["center_in_turntable_mm"] for mount in result["mounts"]], dtype=float)
    radius = max(1.25 * float(np.hypot(places[:, 0], places[:, 1]).max()), _LEAST_RADIUS_MM)
    low, high = float(places[:, 2].min()), float(places[:, 2].max())
    high = max(high, low + _LEAST_HEIGHT_MM)
    points: list[list[float]] = []
    for z in np.linspace(low, high, _LAYERS):
        points.append([0.0, 0.0, float(z)])
        for ring in np.linspace(0.0, radius, _RINGS + 1)[1:]:
            angles = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)
            points += [[float(ring * np.cos(a)), float(ring * np.sin(a)), float(z)] for a in angles]
    return np.array(points)
