"""The plane of light in the camera frame, from the stripe's line on several boards.

A line's pixels, as rays, cut the board's plane; the points of all boards lie on the plane n · p = d, d ≥ 0.

The frame L: its y axis is the normal n, its origin is the plane's point nearest to the camera's centre, d · n, its
z axis is the camera's viewing direction laid into the plane (so z grows away from the scanner), x = y × z.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.errors import InputError, MotionError
from calib_core.findings import Finding
from calib_core.findings.codes import laser_plane as codes
from calib_core.frames import FloatArray, RigidTransform
from calib_core.optics.camera_model import CameraModel

if TYPE_CHECKING:
    from calib_core.optics.board_shape import BoardShape

Mask = NDArray[np.bool_]

_TRIALS = 400
_MOST_SCORED = 3000
_STRAY_SIGMAS = 4.0
_LEAST_POINTS_PER_LINE = 12
_BENT_STEPS = 3
_UNSURE_NORMAL_DEG, _OPEN_NORMAL_DEG = 0.1, 2.0


@dataclass(frozen=True, eq=False)
class BoardLine:
    """The stripe's line on one board.

    Parameters
    ----------
    name : str
        The capture's id.
    points_in_camera_mm : (N, 3)
        Where the stripe's rays meet the board's plane.
    sigma_mm : (N,)
        What the stripe centres' own errors make of the points' distances to a plane across the board.
    """

    name: str
    points_in_camera_mm: FloatArray
    sigma_mm: FloatArray
    least: int = _LEAST_POINTS_PER_LINE

    @property
    def is_enough(self) -> bool:
        """Whether it has as many points as a line needs."""
        return len(self.points_in_camera_mm) >= self.least


@dataclass(frozen=True, eq=False)
class PlaneFit:
    """A plane normal · p = distance through the lines of several boards.

    Parameters
    ----------
    normal : (3,)
    distance_mm : float
        Not negative.
    inliers : tuple of (N,) masks, one a line
    line_rms_mm : tuple of float
        RMS distance of each line's points, all of them, from the plane.
    rms_mm : float
        RMS distance of the inliers.
    length_mm, width_mm : float
        Standard deviation of the inliers along and across their main direction; a narrow plane is badly known.
    """

    normal: FloatArray
    distance_mm: float
    inliers: tuple[Mask, ...]
    line_rms_mm: tuple[float, ...]
    rms_mm: float
    length_mm: float
    width_mm: float


def oriented_plane(normal: ArrayLike, distance_mm: float) -> tuple[FloatArray, float]:
    """Return a plane's unit normal and distance with the signs that make the distance not negative.

    Raises
    ------
    InputError
        If the plane is not one, or runs through the camera's centre.
    """
    n = np.array(normal, dtype=float)
    length = float(np.linalg.norm(n))
    if n.shape != (3,) or not np.isfinite([*n, distance_mm]).all() or length < 1e-12:
        raise InputError("a plane's normal of three finite numbers and its distance", str(normal), "Correct it.")
    n, d = n / length, distance_mm / length
    if abs(d) < 1e-6:
        to_do = "Check the plane: such a laser would give the camera no parallax."
        raise InputError("a plane of light beside the camera's centre", "one that runs through it", to_do)
    return (n, d) if d > 0 else (-n, -d)


def camera_from_laser_of(normal: ArrayLike, distance_mm: float) -> RigidTransform:
    """Return the frame L of a plane normal · p = distance, by the rule at the head of this file."""
    n, d = oriented_plane(normal, distance_mm)
    z = _laid_into_plane(n)
    rotation = np.column_stack([np.cross(n, z), n, z])
    return RigidTransform.of(rotation, d * n, "camera", "laser")


def camera_from_laser_covariance(normal: ArrayLike, distance_mm: float, covariance: FloatArray) -> FloatArray:
    """Return the covariance (6, 6) of camera_from_laser for one (4, 4) of normal and distance.

    Order rx ry rz tx ty tz, the rotation perturbing on the right, rad and mm.
    """
    n, d = oriented_plane(normal, distance_mm)
    frame = camera_from_laser_of(n, d)
    step = 1e-6
    jacobian = np.zeros((6, 4))
    for k in range(3):
        change = np.zeros(3)
        change[k] = step
        ahead, behind = camera_from_laser_of(n + change, d), camera_from_laser_of(n - change, d)
        jacobian[:, k] = (frame.difference(ahead) - frame.difference(behind)) / (2 * step)
    # oriented_plane scales d with the normal's length; the covariance has no part along n, so that this cancels.
    jacobian[3:, 3] = n
    return jacobian @ covariance @ jacobian.T


def plane_covariance_from_inverse(q: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the covariance (4, 4) of normal and distance for one (3, 3) of q = normal / distance, 1/mm."""
    length = float(np.linalg.norm(q))
    n = q / length
    jacobian = np.vstack([(np.eye(3) - np.outer(n, n)) / length, -n / length**2])
    return jacobian @ covariance @ jacobian.T


def points_on_board(
    camera: CameraModel, pixels: ArrayLike, camera_from_board: RigidTransform, shape: "BoardShape | None" = None
) -> FloatArray:
    """Return the points (N, 3) of the camera frame where the pixels' rays meet a board, mm."""
    p = np.asarray(pixels, dtype=float).reshape(-1, 2)
    normal = camera_from_board.rotation[:, 2]
    height = float(normal @ camera_from_board.translation_mm)
    if camera.segments:
        camera = camera.with_laser_plane(normal, height)
    rays = np.column_stack([camera.undistort(p), np.ones(len(p))])
    slope, raised = rays @ normal, np.zeros(len(p))
    if shape is not None:
        for _ in range(_BENT_STEPS):
            points = rays * ((height + raised) / slope)[:, None]
            raised = shape.heights_mm(camera_from_board.inverse().apply(points))
    return rays * ((height + raised) / slope)[:, None]


def fit_plane(lines: Sequence[BoardLine], agreeing: Sequence[int] = ()) -> PlaneFit:
    """Fit the plane of light through the lines on several boards, robustly.

    Parameters
    ----------
    lines : sequence of BoardLine
        At least two.
    agreeing : sequence of int
        Places of those that alone lay the plane, because the others would draw it to them; none told: all do.

    Raises
    ------
    MotionError
        If there are fewer than two lines, or they are one and the same line, so that any plane through it fits.
    """
    laying = [lines[i] for i in agreeing] or lines
    usable = [line for line in laying if line.is_enough]
    if len(usable) < 2:
        need = "the stripe on at least two boards, better five at different distances"
        to_do = "Capture the board with the stripe on it at other distances and tilts."
        raise MotionError(need, "{count} with a measurable line on the board", to_do, count=len(usable))
    points = np.concatenate([line.points_in_camera_mm for line in laying])
    sigma = np.concatenate([line.sigma_mm for line in laying])
    normal, distance = _start(usable, np.random.default_rng(0))
    sigma = np.maximum(sigma, max(float(np.median(sigma)), 1e-6))
    weight = np.ones(len(points))
    for _ in range(30):
        before = normal
        normal, distance = _weighted_plane(points, weight / sigma**2)
        residual = points @ normal - distance
        scale = 1.4826 * float(np.median(np.abs(residual))) + 1e-9
        weight = np.clip(1.0 - (residual / (4.685 * scale)) ** 2, 0.0, None) ** 2
        if np.linalg.norm(normal - before) < 1e-12:
            break
    residual = points @ normal - distance
    scale = 1.4826 * float(np.median(np.abs(residual))) + 1e-9
    inlier = np.abs(residual) <= _STRAY_SIGMAS * scale
    inside = points[inlier]
    spread = np.linalg.svd(inside - inside.mean(axis=0), compute_uv=False) / np.sqrt(len(inside))
    _require_width(float(spread[0]), float(spread[1]), scale)
    off = [line.points_in_camera_mm @ normal - distance for line in lines]
    normal, distance = oriented_plane(normal, distance)
    return PlaneFit(
        normal,
        distance,
        tuple(np.abs(r) <= _STRAY_SIGMAS * scale for r in off),
        tuple(float(np.sqrt(np.mean(r**2))) if len(r) else np.nan for r in off),
        float(np.sqrt(np.mean(residual[inlier] ** 2))),
        float(spread[0]),
        float(spread[1]),
    )


def plane_findings(fit: PlaneFit, lines: Sequence[BoardLine], normal_sigma_deg: float) -> list[Finding]:
    """Return what makes the plane less certain than it should be."""
    found: list[Finding] = []
    if fit.width_mm < 0.1 * fit.length_mm:
        angle = _largest_angle_deg(lines)
        how = "parallel" if angle < 3.0 else "apart"
        figures: dict[str, Any] = {"width_mm": fit.width_mm, "length_mm": fit.length_mm, "angle_deg": angle}
        found.append(codes.LINES_TOO_CLOSE(how=how, **figures))
    elif _UNSURE_NORMAL_DEG < normal_sigma_deg <= _OPEN_NORMAL_DEG:
        found.append(codes.PLANE_NORMAL_WEAK(normal_deg=2 * normal_sigma_deg))
    used = sum(bool(m.any()) for m in fit.inliers)
    if used < 4:
        found.append(codes.FEW_BOARDS(count=used))
    if normal_sigma_deg > _OPEN_NORMAL_DEG:
        found.append(codes.PLANE_NORMAL_OPEN(normal_deg=2 * normal_sigma_deg))
    return found


def _laid_into_plane(n: FloatArray) -> FloatArray:
    view = np.array([0.0, 0.0, 1.0])
    if abs(n[2]) > 0.9999:  # the camera looks squarely at the plane: take the image's upward direction instead
        view = np.array([0.0, -1.0, 0.0])
    z = view - (view @ n) * n
    return z / np.linalg.norm(z)


def _start(lines: Sequence[BoardLine], rng: np.random.Generator) -> tuple[FloatArray, float]:
    """Return the plane through three points of two or three boards that most points are near to."""
    points = np.concatenate([line.points_in_camera_mm for line in lines])
    scored = points[:: max(1, len(points) // _MOST_SCORED)]
    a, b, c = _three_points(points, np.array([len(line.points_in_camera_mm) for line in lines]), rng)
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    spans = lengths > 1e-9
    if not spans.any():
        return np.array([0.0, 0.0, 1.0]), 0.0
    normals = normals[spans] / lengths[spans, None]
    distances = np.einsum("ti,ti->t", normals, a[spans])
    most = int(0.6 * len(scored))
    costs = np.partition(np.abs(normals @ scored.T - distances[:, None]), most, axis=1)[:, most]
    best = int(np.argmin(costs))
    return normals[best], float(distances[best])


def _three_points(
    points: FloatArray, counts: NDArray[np.int_], rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return for each trial two points of one line and one of another, of lines with so many points in turn."""
    begins = np.cumsum(counts) - counts
    one = rng.integers(len(counts), size=_TRIALS)
    other = (one + rng.integers(1, len(counts), size=_TRIALS)) % len(counts)
    first = rng.integers(counts[one])
    second = (first + rng.integers(1, counts[one])) % counts[one]
    return (
        points[begins[one] + first],
        points[begins[one] + second],
        points[begins[other] + rng.integers(counts[other])],
    )


def _weighted_plane(points: FloatArray, weight: FloatArray) -> tuple[FloatArray, float]:
    center = weight @ points / weight.sum()
    d = points - center
    normal = np.linalg.eigh((d * weight[:, None]).T @ d)[1][:, 0]
    return normal, float(normal @ center)


def _require_width(length_mm: float, width_mm: float, scale_mm: float) -> None:
    if width_mm > max(0.01 * length_mm, 3.0 * scale_mm):
        return
    got = "lines that all lie within {width_mm:.2f} mm of one straight line, through which many planes run"
    to_do = "Capture the board nearer and farther away, and tilted."
    raise MotionError("the stripe on boards at different distances", got, to_do, width_mm=2 * width_mm)


def _largest_angle_deg(lines: Sequence[BoardLine]) -> float:
    directions = [
        np.linalg.svd(p - p.mean(axis=0), full_matrices=False)[2][0]
        for p in (line.points_in_camera_mm for line in lines if line.is_enough)
    ]
    cosines = np.abs(np.array(directions) @ np.array(directions).T)
    return float(np.rad2deg(np.arccos(np.clip(cosines.min(), 0.0, 1.0))))


def rotation_sigma_deg(covariance: FloatArray) -> float:
    """Return the largest standard deviation of the normal's direction, in degrees, of a (4, 4) covariance."""
    return float(np.rad2deg(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1])))
