"""Bundle adjustment: one camera, boards in many poses, and the plane of light where its line is seen on them.

The poses are eliminated view by view (Schur complement), so that what is solved is as small as the camera.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib_core.estimation import covariance_of, minimise
from calib_core.frames import FloatArray, RigidTransform
from calib_core.kernels.bundle import LENS, PLANE_TERMS, SHAPE_TERMS, add_corners, add_laser_lines
from calib_core.optics.board_shape import BoardShape, shape_basis

IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Corners:
    """The corners of all views, one after the other.

    Parameters
    ----------
    pixels : (N, 2)
    points_mm : (N, 3)
        In the board's frame.
    ends : (V + 1,)
        Corners of view k are those from ends[k] to ends[k + 1].
    weights : (N,)
        1 / σ, 1/px; 0 leaves a corner out.
    extent_mm : (2, 2)
        The lowest and the highest x and y of the whole board: its shape is told about their middle.
    """

    pixels: FloatArray
    points_mm: FloatArray
    ends: IntArray
    weights: FloatArray
    extent_mm: FloatArray

    @classmethod
    def of(cls, pixels: Sequence[FloatArray], points_mm: Sequence[FloatArray], sigma_px: float = 1.0) -> "Corners":
        """Return the corners of views, given as one array per view, all of one standard deviation."""
        ends = np.concatenate([[0], np.cumsum([len(p) for p in pixels])]).astype(np.int64)
        points = np.ascontiguousarray(np.concatenate(points_mm), dtype=float)
        return cls(
            np.ascontiguousarray(np.concatenate(pixels), dtype=float),
            points,
            ends,
            np.full(int(ends[-1]), 1.0 / sigma_px),
            np.array([points[:, :2].min(0), points[:, :2].max(0)]),
        )

    @property
    def views(self) -> int:
        """How many views there are."""
        return len(self.ends) - 1

    @property
    def view_of_each(self) -> IntArray:
        """The index of each corner's view, (N,)."""
        return np.repeat(np.arange(self.views), np.diff(self.ends))

    def weighted(self, weights: FloatArray) -> "Corners":
        """Return the same corners with other weights (N,)."""
        return replace(self, weights=weights)

    def take(self, views: Sequence[int] | IntArray) -> "Corners":
        """Return the corners of some views only, in the order given."""
        index, ends = _rows_of(self.ends, views)
        return Corners(self.pixels[index], self.points_mm[index], ends, self.weights[index], self.extent_mm)

    def shape_basis(self) -> FloatArray:
        """Return the board's shape functions (N, 7) at its corners."""
        return shape_basis(self.points_mm, self.extent_mm)


def _rows_of(ends: IntArray, views: Sequence[int] | IntArray) -> tuple[IntArray, IntArray]:
    """Return the rows of some views, and where each view's end among them."""
    rows = [np.arange(ends[v], ends[v + 1]) for v in views]
    index = np.concatenate(rows) if rows else np.zeros(0, np.int64)
    return index, np.concatenate([[0], np.cumsum([len(r) for r in rows])]).astype(np.int64)


@dataclass(frozen=True, eq=False)
class LaserLines:
    """Stripe centres on the boards of all views, one after the other.

    Parameters
    ----------
    pixels : (M, 2)
    axes : (M,)
        0 where the centre was found along u (in a row), 1 where along v (in a column).
    ends : (V + 1,)
    weights : (M,)
        1 / σ along that axis, 1/px.
    basis : (M, 7)
        The board's shape functions where the light meets it.
    """

    pixels: FloatArray
    axes: IntArray
    ends: IntArray
    weights: FloatArray
    basis: FloatArray

    def take(self, views: Sequence[int] | IntArray) -> "LaserLines":
        """Return the lines of some views only, in the order given."""
        index, ends = _rows_of(self.ends, views)
        return LaserLines(self.pixels[index], self.axes[index], ends, self.weights[index], self.basis[index])


@dataclass(frozen=True, eq=False)
class State:
    """Where an adjustment stands: the shared parameters and camera_from_board of every view."""

    shared: FloatArray
    rotations: FloatArray
    translations: FloatArray

    def poses(self) -> list[RigidTransform]:
        """Return camera_from_board of every view."""
        return [
            RigidTransform.of(r, t, "camera", "board")
            for r, t in zip(self.rotations, self.translations, strict=True)
        ]

    def take(self, views: Sequence[int] | IntArray) -> "State":
        """Return the state of some views only."""
        index = np.asarray(views, dtype=np.int64)
        return State(self.shared, self.rotations[index], self.translations[index])


@dataclass(frozen=True, eq=False)
class Equations:
    """The normal equations about a state, poses eliminated."""

    cost: float
    gradient: FloatArray
    hessian: FloatArray
    poses_by_shared: FloatArray
    pose_step: FloatArray
    h_pp: FloatArray
    corner_residuals: FloatArray
    line_residuals: FloatArray

    def with_prior(self, values: FloatArray, weights: FloatArray) -> "Equations":
        """Return the equations of parameters (C,) that are about zero, weighed by 1 / σ² (C,)."""
        cost = self.cost + 0.5 * float(weights @ values**2)
        gradient, hessian = self.gradient + weights * values, self.hessian + np.diag(weights)
        return replace(self, cost=cost, gradient=gradient, hessian=hessian)


@dataclass(frozen=True, eq=False)
class Adjusted:
    """Where an adjustment ended.

    Attributes
    ----------
    state : State
    free : (C,)
        Places of the adjusted parameters in the shared vector.
    covariance : (C, C)
        Of the free parameters, for the weights as given.
    pose_covariances : (V, 6, 6)
        Of camera_from_board, order rx ry rz tx ty tz.
    corner_residuals, line_residuals : (N, 2), (M,)
        Seen minus predicted, px.
    converged : bool
    """

    state: State
    free: IntArray
    covariance: FloatArray
    pose_covariances: FloatArray
    corner_residuals: FloatArray
    line_residuals: FloatArray
    cost: float
    converged: bool


@dataclass(frozen=True, eq=False)
class Adjustment:
    """What is adjusted: corners, lines where there are some, bands of depth, and which parameters are free.

    Parameters
    ----------
    corners : Corners
    band_nears, band_fars : (B,)
        Ends of the bands of depth, mm.
    free : (C,)
        See `free_parameters`.
    huber : float
        Residuals above this many σ count linearly.
    lines : LaserLines, optional
    prior : (P,), optional
        1 / σ² about zero of each shared parameter, free or not; 0 where nothing is known of it.
    """

    corners: Corners
    band_nears: FloatArray
    band_fars: FloatArray
    free: IntArray
    huber: float = np.inf
    lines: LaserLines | None = None
    prior: FloatArray | None = None

    def equations(self, state: State) -> Equations:
        """Return the normal equations about a state."""
        c, v = len(self.free), self.corners.views
        h_cc, g_c = np.zeros((c, c)), np.zeros(c)
        h_cp, h_pp, g_p = np.zeros((v, c, 6)), np.zeros((v, 6, 6)), np.zeros((v, 6))
        corner_residuals = np.empty(self.corners.pixels.shape)
        poses = np.ascontiguousarray(state.rotations), np.ascontiguousarray(state.translations)
        about = (state.shared, self.band_nears, self.band_fars, self.free, *poses)
        into = (h_cc, g_c, h_cp, h_pp, g_p)
        corners = self.corners
        basis = corners.shape_basis()
        cost = add_corners(
            corners.pixels, corners.points_mm, basis, corners.ends, corners.weights, self.huber,
            *about, *into, corner_residuals,
        )  # fmt: skip
        line_residuals = np.zeros(0)
        if self.lines is not None:
            lines = self.lines
            line_residuals = np.empty(len(lines.pixels))
            cost += add_laser_lines(
                lines.pixels, lines.basis, lines.axes, lines.ends, lines.weights, self.huber,
                *about, *into, line_residuals,
            )  # fmt: skip
        reduced = _reduce(cost, *into, corner_residuals, line_residuals)
        return (
            reduced if self.prior is None else reduced.with_prior(state.shared[self.free], self.prior[self.free])
        )

    def solve(self, start: State, tolerance: float = 1e-6) -> Adjusted:
        """Minimise from a start and return the minimum with its covariance."""
        if len(self.free) == 0:
            raise ValueError("nothing is free; use fit_poses")
        limit = step_limits(start.shared, len(self.band_nears))[self.free]
        end = minimise(self.equations, self._retract, start, limit, tolerance)
        covariance = covariance_of(end.at.hessian)
        spread = end.at.poses_by_shared
        poses = np.linalg.inv(end.at.h_pp) + spread @ covariance @ spread.transpose(0, 2, 1)
        return Adjusted(
            end.state, self.free, covariance, poses, end.at.corner_residuals, end.at.line_residuals,
            end.at.cost, end.converged,
        )  # fmt: skip

    def _retract(self, state: State, step: FloatArray, at: Equations) -> State:
        shared = state.shared.copy()
        shared[self.free] += step
        poses = at.pose_step + at.poses_by_shared @ step
        return State(shared, state.rotations @ _rotations(poses[:, :3]), state.translations + poses[:, 3:])


def fit_poses(corners: Corners, start: State, bands: tuple[FloatArray, FloatArray], huber: float) -> Adjusted:
    """Return the poses that fit best while all shared parameters stay; views do not know each other.

    The poses of views that do not fit are as good as they get, never an error.
    """
    ends: list[State] = []
    covariances: list[FloatArray] = []
    residuals: list[FloatArray] = []
    cost, converged = 0.0, True
    nothing = np.zeros(0, np.int64)
    for view in range(corners.views):
        alone = Adjustment(corners.take([view]), *bands, nothing, huber)

        def linearise(state: State, alone: Adjustment = alone) -> _PoseEquations:
            return _PoseEquations(alone.equations(state))

        limit = np.array([0.3, 0.3, 0.3, *([max(1.0, 0.3 * abs(start.translations[view, 2]))] * 3)])
        end = minimise(linearise, _move_pose, start.take([view]), limit, 1e-6)
        ends.append(end.state)
        covariances.append(covariance_of(end.at.hessian))
        residuals.append(end.at.equations.corner_residuals)
        cost += end.at.cost
        converged &= end.converged
    state = State(
        start.shared, np.concatenate([e.rotations for e in ends]), np.concatenate([e.translations for e in ends])
    )
    return Adjusted(
        state, nothing, np.zeros((0, 0)), np.array(covariances), np.concatenate(residuals), np.zeros(0),
        cost, converged,
    )  # fmt: skip


class _PoseEquations:
    """The equations of one view whose pose alone is free."""

    def __init__(self, equations: Equations) -> None:
        self.equations = equations
        self.cost = equations.cost
        self.hessian = equations.h_pp[0]
        self.gradient = -equations.h_pp[0] @ equations.pose_step[0]


def _move_pose(state: State, step: FloatArray, at: _PoseEquations) -> State:
    return State(state.shared, state.rotations @ _rotations(step[None, :3]), state.translations + step[None, 3:])


def shape_start(bands: int) -> int:
    """Return the place of the board's shape in the shared vector."""
    return LENS + 14 * bands


def plane_start(bands: int) -> int:
    """Return the place of the plane of light in the shared vector."""
    return shape_start(bands) + SHAPE_TERMS


def shared_vector(
    camera_matrix: FloatArray, bands: FloatArray, plane: FloatArray | None = None, shape: BoardShape | None = None
) -> FloatArray:
    """Return the shared parameters of a camera, bands (B, 14), a board, flat without a shape, a plane q (3,)."""
    focal = [camera_matrix[0, 0], camera_matrix[1, 1], camera_matrix[0, 2], camera_matrix[1, 2]]
    q = np.zeros(PLANE_TERMS) if plane is None else plane
    heights = np.zeros(SHAPE_TERMS) if shape is None else shape.coefficients_mm
    return np.concatenate([focal, np.asarray(bands, dtype=float).ravel(), heights, q])


def step_limits(shared: FloatArray, bands: int) -> FloatArray:
    """Return the longest sensible steps of the shared parameters."""
    limits = np.ones(len(shared))
    limits[:LENS] = 0.3 * max(shared[0], shared[1])
    for band in range(bands):
        limits[LENS + 14 * band + 12 : LENS + 14 * band + 14] = 0.1
    limits[shape_start(bands) : plane_start(bands)] = 5.0
    limits[plane_start(bands) :] = np.maximum(0.3 * np.linalg.norm(shared[plane_start(bands) :]), 1e-9)
    return limits


def _reduce(
    cost: float,
    h_cc: FloatArray,
    g_c: FloatArray,
    h_cp: FloatArray,
    h_pp: FloatArray,
    g_p: FloatArray,
    corner_residuals: FloatArray,
    line_residuals: FloatArray,
) -> Equations:
    """Eliminate the poses."""
    if not np.isfinite(cost):
        nothing = np.zeros_like(g_p)
        by_shared = h_cp.transpose(0, 2, 1)
        return Equations(np.inf, g_c, h_cc, by_shared, nothing, h_pp, corner_residuals, line_residuals)
    scale = np.sqrt(np.maximum(np.einsum("vii->vi", h_pp), 1e-300))
    scaled = h_pp / (scale[:, :, None] * scale[:, None, :]) + 1e-13 * np.eye(6)
    right = np.concatenate([h_cp.transpose(0, 2, 1), g_p[:, :, None]], axis=2) / scale[:, :, None]
    solved = np.linalg.solve(scaled, right) / scale[:, :, None]
    by_shared, pose_step = -solved[:, :, :-1], -solved[:, :, -1]
    stacked = h_cp.transpose(1, 0, 2).reshape(len(g_c), h_cp.shape[0] * 6)
    hessian = h_cc + stacked @ by_shared.reshape(h_cp.shape[0] * 6, len(g_c))
    gradient = g_c + stacked @ pose_step.ravel()
    return Equations(
        cost, gradient, (hessian + hessian.T) / 2, by_shared, pose_step, h_pp, corner_residuals, line_residuals
    )


def _rotations(vectors: FloatArray) -> FloatArray:
    """Return the rotations (V, 3, 3) of vectors (V, 3), rad."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vectors).as_matrix()).reshape(-1, 3, 3)
