"""Random halves of real sets: do they differ as they say, and does the diameter's sigma move the tool?

Tools of spheres, cameras of boards, planes of light by boards.
"""

import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
from harness import Row
from scipy.spatial.transform import Rotation

from calib_core.captures.content import sphere_of
from calib_core.captures.observe import observe_capture
from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.tcp import solve_tcp
from calib_core.chain.tcp_solution import TcpSolution
from calib_core.errors import CalibrationError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import ReadFile, Session, parse_session

if TYPE_CHECKING:
    from calib_core.optics.board import BoardView
    from calib_core.optics.camera_model import CameraModel
    from calib_core.optics.laser_plane_joint import CameraUncertainty
    from calib_core.optics.laser_plane_solve import PlaneSolution, PlaneView

T = TypeVar("T")

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
SETS = ("tcp-sphere-80mm", "tcp-sphere-25mm")
CAMERAS = ("camera-chessboard", "laser-plane-arm-640", "hand-eye-circles-10x10")
PLANES = ("laser-plane-arm-640", "laser-plane-green-line")
_CHI2_6_95 = 12.6
_MOST_FACTOR = 1.15
_PINHOLE = ("fx", "fy", "cx", "cy")


def run(full: bool) -> list[Row]:
    """Return the rows; `full` takes the twelve halves of the target, otherwise four."""
    if not DATA.is_dir():
        return [Row("real sets beside the project (../shared/data)", "", "not there")]
    tools = [row for name in SETS for row in (*halves(name, 12 if full else 4), diameter(name))]
    count = 40 if full else 8
    halves_of_optics = [*(camera_halves(n, count) for n in CAMERAS), *(plane_halves(n, count) for n in PLANES)]
    return [*tools, *halves_of_optics, *(lines_row(n) for n in PLANES)]


@cache
def measured(name: str) -> tuple[list[SphereObservation], SphereSize]:
    folder = DATA / name
    session = parse_session(json.loads((folder / "session.json").read_text(encoding="utf-8")))
    read = lambda file: (folder / file).read_bytes()  # noqa: E731
    return [observe_capture(session, c, read) for c in session.captures], sphere_of(session.cell, session.captures)


def halves(name: str, count: int) -> list[Row]:
    observations, sphere = measured(name)
    rng = np.random.default_rng(2026)
    squares: list[float] = []
    ratios: list[FloatArray] = []
    while len(squares) < count:
        order = rng.permutation(len(observations))
        some = np.zeros(len(observations), dtype=bool)
        some[order[: len(order) // 2]] = True
        pair = [_solved(observations, sphere, mask) for mask in (some, ~some)]
        tools = [s.joint.mount_from_laser for s in pair]
        off = tools[0].difference(tools[1])
        covariance = pair[0].covariance[:6, :6] + pair[1].covariance[:6, :6]
        squares.append(float(off @ np.linalg.solve(covariance, off)))
        ratios.append(off**2 / np.diag(covariance))
    spread = 1 / np.sqrt(np.mean(ratios, axis=0))
    middle, beyond = float(np.median(squares)), float(np.mean(np.array(squares) > _CHI2_6_95))
    text = " ".join(f"{r:.2f}" for r in spread)
    true = bool(spread.min() > 0.7 and spread.max() < 2)
    return [
        Row(f"{name}: {count} halves, χ² of their difference (6), median", "≤ 8", f"{middle:.2f}", middle <= 8),
        Row(f"{name}: above {_CHI2_6_95}", "≤ 10 %", f"{beyond:.0%}", beyond <= 0.1),
        Row(
            f"{name}: stated / observed spread, rx … tz",
            "0.7 … 2",
            text,
            true,
        ),
    ]


def _solved(observations: list[SphereObservation], sphere: SphereSize, some: np.ndarray) -> TcpSolution:
    return solve_tcp([o for o, good in zip(observations, some, strict=True) if good], sphere)


def diameter(name: str) -> Row:
    """By how many stated sigmas the tool moves as the diameter's sigma is told to be 0, 0.02, 0.05 and 0.1 mm."""
    observations, sphere = measured(name)
    solutions = [solve_tcp(observations, SphereSize(sphere.diameter_mm, s)) for s in (0.0, 0.02, 0.05, 0.1)]
    most = 0.0
    for one in solutions:
        for other in solutions:
            off = one.joint.mount_from_laser.difference(other.joint.mount_from_laser)
            most = max(most, float(np.abs(off / np.sqrt(np.diag(other.covariance)[:6])).max()))
    return Row(f"{name}: tool moves with the diameter's sigma", "≤ 0.3 sigmas", f"{most:.2f}", most <= 0.3)


def opened(name: str) -> tuple[Session, ReadFile]:
    folder = DATA / name
    session = parse_session(json.loads((folder / "session.json").read_text(encoding="utf-8")))
    return session, lambda file: (folder / file).read_bytes()


def random_halves(items: Sequence[T], count: int) -> Iterator[tuple[list[T], list[T]]]:
    rng = np.random.default_rng(2026)
    for _ in range(count):
        order = rng.permutation(len(items))
        middle = len(items) // 2
        yield [items[i] for i in order[:middle]], [items[i] for i in order[middle:]]


def factor_row(what: str, squares: list[float], freedom: int) -> Row:
    """Return by what factor sigmas are too small: the root of the mean χ² over what is expected of it."""
    factor = float(np.sqrt(np.mean(squares) / freedom)) if squares else float("nan")
    return Row(
        f"{what}: {len(squares)} halves, sigmas too small by",
        f"≤ {_MOST_FACTOR:g}",
        f"{factor:.2f}",
        bool(factor <= _MOST_FACTOR),
    )


def camera_halves(name: str, count: int) -> Row:
    """By how much halves of a set's boards differ in focal lengths and principal point, as they state it."""
    from calib_core.captures.boards import board_in
    from calib_core.optics.board import BoardView
    from calib_core.optics.camera import calibrate_camera
    from calib_core.optics.camera_solution import CameraSolution
    from calib_core.optics.robot_lengths import RobotPoses
    from calib_core.robots import parse_pose

    session, read = opened(name)
    board, convention = session.cell.board, session.cell.pose_convention
    assert board is not None
    views: list[tuple[BoardView, RigidTransform | None]] = []
    for capture in session.captures:
        with suppress(CalibrationError):  # dark frames, the stripe alone
            view, told = board_in(capture, board, read), capture.pose if board.fixed else None
            views.append((view, None if told is None else parse_pose(convention, told, capture.id)))

    def solve(half: list[tuple[BoardView, RigidTransform | None]]) -> CameraSolution:
        robot = RobotPoses([p for _, p in half], one_way_up=not any(v.turn_is_ambiguous for v, _ in half))
        return calibrate_camera([v for v, _ in half], views[0][0].image_size, robot=robot)

    squares: list[float] = []
    for pair in random_halves(views, count):
        solved = [solve(half) for half in pair]
        places = [[s.parameters.index(p) for p in _PINHOLE] for s in solved]
        off = np.subtract(*(s.camera.camera_matrix[[0, 1, 0, 1], [0, 1, 2, 2]] for s in solved))
        covariance = sum(s.covariance[np.ix_(p, p)] for s, p in zip(solved, places, strict=True))
        squares.append(float(off @ np.linalg.solve(covariance, off)))
    return factor_row(f"{name}: camera", squares, 4)


class PlaneSet(NamedTuple):
    """A set's camera, its boards that carry the line, and what is known of camera and board besides."""

    camera: "CameraModel"
    views: "list[PlaneView]"
    known: "CameraUncertainty | None"

    def solved(self, views: "Sequence[PlaneView]", unlined: "Sequence[BoardView]" = ()) -> "PlaneSolution":
        """Return the plane by some boards' lines, camera and board's shape by the corners of others too."""
        from calib_core.optics.laser_plane_solve import solve_plane

        known = self.known
        if known is not None and known.boards is not None:
            known = replace(known, boards=(*known.boards, *unlined))
        return solve_plane(self.camera, views, known)


@cache
def plane_set(name: str) -> PlaneSet:
    from calib_core.captures.plane_views import PlaneViews
    from calib_core.captures.solved_optics import camera_of
    from calib_core.stages.laser_plane.solve import known_of
    from calib_core.stages.pipeline import stage_input

    session, read = opened(name)
    camera, result = camera_of(session, read)
    boards, views = PlaneViews(session, camera, read), list["PlaneView"]()
    for capture in session.captures:
        if capture.step == "laser-plane":
            with suppress(CalibrationError):
                views.append(boards.of(capture))
    found = PlaneSet(camera, views, known_of(stage_input(session, "laser-plane", read), camera, result, views))
    used = {view.name for view in found.solved(views).views if view.left_out is None}
    return found._replace(views=[view for view in views if view.name in used])


def lines_row(name: str) -> Row:
    """How far each board's line lies beside the plane of the others on average, by what all of it states.

    Camera and board's shape are those that the product refines with the plane, by the corners of this board too.
    """
    whole = plane_set(name)
    views = whole.views
    solved, off = whole.solved(views), dict[str, float]()
    for place, (view, line) in enumerate(zip(views, solved.lines, strict=True)):
        pixels = solved.camera.project(line.points_in_camera_mm)
        with suppress(CalibrationError):  # lines of the others may lie too close to one another
            others = whole.solved(views[:place] + views[place + 1 :], [view.board])
            off[view.name] = _beside(view, pixels, others)
    worst = max(off, key=off.__getitem__)
    told = f"{off[worst]:.1f} ({worst}) of {len(off)}; next {sorted(off.values())[-2]:.1f}"
    return Row(
        f"{name}: boards' lines beside the plane of the others by their sigmas", "≤ 3", told, off[worst] <= 3
    )


def _beside(view: "PlaneView", here: FloatArray, others: "PlaneSolution") -> float:
    """Return how far a line lies off a plane on average, by the sigmas of its centres and of its board's pose.

    The centres count with what boards' lines are off besides. The plane's own ± is left out: most of it is the
    camera's, which draws all lines alike.
    """
    from calib_core.optics.laser_plane import points_on_board
    from calib_core.optics.laser_plane_solve import posed_board

    camera = others.camera
    pose, covariance = posed_board(camera, view.board, others.shape)

    def off_mm(pixels: FloatArray, step: FloatArray) -> float:
        turned = Rotation.from_matrix(pose.rotation) * Rotation.from_rotvec(step[:3])
        there = RigidTransform.of(turned.as_matrix(), pose.translation_mm + step[3:], "camera", "board")
        points = points_on_board(camera, pixels, there, others.shape)
        return float(np.mean(points @ others.normal)) - others.distance_mm

    none = np.zeros(6)
    slope = np.array([(off_mm(here, step) - off_mm(here, none)) / 1e-4 for step in 1e-4 * np.eye(6)])
    mm_per_px = off_mm(here + view.stripe.across, none) - off_mm(here, none)
    noise_px = others.noise_factor * float(np.median(view.stripe.sigma_px)) / np.sqrt(len(here))
    variance = slope @ covariance @ slope + mm_per_px**2 * (noise_px**2 + others.excess_px**2)
    return abs(off_mm(here, none)) / float(np.sqrt(variance))


def plane_halves(name: str, count: int) -> Row:
    """The same of the plane of light by halves of the boards that carry it, the camera being that of all."""
    from calib_core.optics.laser_plane_solve import solve_plane

    camera, views, _ = plane_set(name)
    squares: list[float] = []
    for pair in random_halves(views, count):
        with suppress(CalibrationError):  # lines of three boards may lie too close to one another
            first, other = (solve_plane(camera, half) for half in pair)
            off = np.append(first.normal - other.normal, first.distance_mm - other.distance_mm)
            inverse = np.linalg.pinv(first.covariance + other.covariance, rcond=1e-9, hermitian=True)
            squares.append(float(off @ inverse @ off))
    return factor_row(f"{name}: plane of light", squares, 3)
