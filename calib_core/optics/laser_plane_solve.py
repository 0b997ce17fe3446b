"""The plane of light from views of a board with the stripe on it, with everything that is uncertain in it.

First the boards' poses from their corners, the stripe's points on the boards and a robust plane through them; then
everything together, see `laser_plane_joint`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import MotionError
from calib_core.findings import Finding
from calib_core.findings.codes.laser_plane import CAMERA_HELD
from calib_core.frames import FloatArray, RigidTransform
from calib_core.optics.adjust import Corners, State, fit_poses, shared_vector
from calib_core.optics.board import BoardView
from calib_core.optics.board_ground import without_board
from calib_core.optics.board_lines import OnBoard, Trace, find_traces, least_points
from calib_core.optics.board_shape import BoardShape
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.camera_start import homographies, poses_from_homographies
from calib_core.optics.focus_change import FocusChange, beside_told, focus_change
from calib_core.optics.laser_plane import (
    BoardLine,
    PlaneFit,
    fit_plane,
    oriented_plane,
    plane_covariance_from_inverse,
    points_on_board,
)
from calib_core.optics.laser_plane_joint import CameraUncertainty, Joint, Together
from calib_core.optics.laser_plane_members import LeftOut, members, on_own_line
from calib_core.optics.line_choice import PlacedTrace, choose_traces
from calib_core.optics.stripe import StripeCenters
from calib_core.optics.stripe_light import drawn_px
from calib_core.optics.stripe_looks import look_without_board

_POSE_HUBER = 2.0
_LEAST_CORNER_SIGMA_PX = 0.003
_MOST_CAMERA_SIGMAS = 3.0
_PLAIN_SHARE = 0.8


@dataclass(frozen=True, eq=False)
class PlaneView:
    """One board with the stripe on it.

    Attributes
    ----------
    others : tuple of StripeCenters
        Further ways to see its stripe.
    squares : (M, 4)
        The board's light squares, see `stripe_light.light_squares`.
    """

    name: str
    board: BoardView
    stripe: StripeCenters
    others: tuple[StripeCenters, ...] = ()
    squares: FloatArray = field(default_factory=lambda: np.zeros((0, 4)))


@dataclass(frozen=True, eq=False)
class ViewFigures:
    """What one view contributed; `without_ray`: centres dropped because they lie beyond the distortion's fold."""

    name: str
    left_out: LeftOut | None
    points: int
    line_rms_mm: float
    line_mean_mm: float
    stripe_sigma_px: float
    board_sigma_px: float
    board_distance_mm: float
    without_ray: int = 0


@dataclass(frozen=True, eq=False)
class PlaneSolution:
    """The plane of light and its evidence.

    Parameters
    ----------
    camera : CameraModel
        Refined with the plane, where the boards gave it; else as it was given.
    normal, distance_mm
        normal · p = distance in the camera frame, distance not negative.
    covariance : (4, 4)
        Of normal and distance.
    joint_covariance : (C + 3, C + 3)
        Of the camera's uncertain parameters, if any, and of q = normal / distance, 1/mm.
    rms_mm : float
        RMS distance of the stripe's points on the boards from the plane.
    camera_from_board : list of RigidTransform
        Of the views that were used.
    lines : tuple of BoardLine
        Of the views that were used.
    fit : PlaneFit
        The robust fit that the joint one started from.
    views : tuple of ViewFigures
        All views, in the order given.
    noise_factor : float
        How much larger the stripe's residuals are than its centres' own standard deviations.
    excess_px : float
        By how much more than stated the boards' lines lie off the plane; the covariance holds it.
    shape : BoardShape or None
        How the board is bent, where that was solved.
    focus : FocusChange or None
        Of the boards with the stripe beside those without or the told camera, where enough tell.
    camera_held : Finding or None
        That the camera stays as its boards gave it although the stripes were there to refine it.
    """

    camera: CameraModel
    normal: FloatArray
    distance_mm: float
    covariance: FloatArray
    joint_covariance: FloatArray
    rms_mm: float
    camera_from_board: list[RigidTransform]
    lines: tuple[BoardLine, ...]
    fit: PlaneFit
    views: tuple[ViewFigures, ...]
    noise_factor: float
    excess_px: float
    shape: BoardShape | None = None
    focus: FocusChange | None = None
    camera_held: Finding | None = None


def solve_plane(
    camera: CameraModel,
    views: Sequence[PlaneView],
    camera_uncertainty: CameraUncertainty | None = None,
    progress: Callable[[float, str], None] = lambda fraction, message: None,
    margin_mm: float | None = None,
) -> PlaneSolution:
    """Return the plane of light from views of a board with the stripe on it.

    Parameters
    ----------
    camera : CameraModel
    views : sequence of PlaneView
    camera_uncertainty : CameraUncertainty, optional
        Left out, the camera counts as exact.  With its boards, camera and plane are refined together.
    progress : callable, optional
    margin_mm : float, optional
        How far the board's sheet goes on beyond the squares, where that is told.

    Raises
    ------
    MotionError
        If too few boards carry the stripe, or their lines do not fix a plane.
    """
    if len(views) < 2:
        need = "the stripe on at least two boards, better five at different distances"
        to_do = "Capture the board with the stripe on it at other distances and tilts."
        raise MotionError(need, f"{len(views)}", to_do)
    known = camera_uncertainty
    others = () if known is None else known.boards or ()
    shape = None if known is None else known.shape
    corners = _corners([*(v.board for v in views), *others], shape)
    posed, corner_sigma = _fit_poses(camera, corners, shape)
    poses = posed.poses()[: len(views)]
    progress(0.5, "fitting the plane")
    traces, agreeing = _choose_lines(camera, views, poses, shape, margin_mm)
    kept = [
        view.stripe.selected(np.zeros(len(view.stripe.row_px), dtype=bool))
        if trace is None
        else _undrawn(trace.stripe.selected(trace.clear), view, camera)
        for view, trace in zip(views, traces, strict=True)
    ]
    lines = [_line(camera, v.name, s, p, shape) for v, s, p in zip(views, kept, poses, strict=True)]
    weighted = corners.weighted(1.0 / corner_sigma[corners.view_of_each])
    still = camera_uncertainty and replace(camera_uncertainty, boards=None)

    def together(boards: Sequence[int], about: PlaneFit, known: CameraUncertainty | None = still) -> Together:
        stripes = [kept[i].selected(on_own_line(lines[i], about)) for i in boards]
        places = [_on_board(camera, s, poses[i], shape) for i, s in zip(boards, stripes, strict=True)]
        every = [*boards, *range(len(views), corners.views)]
        return Together(camera, weighted.take(every), stripes, places, posed.take(every), _inverse(about), known)

    if not any(line.is_enough for line in lines):
        raise MotionError(
            "the laser's line on at least two boards",
            "none on any of {count} boards",
            "Switch the laser on and let its line cross the board.",
            count=len(lines),
        )
    reasons, fit = members(lines, agreeing, lambda boards, about: together(boards, about).boards()[0])
    used = [i for i, reason in enumerate(reasons) if reason is None]
    progress(0.7, "refining plane and boards together")
    both = together(used, fit, camera_uncertainty)
    joint, inliers = both.refined(), both.stripes
    held = why_held(joint)
    if held:
        joint = together(used, fit).refined()
    doubted = [
        _line(camera, views[i].name, s.shifted(drawn_px(s, views[i].squares, camera).doubt_px), poses[i], shape)
        for i, s in zip(used, inliers, strict=True)
    ]
    joint = joint.doubting(_inverse(fit_plane(doubted)) - _inverse(fit))
    q, camera = joint.inverse_plane, joint.camera
    length = float(np.linalg.norm(q))
    normal, distance = oriented_plane(q / length, 1.0 / length)
    covariance = plane_covariance_from_inverse(q, joint.covariance[-3:, -3:])
    ended = joint.state.poses()[: len(used)]
    shape = joint.shape
    final = [_line(camera, views[i].name, s, p, shape) for i, s, p in zip(used, inliers, ended, strict=True)]
    everywhere = np.concatenate([line.points_in_camera_mm for line in final])
    for i, line, pose in zip(used, final, ended, strict=True):
        lines[i], poses[i] = line, pose
    figures = _figures(camera, views, lines, poses, corner_sigma[: len(views)], reasons, normal, distance)
    rms = float(np.sqrt(np.mean((everywhere @ normal - distance) ** 2)))
    focus = _focus(camera, weighted, posed, known, views)
    return PlaneSolution(
        camera, normal, distance, covariance, joint.covariance, rms, ended, tuple(final), fit, figures,
        joint.noise_factor, joint.excess_px, shape, focus, held,
    )  # fmt: skip


def _focus(
    camera: CameraModel,
    corners: Corners,
    posed: State,
    known: CameraUncertainty | None,
    views: Sequence[PlaneView],
) -> FocusChange | None:
    if known is not None and known.boards != ():
        return focus_change(camera, corners, posed, known.free, len(views))
    return beside_told(camera, corners, posed) if all(view.board.is_numbered for view in views) else None


def why_held(joint: Joint) -> Finding | None:
    """Return why the refined camera is not to be taken, None where it is."""
    if joint.camera_moved_sigmas > _MOST_CAMERA_SIGMAS:
        return CAMERA_HELD(course="drawn")
    return None if joint.corners_worsened is None else CAMERA_HELD(course="worse", worsened=joint.corners_worsened)


def board_poses(camera: CameraModel, views: Sequence[BoardView]) -> tuple[list[RigidTransform], FloatArray]:
    """Return camera_from_board of each view and the standard deviation (V,) of a corner's coordinate, px."""
    posed, sigma = _fit_poses(camera, _corners(views))
    return posed.poses(), sigma


def posed_corners(camera: CameraModel, views: Sequence[BoardView]) -> tuple[Corners, State]:
    """Return boards' corners, weighed by their noise, and where flat boards would stand."""
    corners = _corners(views)
    posed, sigma = _fit_poses(camera, corners)
    return corners.weighted(1.0 / sigma[corners.view_of_each]), posed


def posed_board(
    camera: CameraModel, view: BoardView, shape: BoardShape | None
) -> tuple[RigidTransform, FloatArray]:
    """Return camera_from_board of one view of a board of some shape, and the covariance (6, 6) of its pose."""
    corners = _corners([view], shape)
    posed, sigma = _fit_poses(camera, corners, shape)
    end = fit_poses(corners.weighted(1.0 / sigma[corners.view_of_each]), posed, camera.bands[1:], _POSE_HUBER)
    return end.state.poses()[0], end.pose_covariances[0]


def _corners(views: Sequence[BoardView], shape: BoardShape | None = None) -> Corners:
    corners = Corners.of([v.points_px for v in views], [v.points_in_board_mm for v in views])
    return corners if shape is None else replace(corners, extent_mm=shape.extent_mm)


def _fit_poses(camera: CameraModel, corners: Corners, shape: BoardShape | None = None) -> tuple[State, FloatArray]:
    depth = float(np.median([s.near_mm + s.far_mm for s in camera.segments]) / 2) if camera.segments else None
    rays = camera.undistort(corners.pixels, depth)
    straight = replace(corners, pixels=rays)
    rotations, translations = poses_from_homographies(homographies(straight), np.eye(3))
    bands, near, far = camera.bands
    start = State(shared_vector(camera.camera_matrix, bands, None, shape), rotations, translations)
    end = fit_poses(corners, start, (near, far), np.inf)
    # The stripe runs over some corners and draws them to it: they must not turn the board.
    for _ in range(2):
        sigma = _robust_sigma(end.corner_residuals, corners)
        end = fit_poses(corners.weighted(1.0 / sigma[corners.view_of_each]), end.state, (near, far), _POSE_HUBER)
    return end.state, _robust_sigma(end.corner_residuals, corners)


def _robust_sigma(residuals: FloatArray, corners: Corners) -> FloatArray:
    """Return the standard deviation (V,) of a corner's coordinate in each view, px, whatever a few corners do."""
    spans = zip(corners.ends[:-1], corners.ends[1:], strict=True)
    sigma = [1.4826 * float(np.median(np.abs(residuals[a:b]))) for a, b in spans]
    return np.maximum(sigma, _LEAST_CORNER_SIGMA_PX)


def _on_board(
    camera: CameraModel, stripe: StripeCenters, pose: RigidTransform, shape: BoardShape | None
) -> FloatArray:
    """Return where on a board the stripe's centres lie, (N, 3), mm."""
    return pose.inverse().apply(points_on_board(camera, stripe.pixels, pose, shape))


def lines_on_board(
    camera: CameraModel, view: PlaneView, margin_mm: float | None
) -> list[tuple[StripeCenters, list[Trace]]]:
    """Return each of a view's stripes with the lines that its centres may form on the board."""
    (pose,), _ = board_poses(camera, [view.board])
    on_board = _places(camera, pose, None)
    stripes = (view.stripe, *view.others)
    return [(stripe, find_traces([stripe], view.board, on_board, margin_mm)) for stripe in stripes]


def without_its_board(camera: CameraModel, view: PlaneView, image: NDArray[np.uint8 | np.uint16]) -> PlaneView:
    """Return a view with what is found where its board's own light is taken off the frame (H, W), too."""
    (pose,), _ = board_poses(camera, [view.board])
    left = without_board(
        image, view.board, lambda p: camera.project(pose.apply(np.column_stack([p, np.zeros(len(p))])))
    )
    return view if left is None else replace(view, others=(*view.others, *look_without_board(left)))


def is_plain(trace: Trace) -> bool:
    """Whether a line is sure and without gaps: no need to look again."""
    along = trace.stripe.pixels[trace.on_line][:, 0 if trace.stripe.axis == "columns" else 1]
    return trace.is_sure and len(along) > _PLAIN_SHARE * (np.ptp(along) + 1)


def _places(camera: CameraModel, pose: RigidTransform, shape: BoardShape | None) -> OnBoard:
    """Return what tells where pixels lie on a board, mm."""
    return lambda pixels: pose.inverse().apply(points_on_board(camera, pixels, pose, shape))[:, :2]


def _choose_lines(
    camera: CameraModel,
    views: Sequence[PlaneView],
    poses: Sequence[RigidTransform],
    shape: BoardShape | None,
    margin_mm: float | None,
) -> tuple[list[Trace | None], list[int]]:
    """Return the laser's line on each board, None where none is seen, and the views whose lines agree."""
    placed: list[list[PlacedTrace]] = []
    for view, pose in zip(views, poses, strict=True):
        slack = 0.0 if shape is None else float(np.ptp(shape.heights_mm(view.board.points_in_board_mm)))
        stripes = [view.stripe, *view.others]
        traces = find_traces(stripes, view.board, _places(camera, pose, shape), margin_mm, slack)
        points = [points_on_board(camera, t.stripe.pixels[t.on_line], pose, shape) for t in traces]
        place = pose.inverse() if view.board.is_numbered else None
        placed.append([PlacedTrace.of(t, p, place) for t, p in zip(traces, points, strict=True)])
    return choose_traces(placed)


def _inverse(fit: PlaneFit) -> FloatArray:
    return fit.normal / fit.distance_mm


def _undrawn(stripe: StripeCenters, view: PlaneView, camera: CameraModel) -> StripeCenters:
    """Return a line's centres where they are without what light that falls off draws them by."""
    return stripe.shifted(-drawn_px(stripe, view.squares, camera).px)


def _line(
    camera: CameraModel, name: str, stripe: StripeCenters, pose: RigidTransform, shape: BoardShape | None
) -> BoardLine:
    """Return the stripe's points on a board, and how far a centre's standard deviation moves them."""
    pixels = stripe.pixels
    if not len(pixels):
        return BoardLine(name, np.zeros((0, 3)), np.zeros(0))
    points = points_on_board(camera, pixels, pose, shape)
    moved = points_on_board(camera, pixels + 0.1 * stripe.across, pose, shape)
    sigma = np.linalg.norm(moved - points, axis=1) * 10.0 * stripe.sigma_px
    return BoardLine(name, points, sigma, least_points(stripe))


def _figures(
    camera: CameraModel,
    views: Sequence[PlaneView],
    lines: Sequence[BoardLine],
    poses: Sequence[RigidTransform],
    corner_sigma: FloatArray,
    reasons: Sequence[LeftOut | None],
    normal: FloatArray,
    distance_mm: float,
) -> tuple[ViewFigures, ...]:
    figures: list[ViewFigures] = []
    for view, line, pose, rms, reason in zip(views, lines, poses, corner_sigma, reasons, strict=True):
        off = line.points_in_camera_mm @ normal - distance_mm
        figures.append(
            ViewFigures(
                view.name,
                reason,
                len(off),
                float(np.sqrt(np.mean(off**2))) if len(off) else float("nan"),
                float(np.median(off)) if len(off) else float("nan"),
                float(np.median(view.stripe.sigma_px)),
                float(rms),
                float(pose.translation_mm[2]),
                int(np.isnan(points_on_board(camera, view.stripe.pixels, pose)[:, 0]).sum()),
            )
        )
    return tuple(figures)
