"""The laser's line on a board: which of a frame's centres form it, and how likely chance would make it.

A line counts by how well it is known, not by the share of columns that it fills: broken and faint ones do, as long
as chance would not lay so many centres into one line. Of several that a frame offers, that one is taken which lies
in one plane with those of the other boards.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.optics.board import BoardView
from calib_core.optics.stripe import StripeCenters

Mask = NDArray[np.bool_]
OnBoard = Callable[[FloatArray], FloatArray]
"""From pixels (N, 2) to places (N, 2) on the board, mm."""

_LEAST_POINTS, _LEAST_TOGETHER = 12, 6
# What else a board shows (its squares, tape, reflections) lies alike over a square at most: a line is sure where
# chance would lay so many squares' worth of centres into one less than once in a thousand frames.
_SURE_LOG_CHANCE = -3.0
_UNSURE_LOG_CHANCE = -1.5
_TRIALS = 600
_NEIGHBOURS = 5.0  # centres beside each other that err alike at least
_LEAST_REACH_PX = 0.75
_STRAY_SIGMAS = 4.0
_LEAST_LENGTH_PITCHES = 1.5
_SHEET_PITCHES = (1.0, 2.0, 5.0)  # beyond the outer corners: the squares end, the usual margin, a large sheet
_USUAL_MARGINS = 2
# An edge of the pattern, as strong as the stripe, draws a centre d widths w away by w · exp(−d² / 2): of the
# distances that leave enough centres the farthest is taken; what is left of the pull counts as their error.
_CLEAR_WIDTHS = (3.5, 3.0, 2.5, 1.8)
_ENOUGH_CLEAR, _ENOUGH_SHARE = 30, 0.3
_BLUR_PX = 2.0
_ALONG_GRID_RAD, _AT_MIDDLE, _AT_EDGE = 0.03, 0.2, 0.12
_LEAST_ON_BLACK = 0.1
_WIDE = 0.3  # of the pitch: as wide as a square is no laser's line


@dataclass(frozen=True, eq=False)
class Trace:
    """A straight line that a frame's centres form on a board.

    Attributes
    ----------
    stripe : StripeCenters
        All of the frame's centres.
    on_line, clear : (N,) masks
        Which of them form it, and which of these have no edge of the pattern beside their peak.
    log_chance : float
        Decimal logarithm of how many such lines centres thrown at random would give.
    log_chance_by_squares : float
        The same where what a square shows is thrown as one.
    room_mm : float
        How wide the part of the sheet is on which it was looked for.
    is_doubtful : bool
        Whether it may be the board's pattern, or lies far beside the squares: the other boards' plane must agree.
    scatter_mm, mm_per_px : float
        How far its centres lie beside a straight line, root mean square; how large a pixel is on the board.
    """

    stripe: StripeCenters
    on_line: Mask
    clear: Mask
    log_chance: float
    log_chance_by_squares: float
    room_mm: float
    is_doubtful: bool
    scatter_mm: float
    mm_per_px: float

    @property
    def is_sure(self) -> bool:
        """Whether it is a laser's line, whatever the other boards say."""
        return self.log_chance_by_squares < _SURE_LOG_CHANCE and not self.is_doubtful

    @property
    def is_enough(self) -> bool:
        """Whether it is sure and known well, so that nothing else needs to be looked for."""
        return self.is_sure and int(self.clear.sum()) * self.stripe.together >= _ENOUGH_CLEAR

    @property
    def width_mm(self) -> float:
        """Standard deviation of its peak's shape on the board."""
        return self.stripe.width_px * self.mm_per_px

    @property
    def rank(self) -> tuple[bool, float]:
        """By what the better of two lines is told that are one: by what it tells, if it is sure."""
        each_mm2 = (self.stripe.sigma_px[self.clear] * self.mm_per_px) ** 2 + self.scatter_mm**2
        return self.is_sure, float((1 / each_mm2).sum())


def least_points(stripe: StripeCenters) -> int:
    """Return of how many centres a line is at least: of fewer where each is of several columns."""
    return max(_LEAST_POINTS // stripe.together, _LEAST_TOGETHER)


def find_traces(
    stripes: Sequence[StripeCenters],
    board: BoardView,
    on_board: OnBoard,
    margin_mm: float | None,
    slack_mm: float = 0.0,
) -> list[Trace]:
    """Return the lines that a frame's centres may form, those nearest to the squares first.

    Parameters
    ----------
    stripes : sequence of StripeCenters
        The ways in which the frame's stripe was looked for.
    board : BoardView
    on_board : callable
    margin_mm : float or None
        How far the sheet goes on beyond the squares; None: not told.
    slack_mm : float
        How far from straight a line may be, as on a bent board.
    """
    grid = _Grid.of(board)
    found: list[Trace] = []
    for number, beyond_mm in enumerate(_regions_mm(grid, margin_mm)):
        for stripe in stripes:
            trace = _trace(stripe, grid, on_board, beyond_mm, slack_mm)
            if trace is None:
                continue
            far = margin_mm is None and number >= _USUAL_MARGINS
            found.append(replace(trace, is_doubtful=trace.is_doubtful or far))
        if any(trace.is_enough for trace in found):
            break  # what is known well enough on the squares is not looked for beside them
    return found


@dataclass(frozen=True, eq=False)
class _Grid:
    """A board's corners: the lowest and highest x and y, the pitches, and how large a pixel is on it."""

    low: FloatArray
    high: FloatArray
    pitch: FloatArray
    mm_per_px: float

    @classmethod
    def of(cls, board: BoardView) -> "_Grid":
        corners, pixels = board.points_in_board_mm[:, :2], board.points_px
        steps = np.hypot(*np.diff(corners, axis=0).T)
        mm_per_px = float(np.median(steps / np.maximum(np.hypot(*np.diff(pixels, axis=0).T), 1e-9)))
        levels = [np.unique(np.round(corners[:, k], 6)) for k in (0, 1)]
        pitch = np.array([float(np.diff(each).min()) if len(each) > 1 else float(steps.min()) for each in levels])
        return cls(corners.min(axis=0), corners.max(axis=0), pitch, mm_per_px)

    def cells(self, places: FloatArray) -> NDArray[np.int64]:
        """Return the square (N, 2) in which each place lies; all beyond the outermost squares are one."""
        last = np.rint((self.high - self.low) / self.pitch).astype(int)
        cells = np.floor((places - self.low) / self.pitch).astype(int)
        outside = np.any((cells < -1) | (cells > last), axis=1, keepdims=True)
        return np.where(outside, last + 9, cells)


def _regions_mm(grid: _Grid, margin_mm: float | None) -> list[float]:
    pitch = float(grid.pitch.max())
    if margin_mm is not None:
        return [pitch, pitch + margin_mm] if margin_mm > 0 else [pitch]
    return [pitches * pitch for pitches in _SHEET_PITCHES]


def _trace(
    stripe: StripeCenters, grid: _Grid, on_board: OnBoard, beyond_mm: float, slack_mm: float
) -> Trace | None:
    places = on_board(stripe.pixels)
    low, high = grid.low - beyond_mm, grid.high + beyond_mm
    near = np.flatnonzero(np.all((places > low) & (places < high), axis=1))
    if len(near) < least_points(stripe):
        return None
    spread_px = np.maximum(3.0 * np.median(stripe.sigma_px[near]), _LEAST_REACH_PX)
    reach = float(spread_px) * grid.mm_per_px + slack_mm
    straight = _straight(places[near], reach, least_points(stripe))
    count = int(straight.sum())
    if count < least_points(stripe):
        return None
    on_line = np.zeros(len(places), dtype=bool)
    on_line[near[straight]] = True
    length = float(np.ptp(places[on_line], axis=0).max())
    if length < _LEAST_LENGTH_PITCHES * grid.pitch.min():
        return None
    room = float((high - low).min())
    share = 2 * reach / room
    alike = max(_NEIGHBOURS / stripe.together, 1.0)
    log_chance = _log_chance(len(near) / alike, count / alike, share)
    square = max(alike, float(grid.pitch.min()) / grid.mm_per_px / stripe.together)
    by_squares = _log_chance(len(near) / square, count / square, share)
    if log_chance > _UNSURE_LOG_CHANCE:
        return None
    wide = stripe.width_px * grid.mm_per_px > _WIDE * float(grid.pitch.min())
    doubtful = wide or _is_pattern(places[on_line], grid)
    clear, pull_px = _clear(stripe, places, on_line, grid, on_board)
    stripe = replace(stripe, sigma_px=np.hypot(stripe.sigma_px, pull_px))
    center = places[on_line].mean(axis=0)
    scatter = float(np.linalg.svd(places[on_line] - center, compute_uv=False)[1] / np.sqrt(count))
    return Trace(stripe, on_line, clear, log_chance, by_squares, room, doubtful, scatter, grid.mm_per_px)


def _straight(places: FloatArray, reach: float, least: int) -> Mask:
    """Return which places (N, 2) lie on the line that has most of them within reach."""
    n = len(places)
    rng = np.random.default_rng(0)
    a = rng.integers(n, size=_TRIALS)
    b = (a + rng.integers(1, n, size=_TRIALS)) % n
    along = places[b] - places[a]
    length = np.hypot(*along.T)
    fine = length > 0.1 * float(np.ptp(places, axis=0).max())
    if not fine.any():
        return np.zeros(n, dtype=bool)
    normals = np.stack([-along[fine, 1], along[fine, 0]], axis=1) / length[fine, None]
    distances = np.abs(normals @ places.T - (normals * places[a[fine]]).sum(axis=1)[:, None])
    # A centre counts the more the nearer it is, so that of lines with as many the one amid them is taken.
    weights = np.clip(1 - (distances / reach) ** 2, 0, None).sum(axis=1)
    keep = distances[int(np.argmax(weights))] <= reach
    for _ in range(5):
        if keep.sum() < least:
            break
        center = places[keep].mean(axis=0)
        direction = np.linalg.svd(places[keep] - center, full_matrices=False)[2][0]
        distance = np.abs((places - center) @ np.array([-direction[1], direction[0]]))
        keep = distance <= min(_STRAY_SIGMAS * (1.4826 * float(np.median(distance[keep])) + 1e-9), 1.5 * reach)
    return keep


def _log_chance(count: float, on_line: float, share: float) -> float:
    """Return the decimal logarithm of how many lines with so many of `count` centres chance would give.

    The centres are independent.  Each line takes two to be laid; the others fall onto it with a chance of `share`.
    """
    from scipy.special import betainc

    if on_line <= 2:
        return 0.0
    tail = float(betainc(on_line - 2, max(count - on_line, 1e-9) + 1, min(share, 0.999)))
    return float(np.log10(max(count**2 / 2, 1.0)) + np.log10(max(tail, 1e-300)))


def _is_pattern(places: FloatArray, grid: _Grid) -> bool:
    """Return whether centres lie as a chessboard's own do: along rows or columns, on white or at edges alone."""
    center = places.mean(axis=0)
    direction = np.linalg.svd(places - center, full_matrices=False)[2][0]
    for along in (0, 1):
        if abs(direction[1 - along]) > _ALONG_GRID_RAD:
            continue
        offset = (center[1 - along] - grid.low[1 - along]) / grid.pitch[1 - along]
        if offset < -1.1 or offset > (grid.high - grid.low)[1 - along] / grid.pitch[1 - along] + 1.1:
            return False
        part = abs(offset - np.rint(offset))
        if _AT_EDGE < part < 0.5 - _AT_MIDDLE:
            return False
        parity = np.floor((places[:, along] - grid.low[along]) / grid.pitch[along]).astype(int) % 2
        shares = np.bincount(parity, minlength=2) / len(parity)
        return bool(shares.min() < _LEAST_ON_BLACK or part <= _AT_EDGE)
    return False


def _clear(
    stripe: StripeCenters, places: FloatArray, on_line: Mask, grid: _Grid, on_board: OnBoard
) -> tuple[Mask, float]:
    """Return which centres' peaks lie within one square, and by how much an edge may yet draw them, px."""
    own, along = grid.cells(places), stripe.across[::-1]
    enough = np.clip(_ENOUGH_SHARE * on_line.sum(), least_points(stripe), _ENOUGH_CLEAR / stripe.together)
    beside_px = _BLUR_PX + stripe.blind_px + (stripe.together - 1) / 2
    clear, widths = on_line, 0.0
    for widths in _CLEAR_WIDTHS:
        clear = on_line.copy()
        for probe in (
            *(side * (widths * stripe.width_px + stripe.blind_px) * stripe.across for side in (-1, 1)),
            *(side * beside_px * along for side in (-1, 1)),
        ):
            clear &= (grid.cells(on_board(stripe.pixels + probe)) == own).all(axis=1)
        if clear.sum() >= enough:
            break
    if clear.sum() < least_points(stripe):
        clear, widths = on_line, 0.0
    return clear, stripe.width_px * float(np.exp(-(widths**2) / 2))
