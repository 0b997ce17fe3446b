"""Cameras from boards that are bent, printed wide, or right: what is found, what is named, and whether ± hold.

The corners come of a forward model of this file's own, or of the real sets beside the project. Beside OpenCV's
calibration and, where Debian's `python3-mrcal` is installed, mrcal's: by the error at corners of views that none
of them was given.
"""

import json
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
from harness import Row, all_kept
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calib_core.captures.boards import board_in, board_of
from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.optics.board import BoardView, points_in_board_mm
from calib_core.optics.camera import CameraOptions, calibrate_camera
from calib_core.optics.camera_evidence import camera_findings
from calib_core.optics.camera_solution import CameraSolution
from calib_core.optics.projection_map import nodes
from calib_core.records import parse_session

SIZE = (1280, 1024)
COLUMNS, ROWS, PITCH_MM = 9, 7, 15.0
NOISE_PX = 0.08
FLAT = np.array([[x * PITCH_MM, y * PITCH_MM, 0.0] for y in range(ROWS) for x in range(COLUMNS)])
MIDDLE_MM = FLAT.mean(axis=0)
PEER = "/usr/bin/python3"
DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
REAL = ("camera-chessboard", "laser-plane-arm-640", "hand-eye-circles-10x10")
Project = Callable[[FloatArray], FloatArray]
"""Gives the pixels (N, 2) of points before a camera (N, 3)."""


@dataclass(frozen=True)
class Lens:
    """A true camera: focal lengths, principal point, and k1 k2 p1 p2 k3."""

    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    bends: tuple[float, float, float, float, float]

    def seen(self, points: FloatArray) -> FloatArray:
        """Return the pixels (N, 2) of points before the camera (N, 3)."""
        x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
        k1, k2, p1, p2, k3 = self.bends
        square = x * x + y * y
        radial = 1 + square * (k1 + square * (k2 + square * k3))
        across = x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x)
        down = y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y
        return np.column_stack([across, down]) * self.focal_px + self.centre_px


@dataclass(frozen=True)
class Grid:
    """A board: how many points along its columns and rows, and where they stand (N, 3), mm."""

    shape: tuple[int, int]
    pitch_mm: float
    points_mm: FloatArray


OURS = Grid((ROWS, COLUMNS), PITCH_MM, FLAT)


@dataclass(frozen=True)
class Seen:
    """A board's points as views show them, each with its places on the board."""

    views: list[BoardView]
    grid: Grid = OURS

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image."""
        return self.views[0].image_size

    def solved(self, bent: bool | None = None) -> CameraSolution:
        """Return what scancell makes of it."""
        return calibrate_camera(self.views, self.size, CameraOptions(refine_board=bent))


def view_of(pixels: FloatArray) -> BoardView:
    """Return a view of the whole board of this file."""
    return BoardView(pixels, FLAT, np.arange(len(FLAT)), SIZE, corner_sigma_px=NOISE_PX)


def drawn(seed: int, views: int, bend_mm: float = 0.0, wide: float = 1.0, turns: int = 0) -> tuple[Lens, Seen]:
    """Return a camera and its views of a board that is bent like a bow, or printed too wide along its rows.

    The bow lies anywhere, or with `turns` along the rows or the columns, as all that is compared can say.
    """
    rng = np.random.default_rng([seed, views])
    focal = rng.uniform(1400, 2600)
    k1 = rng.uniform(-0.25, 0.05)
    lens = Lens(
        (focal, focal * rng.uniform(0.9995, 1.0005)),
        (SIZE[0] / 2 + rng.normal(0, 12), SIZE[1] / 2 + rng.normal(0, 12)),
        (k1, rng.uniform(0, 1) * k1**2 - 0.1 * k1, *rng.normal(0, 4e-4, 2), 0.0),
    )
    board = (FLAT - MIDDLE_MM) * [wide, 1.0, 1.0]
    along = rng.integers(turns) * np.pi / turns if turns else rng.uniform(0, np.pi)
    bow = board[:, 0] * np.cos(along) + board[:, 1] * np.sin(along)
    board[:, 2] = bend_mm * (1 - (bow / np.abs(bow).max()) ** 2)
    found: list[BoardView] = []
    while len(found) < views:
        distance = focal * rng.uniform(0.12, 0.22) * PITCH_MM * COLUMNS / 150
        tilt = rng.uniform(-0.7, 0.7, 2)
        turn = Rotation.from_euler("xyz", [*tilt, rng.uniform(-np.pi, np.pi)]).as_matrix()
        place = np.array([*(rng.uniform(-0.3, 0.3, 2) * SIZE / np.array(lens.focal_px)), 1.0]) * distance
        seen = lens.seen(board @ turn.T + place)
        if ((seen > 5) & (seen < np.array(SIZE) - 6)).all():
            found.append(view_of(seen + rng.normal(0, NOISE_PX, seen.shape)))
    return lens, Seen(found)


def run(full: bool) -> Iterator[Row]:
    """Return the rows of this benchmark; `full` takes the cameras of the figures, otherwise a tenth of them."""
    yield from _boards_that_are_wrong(20 if full else 2)
    yield from _right_ones(200 if full else 20)
    for bend_mm in (0.0, 0.5):
        yield from _beside_peers(
            f"board bent by {bend_mm} mm", partial(_simulated, bend_mm=bend_mm), 20 if full else 2
        )
    for name in REAL if DATA.is_dir() else ():
        yield from _beside_peers(name, partial(_real, name), 20 if full else 2)


def _boards_that_are_wrong(count: int) -> Iterator[Row]:
    for bend_mm in (0.3, 1.0):
        ends = all_kept(
            {f"cameras-bend-{bend_mm}-{s}": partial(_focal_off, s, 14, bend_mm=bend_mm) for s in range(count)}
        )
        within = sum(off <= 3.0 for off, _ in ends)
        what = f"{count} boards bent by {bend_mm} mm, 14 views: focal lengths within 3 stated; worst"
        yield Row(what, "all", f"{within} of {count}; {max(off for off, _ in ends):.1f}", within == count)
    for wide in (1.01, 1.05):
        ends = all_kept({f"cameras-wide-{wide}-{s}": partial(_focal_off, s, 14, wide=wide) for s in range(count)})
        named = sum("board-pitches-differ" in codes for _, codes in ends)
        within = sum(off <= 3.0 for off, _ in ends)
        what = f"{count} boards printed {100 * (wide - 1):.0f} % wide: named; focal lengths within 3 stated"
        yield Row(what, "≥ 95 %", f"{named}; {within} of {count}", named >= 0.95 * count)


def _focal_off(seed: int, views: int, bend_mm: float = 0.0, wide: float = 1.0) -> tuple[float, list[str]]:
    """Return how far the focal lengths are off, in stated standard deviations, and which codes are told."""
    lens, cell = drawn(seed, views, bend_mm, wide)
    solution = cell.solved()
    found = [solution.camera.camera_matrix[k, k] for k in range(2)]
    sigmas = np.sqrt(np.diag(solution.covariance))[:2]
    off = float(np.max(np.abs(np.array(found) - lens.focal_px) / sigmas))
    return off, [one.code for one in camera_findings(solution)]


def _right_ones(count: int) -> Iterator[Row]:
    ends = all_kept({f"cameras-right-{s}": partial(_right, s) for s in range(count)})
    of_board = {"board-pitches-differ", "board-bent", "board-shape-solved"}
    accused = sum(not of_board.isdisjoint(codes) for *_, codes in ends)
    what = f"{count} right cameras of 5 to 20 views: board's pitch or bend named"
    yield Row(what, "≤ 0.5 %", f"{accused}", accused <= 0.005 * count)
    ratio = float(np.sqrt(np.mean([found for found, _, _ in ends]) / np.mean([stated for _, stated, _ in ends])))
    each = float(np.sqrt(np.mean([found / stated for found, stated, _ in ends])))
    what = f"{count} right cameras of 5 to 20 views: projection's error / stated, all together; each alike"
    yield Row(what, "0.8–1.2", f"{ratio:.2f}; {each:.2f}", 0.8 <= each <= 1.2)


def _right(seed: int) -> tuple[float, float, list[str]]:
    """Return the mean square of the projection's error over the image and of what is stated, and the codes."""
    lens, cell = drawn(1000 + seed, 5 + seed % 16)
    solution = cell.solved()
    found, stated = _projection_off(solution, lens), np.array(solution.coverage.projection_sigma_px).ravel()
    known = np.isfinite(stated) & np.isfinite(found)
    codes = [one.code for one in camera_findings(solution)]
    return float(np.mean(found[known] ** 2)), float(np.mean(stated[known] ** 2)), codes


def _projection_off(solution: CameraSolution, lens: Lens) -> FloatArray:
    """Return how far the found camera's rays end from their pixels in the true one, a turn of it taken off."""
    pixels = nodes(SIZE)
    rays = np.column_stack([solution.camera.undistort(pixels), np.ones(len(pixels))])
    has_ray = np.isfinite(rays).all(axis=1)
    whole = np.full(len(pixels), np.nan)
    whole[has_ray] = _turned_onto(lens.seen, rays[has_ray], pixels[has_ray])
    return whole


def _turned_onto(project: Project, rays: FloatArray, pixels: FloatArray) -> FloatArray:
    """Return how far rays end from pixels in a camera (N,), after the turn of all that fits best."""
    turn = np.zeros(3)

    def off(turn: FloatArray) -> FloatArray:
        return project(rays @ Rotation.from_rotvec(turn).as_matrix().T) - pixels

    for _ in range(6):
        slopes = np.stack([(off(turn + step) - off(turn)).ravel() / 1e-6 for step in 1e-6 * np.eye(3)], axis=1)
        turn = turn - np.linalg.lstsq(slopes, off(turn).ravel(), rcond=None)[0]
    return np.linalg.norm(off(turn), axis=1)


Halves = tuple[Seen, Seen]


def _simulated(seed: int, bend_mm: float) -> Halves:
    """Return the halves of 24 views of a bent board."""
    views = drawn(5000 + seed, 24, bend_mm, turns=2)[1].views
    return Seen(views[:12]), Seen(views[12:])


def _real(name: str, seed: int) -> Halves:
    """Return random halves of a real set's boards."""
    whole = _detected(name)
    order = np.random.default_rng(seed).permutation(len(whole.views))
    half = len(order) // 2
    return (
        Seen([whole.views[k] for k in order[:half]], whole.grid),
        Seen([whole.views[k] for k in order[half:]], whole.grid),
    )


@cache
def _detected(name: str) -> Seen:
    """Return the boards that a real set's frames show."""
    folder = DATA / name
    session = parse_session(json.loads((folder / "session.json").read_text(encoding="utf-8")))
    board, found = board_of(session.cell), list[BoardView]()
    for capture in session.captures:
        try:
            found.append(board_in(capture, board, lambda file: (folder / file).read_bytes()))
        except MeasurementError:
            continue
    grid = Grid((board.rows, board.columns), board.pitch_mm, points_in_board_mm(board))
    return Seen([one for one in found if one.is_numbered], grid)


def _beside_peers(what: str, halves: Callable[[int], Halves], splits: int) -> Iterator[Row]:
    """Compare the error at the corners of one half of the views by the other half's camera, and the halves."""
    ends = all_kept({f"cameras-halves-{what}-{s}": partial(_compared, halves, s) for s in range(splits)})
    for place, (told, most) in enumerate((("held-out error", 1.01), ("difference of the halves", 1.05))):
        means = {name: float(np.mean([one[name][place] for one in ends])) for name in ends[0]}
        ratio = means["ours"] / min(mean for name, mean in means.items() if name != "ours")
        beside = ", ".join(f"{name} {mean:.4f}" for name, mean in means.items())
        row = f"{splits} splits, {what}: {told} / the better peer's"
        yield Row(row, f"≤ {most}", f"{ratio:.3f} ({beside} px)", ratio <= most)


def _compared(drawn_halves: Callable[[int], Halves], seed: int) -> dict[str, tuple[float, float]]:
    """Return each one's held-out error and how far the projections of both halves lie apart, RMS px."""
    halves = drawn_halves(seed)
    known = [_by_all(half) for half in halves]
    pixels = nodes(halves[0].size)
    lens = _by_opencv(halves[0])[0]
    rays = np.column_stack([(pixels - lens.centre_px) / lens.focal_px, np.ones(len(pixels))])
    found: dict[str, tuple[float, float]] = {}
    for name, (project, board) in known[0].items():
        other, other_board = known[1][name]
        errors = [_misfit(project, board, halves[1], lens), _misfit(other, other_board, halves[0], lens)]
        apart = _turned_onto(project, rays, other(rays))
        found[name] = (float(np.mean(errors)), float(np.sqrt(np.mean(apart**2))))
    return found


def _by_all(given: Seen) -> dict[str, tuple[Project, FloatArray]]:
    """Return each one's camera and board."""
    flat = given.grid.points_mm
    solution, board = given.solved(), flat.copy()
    if solution.board_shape is not None:
        board[:, 2] = solution.board_shape.heights_mm(flat)
    start, poses = _by_opencv(given)
    found: dict[str, tuple[Project, FloatArray]] = {
        "ours": (solution.camera.project, board),
        "OpenCV": (start.seen, flat),
    }
    if shutil.which(PEER) and subprocess.run([PEER, "-c", "import mrcal"], capture_output=True).returncode == 0:
        lens, bent = _by_mrcal(given, start, poses)
        found["mrcal"] = (lens.seen, bent)
    return found


def _misfit(project: Project, board: FloatArray, given: Seen, lens: Lens) -> float:
    """Return how far corners lie from where a camera has them, the best place of each board given, RMS px."""
    squares = [np.sum(_placed(project, board[view.ids], view, lens) ** 2) for view in given.views]
    return float(np.sqrt(np.sum(squares) / sum(2 * len(view.ids) for view in given.views)))


def _placed(project: Project, board: FloatArray, view: BoardView, lens: Lens) -> FloatArray:
    import cv2
    from scipy.optimize import least_squares

    _, turn, shift = cv2.solvePnP(view.points_in_board_mm, view.points_px, _matrix(lens), np.array(lens.bends))

    def off(pose: FloatArray) -> FloatArray:
        there = board @ Rotation.from_rotvec(pose[:3]).as_matrix().T + pose[3:]
        return (project(there) - view.points_px).ravel()

    scale = np.array([1e-3, 1e-3, 1e-3, 0.1, 0.1, 0.3])
    return least_squares(off, np.concatenate([turn, shift]).ravel(), x_scale=scale).fun


def _matrix(lens: Lens) -> NDArray[np.float64]:
    (fx, fy), (cx, cy) = lens.focal_px, lens.centre_px
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def _by_opencv(given: Seen) -> tuple[Lens, FloatArray]:
    import cv2

    boards = [view.points_in_board_mm.astype(np.float32) for view in given.views]
    pixels = [view.points_px.astype(np.float32)[:, None] for view in given.views]
    _, matrix, bends, turns, shifts = cv2.calibrateCamera(boards, pixels, given.size, np.eye(3), np.zeros(5))
    poses = np.array([np.concatenate([turn, shift]).ravel() for turn, shift in zip(turns, shifts, strict=True)])
    return _lens(np.concatenate([matrix[[0, 1, 0, 1], [0, 1, 2, 2]], bends.ravel()])), poses


def _lens(values: FloatArray) -> Lens:
    fx, fy, cx, cy, *bends = (float(one) for one in values)
    return Lens((fx, fy), (cx, cy), (bends[0], bends[1], bends[2], bends[3], bends[4]))


_MRCAL = """
import json, sys
import mrcal
import numpy as np
told = json.load(sys.stdin)
seen = np.array(told["pixels"])
count = len(seen)
intrinsics, poses = np.array([told["lens"]]), np.array(told["poses"])
poses[:, 3:] /= 1000
observed = seen.reshape(count, told["rows"], told["columns"], 3)
places = np.array([[k, 0, -1] for k in range(count)], dtype=np.int32)
bent = np.zeros(2)
mrcal.optimize(intrinsics, np.zeros((0, 6)), poses, None, observed, places, None, None,
               lensmodel="LENSMODEL_OPENCV5",
               imagersizes=np.array([told["size"]], dtype=np.int32), calobject_warp=bent,
               do_optimize_calobject_warp=True, calibration_object_spacing=told["pitch_mm"] / 1000,
               do_apply_outlier_rejection=False, do_apply_regularization=True, verbose=False)
print(json.dumps([intrinsics[0].tolist(), bent.tolist()]))
"""


def _by_mrcal(given: Seen, start: Lens, poses: FloatArray) -> tuple[Lens, FloatArray]:
    """Return mrcal's camera and bent board: of the same model, from OpenCV's answer, the board's bend solved."""
    (rows, columns), flat = given.grid.shape, given.grid.points_mm
    observed = np.full((len(given.views), len(flat), 3), -1.0)  # without a weight: not seen
    for whole, view in zip(observed, given.views, strict=True):
        whole[view.ids] = np.column_stack([view.points_px, np.ones(len(view.ids))])
    told = {
        "pixels": observed.tolist(),
        "lens": [*start.focal_px, *start.centre_px, *start.bends],
        "poses": poses.tolist(),
        "rows": rows, "columns": columns, "size": given.size, "pitch_mm": given.grid.pitch_mm,
    }  # fmt: skip
    ended = subprocess.run(
        [PEER, "-c", _MRCAL], input=json.dumps(told), capture_output=True, text=True, check=True
    )
    values, bent = json.loads(ended.stdout.splitlines()[-1])
    board, middle = flat.copy(), flat.mean(axis=0)
    across, down = ((flat[:, k] / middle[k] - 1) for k in range(2))
    board[:, 2] = 1000 * (bent[0] * (1 - across**2) + bent[1] * (1 - down**2))
    return _lens(np.array(values)), board
