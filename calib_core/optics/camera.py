"""The camera from views of a board: robust adjustment, views rejected with reasons, and the model they ask for."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from calib_core.errors import MotionError
from calib_core.frames import FloatArray
from calib_core.messages import Value, message
from calib_core.optics.adjust import Adjusted, Corners, State
from calib_core.optics.board import BoardView
from calib_core.optics.camera_choice import QUADRATIC, choose_layout, held_out_errors
from calib_core.optics.camera_evidence import summarise
from calib_core.optics.camera_layout import Layout, depth_bands, restart
from calib_core.optics.camera_model import Model
from calib_core.optics.camera_solution import CameraSolution, Fit, Misfits
from calib_core.optics.camera_start import (
    homographies,
    homography_misfits_px,
    poses_from_homographies,
    start_from_homographies,
)
from calib_core.optics.pitch_ratio import differing_pitches
from calib_core.optics.robot_lengths import RobotPoses, with_robot

FEWEST_VIEWS = 3
_VIEWS_TO_TELL_A_BEND = 5
_VIEWS_TO_COMPARE = 6
_NO_BOARD_SHARE = 0.03  # of the image; distortion alone bends a board by less
K2, K3 = 5, 8  # their places in the shared vector
_HUBER_SIGMAS = 3.0
_OUTLIER_SIGMAS = 6.0
_LEAST_OUTLIER_PX = 0.5  # below, it may be the model that is wrong, not the corner
_RADIAL_POWERS = {4: 2, 5: 4, 8: 6, 9: 2, 10: 4, 11: 6}  # of the radius, by the coefficients' places
_MOST_OF_A_TERM = 3.0  # standard deviation of what a term makes of the image's corner, over its radius
_LEAST_KNOWN = 1e-12  # least eigenvalue of a scaled Hessian: below, rounding makes it
_WORST_VIEW_FACTOR = 4.0
_HARMLESS_PX = 0.2  # nobody rejects a view for less
_FREE: dict[Model, list[int]] = {
    "plain": list(range(9)),
    "rational": list(range(12)),
    # Decentring (p1, p2) is left out: with the principal point it imitates a tilt almost perfectly.
    "tilted": [0, 1, 2, 3, 4, 5, 8, 16, 17],
    "segmental": [],  # follows from the bands
}


@dataclass(frozen=True)
class CameraOptions:
    """What to solve.

    Parameters
    ----------
    model : str
        "auto" chooses by held-out error; or one of the models.
    refine_board : bool or None
        Whether the board may be bent (quadratic and cubic deviation from its plane); None: held-out error decides
        whether freely, and where it does not say so, a slight bend is allowed for.
    folds : int
        For the held-out error.
    segments : int
        How many bands of depth a segmental camera has at most.
    """

    model: Model | Literal["auto"] = "auto"
    refine_board: bool | None = False
    folds: int = 5
    segments: int = 4


def whole_depth(model: Model) -> Layout:
    """Return the layout of a model whose distortion does not change with depth."""
    return Layout(model, np.array([-np.inf]), np.array([np.inf]), np.array(_FREE[model], dtype=np.int64))


def banded(nears: FloatArray, fars: FloatArray) -> Layout:
    """Return the layout of a segmental camera: k1 k2 p1 p2 k3 in each band."""
    places = [4 + 14 * b + j for b in range(len(nears)) for j in range(5)]
    return Layout("segmental", nears, fars, np.array([0, 1, 2, 3, *places], dtype=np.int64))


def calibrate_camera(
    views: Sequence[BoardView],
    image_size: tuple[int, int],
    options: CameraOptions | None = None,
    progress: Callable[[float, str], None] | None = None,
    robot: RobotPoses | None = None,
) -> CameraSolution:
    """Return the camera that saw the boards.

    Parameters
    ----------
    views
        What `find_board` gave, of one board and one camera.
    image_size : (width, height)
    options : CameraOptions, optional
    progress : callable, optional
        Told the fraction done and what is being done.
    robot : RobotPoses, optional
        Where the robot was at each view of a board that stands still: its lengths are compared with the boards'.

    Raises
    ------
    MotionError
        If there are fewer than three views of use, or they do not fix the focal length.
    """
    options = options or CameraOptions()
    tell = progress or _tell_nobody
    _require_views(len(views))
    tell(0.0, "adjusting camera and boards")
    corners = Corners.of([v.points_px for v in views], [v.points_in_board_mm for v in views])
    no_boards = _no_boards(corners, image_size)
    boards = [v for v in range(corners.views) if v not in no_boards]
    _require_views(len(boards))
    start = start_from_homographies(corners.take(boards), image_size)
    fit = _robust_fit(corners, whole_depth("plain"), start, no_boards)
    layouts: dict[Model, Layout] = {m: whole_depth(m) for m in ("plain", "rational", "tilted")}
    bands = depth_bands(fit.corners, fit.adjusted.state, options.segments)
    if bands is not None:
        layouts["segmental"] = banded(*bands)
    compared, bent = list(layouts.values()), options.refine_board
    if options.model != "auto":
        if options.model not in layouts:
            raise MotionError(
                "views from near to far, at least 6 in each band of depth, for a segmental camera",
                "too few, or all at about one depth" if options.model == "segmental" else repr(options.model),
                "Take more views, or choose the model plain, rational or tilted.",
            )
        compared = [layouts[options.model]]
    plainest = compared[0].with_bent_board() if bent else compared[0]
    layout, candidates = plainest, ()
    numbered = [k for k, v in enumerate(fit.used) if views[v].is_numbered]
    if len(fit.used) >= _VIEWS_TO_COMPARE and (len(compared) > 1 or bent is None):
        tell(0.2, "comparing models on held-out views")
        told = numbered if len(numbered) >= _VIEWS_TO_COMPARE else list(range(len(fit.used)))
        bends = bent if told is numbered else bool(bent)
        parts = fit.corners.take(told), fit.adjusted.state.take(told)
        layout, candidates = choose_layout(*parts, compared, options.folds, bends)
        if bends is None and not layout.bends and len(numbered) == len(fit.used):
            layout = layout.with_slight_bend(corners.extent_mm, QUADRATIC)
            plainest = plainest.with_slight_bend(corners.extent_mm, QUADRATIC)
    rejected = fit.rejected
    if layout.bends:  # which of a bent board's heights an unknown part of it has, nothing tells
        unknown: Misfits = {v: {"off": "place"} for v in fit.used if not views[v].is_numbered}
        rejected = rejected | unknown
    tell(0.8, message("final adjustment, {chosen} model", chosen=layout.model))
    final = _robust_fit(corners, layout, restart(fit.adjusted.state, layout), rejected)
    settled = final.adjusted.converged and _is_determined(final, layout, image_size)
    if options.model == "auto" and layout.model != "plain" and not settled:
        layout = plainest  # what the views do not determine is not worth having
        final = _robust_fit(corners, layout, restart(fit.adjusted.state, layout), rejected)
    if options.model == "auto" and layout.model in ("plain", "tilted"):
        final, layout = _without_idle(corners, final, layout, options.folds)
    perhaps = None if layout.bends else _bent_fit(corners, layout, final)
    straight = _of_numbered(final, layout, views)
    pitch = None if straight is None else differing_pitches(straight, layout)
    solution = summarise(final, layout, image_size, candidates, perhaps, pitch)
    return solution if robot is None else with_robot(solution, final, layout, robot)


def _no_boards(corners: Corners, image_size: tuple[int, int]) -> Misfits:
    """Return the views whose points are no flat board in perspective, not even roughly, and how far off."""
    misfits = homography_misfits_px(corners, homographies(corners))
    limit = max(5 * float(np.median(misfits)), _NO_BOARD_SHARE * max(image_size))
    if not np.isfinite(limit) or float(np.median(misfits)) > _NO_BOARD_SHARE * max(image_size):
        limit = _NO_BOARD_SHARE * max(image_size)
    return {int(v): {"off": "board", "off_px": float(misfits[v])} for v in np.flatnonzero(~(misfits <= limit))}


def _robust_fit(corners: Corners, layout: Layout, start: State, rejected: Misfits | None = None) -> Fit:
    """Fit with a robust loss, leave out what does not belong, fit again by least squares."""
    rejected = dict(rejected or {})
    if len(start.rotations) != corners.views:  # rejected views have no pose there; they will not be looked at
        start = State(start.shared, *_poses_of(corners, start))
    while True:
        used = [v for v in range(corners.views) if v not in rejected]
        _require_views(len(used))
        part = corners.take(used)
        first = layout.adjustment(part).solve(start.take(used), 1e-4)
        spread = max(robust_sigma(first.corner_residuals), 1e-4)
        scaled = part.weighted(np.full(len(part.weights), 1 / spread))
        first = layout.adjustment(scaled, _HUBER_SIGMAS).solve(first.state, 1e-4)
        sigma = max(robust_sigma(first.corner_residuals), 1e-4)
        lengths = np.linalg.norm(first.corner_residuals, axis=1)
        keep = lengths < max(_OUTLIER_SIGMAS * sigma, _LEAST_OUTLIER_PX)
        worst = _worst_view(scaled, first, sigma)
        if worst is not None:
            rejected[used[worst[0]]] = worst[1]
            continue
        weights = np.where(keep, 1 / sigma, 0.0)
        final = layout.adjustment(part.weighted(weights)).solve(first.state)
        return _fit_of(corners, part.weighted(weights), final, used, rejected)


def _is_determined(fit: Fit, layout: Layout, image_size: tuple[int, int]) -> bool:
    """Whether views fix a rational lens: with few, terms above and below the fraction cancel at any size."""
    if layout.model != "rational":
        return True
    powers = np.array([_RADIAL_POWERS.get(int(place), 0) for place in layout.free])
    radius = np.hypot(*image_size) / 2 / float(fit.adjusted.state.shared[0])
    sigmas = fit.sigma_px * float(fit.corners.weights.max()) * np.sqrt(np.diag(fit.adjusted.covariance))
    hessian = layout.adjustment(fit.corners).equations(fit.adjusted.state).hessian
    scale = np.sqrt(np.diag(hessian))
    if np.linalg.eigvalsh(hessian / np.outer(scale, scale))[0] < _LEAST_KNOWN:  # its covariance is no number
        return False
    return bool(np.max((sigmas * radius**powers)[powers > 0]) < _MOST_OF_A_TERM)


def _of_numbered(fit: Fit, layout: Layout, views: Sequence[BoardView]) -> Fit | None:
    """Return the fit to views whose rows and columns are known; None where they are too few."""
    kept = [k for k, view in enumerate(fit.used) if views[view].is_numbered]
    if len(kept) == len(fit.used):
        return fit
    if len(kept) < FEWEST_VIEWS:
        return None
    part = fit.corners.take(kept)
    end = layout.adjustment(part).solve(fit.adjusted.state.take(kept))
    return _fit_of(fit.all_corners, part, end, [fit.used[k] for k in kept], fit.rejected)


def _bent_fit(corners: Corners, layout: Layout, flat: Fit) -> "Fit | None":
    """Return the fit with a board that may be bent, where there are views enough to tell; else None."""
    if len(flat.used) < _VIEWS_TO_TELL_A_BEND:
        return None
    return _robust_fit(corners, layout.with_bent_board(), flat.adjusted.state, flat.rejected)


def _without_idle(corners: Corners, fit: Fit, layout: Layout, folds: int) -> tuple[Fit, Layout]:
    """Return the fit without k3, then without k2, as long as held-out views are met no worse.

    Decentring stays: without p1 and p2 the principal point seems better known than halves of real sets agree.
    """
    for place in (K3, K2):
        fewer = replace(layout, free=layout.free[layout.free != place])
        if not ((place == K3 and _is_idle(fit, K3)) or _foretells_worse(fit, layout, fewer, folds)):
            break
        layout = fewer
        fit = _robust_fit(corners, layout, restart(fit.adjusted.state, layout), fit.rejected)
    return fit, layout


def _foretells_worse(fit: Fit, layout: Layout, fewer: Layout, folds: int) -> bool:
    """Whether corners of held-out views are met no worse with fewer parameters."""
    if len(fit.used) < _VIEWS_TO_COMPARE:
        return False
    errors = [held_out_errors(fit.corners, fit.adjusted.state, one, folds) for one in (layout, fewer)]
    if errors[0] is None or errors[1] is None:
        return False
    return bool(errors[1][0].mean() <= errors[0][0].mean())


def _is_idle(fit: Fit, place: int) -> bool:
    """Whether a parameter foretells worse than zero does: below √2 standard deviations (Akaike's criterion)."""
    where = np.flatnonzero(fit.adjusted.free == place)
    if not where.size or len(fit.adjusted.state.shared) > 4 + 14 + 7 + 3:  # bands have a coefficient each
        return False
    deviation = (
        fit.sigma_px * float(fit.corners.weights.max()) * np.sqrt(fit.adjusted.covariance[where[0], where[0]])
    )
    return bool(abs(fit.adjusted.state.shared[place]) < np.sqrt(2) * deviation)


def _fit_of(corners: Corners, part: Corners, end: Adjusted, used: list[int], rejected: Misfits) -> Fit:
    squares = (end.corner_residuals**2).sum(axis=1)
    kept = part.weights > 0
    freedom = 2 * int(kept.sum()) - len(end.free) - 6 * len(used)
    sigma = float(np.sqrt(squares[kept].sum() / max(freedom, 1)))
    rms = np.full(corners.views, np.nan)
    rms[used] = np.sqrt(np.add.reduceat(squares, part.ends[:-1]) / np.diff(part.ends))
    return Fit(corners, part, end, used, rejected, rms, sigma)


def _worst_view(corners: Corners, fit: Adjusted, sigma_px: float) -> tuple[int, dict[str, Value]] | None:
    """Return the view that fits worst, and why it must go; None if all may stay."""
    squares = (fit.corner_residuals**2).sum(axis=1)
    medians = np.array([np.median(squares[a:b]) for a, b in zip(corners.ends[:-1], corners.ends[1:], strict=True)])
    typical = np.sqrt(medians)  # by its median a view is not condemned for one bad corner
    worst = int(np.argmax(typical))
    others = float(np.median(typical))
    if typical[worst] > max(_WORST_VIEW_FACTOR * max(others, 0.3 * sigma_px), _HARMLESS_PX):
        return worst, {"off": "camera", "off_px": float(typical[worst]), "others_px": others}
    return None


def robust_sigma(residuals_px: FloatArray) -> float:
    """Return the standard deviation of a coordinate from the median of |residuals| (N, 2)."""
    return float(1.4826 * np.median(np.abs(residuals_px)))


def _poses_of(corners: Corners, state: State) -> tuple[FloatArray, FloatArray]:
    """Return start poses of all views for a camera, where a state holds those of some only."""
    s = state.shared
    matrix = np.array([[s[0], 0, s[2]], [0, s[1], s[3]], [0, 0, 1.0]])
    return poses_from_homographies(homographies(corners), matrix)


def _tell_nobody(_fraction: float, _what: str) -> None:
    pass


def _require_views(count: int) -> None:
    if count < FEWEST_VIEWS:
        need = "at least {fewest_views} views of the board, better 15"
        to_do = "Take more views, the board tilted differently in each, all over the image."
        raise MotionError(need, "{count} of use", to_do, fewest_views=FEWEST_VIEWS, count=count)
