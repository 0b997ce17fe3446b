"""What the simulated camera looks at: a plain plane, a board with its pattern, a sphere."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Rectangle = tuple[float, float, float, float]
"""Left, top, right, bottom, mm, from the board's outer corner; y points down the board."""

FloatArray = NDArray[np.float64]
Mask = NDArray[np.bool_]

BoardKind = Literal["chessboard", "charuco", "circles", "asymmetric-circles"]

_MARGIN_PITCHES = 1.5
_BLACK = 0.08
_SHADE_GAP_MM = 1e-3
_ERF_IS_ONE = 6.0
_COARSE_PX = 16


@dataclass(frozen=True, eq=False)
class Hit:
    """Where the pixels' rays meet a surface.

    Parameters
    ----------
    depth_mm : (H, W)
        z in the camera frame; infinity where the ray misses.
    points_mm, normals : (H, W, 3)
        In the camera frame; normals point to the side of the camera.
    """

    depth_mm: FloatArray
    points_mm: FloatArray
    normals: FloatArray


class Surface(Protocol):
    """Something that can be seen and throws shadows."""

    def meet(self, rays: FloatArray) -> Hit:
        """Return where rays (H, W, 3) = (x, y, 1) meet the surface."""
        ...

    def white(self, hit: Hit, blur_px: FloatArray) -> FloatArray:
        """Return how white (0 to 1) the surface is at each pixel (H, W), edges blurred by `blur_px`."""
        ...

    def shades(self, points_mm: FloatArray, source_mm: FloatArray) -> Mask:
        """Return whether the surface stands between points (…, 3) and a light's source (3,)."""
        ...


@dataclass(frozen=True, eq=False)
class PlaneSurface:
    """A boundless even plane, z = 0 of its frame.

    Parameters
    ----------
    camera_from_plane : (4, 4)
        mm.
    whiteness : float
    """

    camera_from_plane: FloatArray
    whiteness: float = 0.8

    def meet(self, rays: FloatArray) -> Hit:
        """Return where rays meet the plane, boundless."""
        normal, origin = self.camera_from_plane[:3, 2], self.camera_from_plane[:3, 3]
        with np.errstate(divide="ignore"):
            depth = (normal @ origin) / (rays @ normal)
        depth = np.where(depth > 0, depth, np.inf)
        points = np.where(np.isfinite(depth), depth, np.nan)[..., None] * rays
        facing = normal if normal @ origin < 0 else -normal
        return Hit(depth, points, np.broadcast_to(facing, points.shape))

    def white(self, hit: Hit, blur_px: FloatArray) -> FloatArray:
        """Return the plane's even whiteness."""
        return np.full(hit.depth_mm.shape, self.whiteness)

    def shades(self, points_mm: FloatArray, source_mm: FloatArray) -> Mask:
        """Return False: what is simulated stands in front of planes."""
        return np.zeros(points_mm.shape[:-1], dtype=bool)


@dataclass(frozen=True, eq=False)
class BoardSurface:
    """A calibration board on white; its frame's origin is the first inner corner or circle.

    Parameters
    ----------
    camera_from_board : (4, 4)
        mm.
    columns, rows : int
        Of inner corners, or of circles.
    pitch_mm : float
    kind : {"chessboard", "charuco", "circles", "asymmetric-circles"}
    whiteness : float
    marker_mm : float
        Of a ChArUco board's markers; its columns and rows count squares, its origin is the outer corner.
    dictionary : str
        Of its markers, as OpenCV names it.
    margin_mm : float or None
        How far its white sheet goes on beyond the squares; None: one and a half pitches.
    bend_mm : float
        How far the middle of its rows stands behind (z away from the camera) their ends.
    """

    camera_from_board: FloatArray
    columns: int = 9
    rows: int = 6
    pitch_mm: float = 10.0
    kind: BoardKind = "chessboard"
    whiteness: float = 0.9
    marker_mm: float = 7.0
    dictionary: str = "DICT_4X4_100"
    margin_mm: float | None = None
    bend_mm: float = 0.0

    def points_on_board_mm(self) -> FloatArray:
        """Return the inner corners or circles' centres (N, 3) in the board's frame, row by row."""
        if self.kind == "charuco":
            i, j = np.meshgrid(np.arange(1, self.columns), np.arange(1, self.rows))
        else:
            i, j = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        x = (2 * i + j % 2) if self.kind == "asymmetric-circles" else i
        flat = [x.ravel() * self.pitch_mm, j.ravel() * self.pitch_mm, np.zeros(i.size)]
        return np.stack(flat, axis=1).astype(float)

    def meet(self, rays: FloatArray) -> Hit:
        """Return where rays meet the board and its white margin."""
        hit = PlaneSurface(self.camera_from_board).meet(rays)
        if self.bend_mm:
            hit = self._bent(rays, hit)
        on_board = self.on_board(hit)
        corners = self.points_on_board_mm()[:, :2]
        beyond = _MARGIN_PITCHES * self.pitch_mm if self.margin_mm is None else self.margin_mm
        margin = self.pitch_mm + beyond
        inside = np.ones(on_board.shape[:2], dtype=bool)
        for k in (0, 1):
            along = on_board[..., k]
            inside &= (along > corners[:, k].min() - margin) & (along < corners[:, k].max() + margin)
        return Hit(np.where(inside, hit.depth_mm, np.inf), hit.points_mm, hit.normals)

    def _bent(self, rays: FloatArray, hit: Hit) -> Hit:
        """Return where rays meet the bent sheet: the plane moved to its height where they met it before."""
        m, x = self.camera_from_board, self.points_on_board_mm()[:, 0]
        middle, half = (x.min() + x.max()) / 2, np.ptp(x) / 2
        for _ in range(4):
            height = self.bend_mm * (1 - ((self.on_board(hit)[..., 0] - middle) / half) ** 2)
            depth = (m[:3, 2] @ m[:3, 3] + np.nan_to_num(height)) / (rays @ m[:3, 2])
            hit = Hit(np.where(np.isfinite(hit.depth_mm), depth, np.inf), depth[..., None] * rays, hit.normals)
        return hit

    def white(self, hit: Hit, blur_px: FloatArray) -> FloatArray:
        """Return the pattern, its edges blurred across by the image's blur laid on the board."""
        on_board = self.on_board(hit)
        if self.kind == "chessboard":
            waves = [self._wave(on_board[..., k], blur_px, n) for k, n in ((0, self.columns), (1, self.rows))]
            dark = 0.5 * (waves[0][1] * waves[1][1] - waves[0][0] * waves[1][0])
        elif self.kind == "charuco":
            dark = self._printed(on_board, blur_px)
        else:
            dark = self._circles(on_board, blur_px)
        return self.whiteness * (1.0 - (1.0 - _BLACK) * np.nan_to_num(dark))

    def shades(self, points_mm: FloatArray, source_mm: FloatArray) -> Mask:
        """Return False: nothing stands behind the board."""
        return np.zeros(points_mm.shape[:-1], dtype=bool)

    def on_board(self, hit: Hit) -> FloatArray:
        """Return x and y (H, W, 2) in the board's frame, mm."""
        m = self.camera_from_board
        x, y, z = np.moveaxis(hit.points_mm - m[:3, 3], -1, 0)
        return np.stack([x * a + y * b + z * c for a, b, c in m[:3, :2].T], axis=-1)

    def _wave(self, u: FloatArray, blur_px: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
        """Return the sign that changes at every edge, and 1 between the outermost edges; both blurred, (H, W)."""
        width = np.sqrt(2) * (blur_px * _slope(u))
        edge = np.clip(np.rint(u / self.pitch_mm), 0, count - 1)  # at the outermost edges the margin begins
        across = _error_function((u - edge * self.pitch_mm) / width)
        low = _error_function((u + self.pitch_mm) / width)
        high = _error_function((count * self.pitch_mm - u) / width)
        inside = 0.25 * (1 + low) * (1 + high)
        return np.where(edge % 2 == 0, across, -across) * inside, inside

    def _printed(self, on_board: FloatArray, blur_px: FloatArray) -> FloatArray:
        """Return how dark the squares and markers of a ChArUco board are: a sum of blurred rectangles."""

        widths = [np.sqrt(2) * blur_px * _slope(on_board[..., k]) for k in (0, 1)]
        dark = np.zeros(on_board.shape[:2])
        margin = 4 * float(max(np.nanmax(w) for w in widths))
        for left, top, right, bottom in charuco_rectangles(
            self.columns, self.rows, self.pitch_mm, self.marker_mm, self.dictionary
        ):
            part = _part_about(on_board, (left - margin, top - margin), (right + margin, bottom + margin))
            if part is None:
                continue
            x, y = on_board[part][..., 0], on_board[part][..., 1]
            near = (x > left - margin) & (x < right + margin) & (y > top - margin) & (y < bottom + margin)
            across = _between(x[near], left, right, widths[0][part][near])
            dark[part][near] += across * _between(y[near], top, bottom, widths[1][part][near])
        return dark

    def _circles(self, on_board: FloatArray, blur_px: FloatArray) -> FloatArray:
        from scipy.special import erf

        radius = (0.5 if self.kind == "asymmetric-circles" else 0.3) * self.pitch_mm
        dark = np.zeros(on_board.shape[:2])
        for center in self.points_on_board_mm()[:, :2]:
            part = _part_about(on_board, center - 3 * radius, center + 3 * radius)
            if part is None:
                continue
            away = on_board[part] - center
            distance = np.hypot(away[..., 0], away[..., 1])
            near = distance < 3 * radius
            blur_mm = blur_px[part] * _slope(distance)
            with np.errstate(divide="ignore", invalid="ignore"):
                dot = 0.5 * (1 - erf((distance - radius) / (np.sqrt(2) * blur_mm)))
            dark[part] = np.where(near, np.maximum(dark[part], dot), dark[part])
        return dark


@dataclass(frozen=True, eq=False)
class SphereSurface:
    """A matt sphere.

    Parameters
    ----------
    center_mm : (3,)
        In the camera frame.
    radius_mm : float
    whiteness : float
    """

    center_mm: FloatArray
    radius_mm: float
    whiteness: float = 0.8

    def meet(self, rays: FloatArray) -> Hit:
        """Return the nearer of the two points where each ray meets the sphere."""
        square = (rays**2).sum(axis=-1)
        half = rays @ self.center_mm
        root = half**2 - square * (self.center_mm @ self.center_mm - self.radius_mm**2)
        depth = (half - np.sqrt(np.where(root >= 0, root, np.nan))) / square
        points = depth[..., None] * rays
        normals = (points - self.center_mm) / self.radius_mm
        return Hit(np.where(np.isfinite(depth) & (depth > 0), depth, np.inf), points, normals)

    def white(self, hit: Hit, blur_px: FloatArray) -> FloatArray:
        """Return the whiteness, less where the surface turns away (Lambert's law, light from the camera)."""
        facing = -(hit.normals * hit.points_mm).sum(axis=-1) / np.linalg.norm(hit.points_mm, axis=-1)
        return self.whiteness * np.clip(np.nan_to_num(facing), 0.0, 1.0)

    def shades(self, points_mm: FloatArray, source_mm: FloatArray) -> Mask:
        """Return whether the way from points to the source runs through the sphere."""
        way = source_mm - points_mm
        start = points_mm - self.center_mm
        square, half = (way**2).sum(axis=-1), (way * start).sum(axis=-1)
        root = half**2 - square * ((start**2).sum(axis=-1) - self.radius_mm**2)
        with np.errstate(invalid="ignore"):
            far = (-half + np.sqrt(np.where(root > 0, root, np.nan))) / square
            return np.nan_to_num(far) > np.sqrt(_SHADE_GAP_MM / np.sqrt(square))


def _part_about(on_board: FloatArray, low: ArrayLike, high: ArrayLike) -> tuple[slice, slice] | None:
    """Return rows and columns of an image (H, W, 2) with all pixels between two corners of the board, and more.

    Looked for at every so many pixels alone; None where there is none.
    """
    coarse = on_board[::_COARSE_PX, ::_COARSE_PX]
    steps = [np.abs(np.diff(coarse, axis=k)).max(initial=0.0) for k in (0, 1)]
    inside = ((coarse > np.subtract(low, sum(steps))) & (coarse < np.add(high, sum(steps)))).all(axis=-1)
    found = np.argwhere(inside)
    if not found.size:
        return None
    first, last = found.min(axis=0), found.max(axis=0)
    down, right = (
        slice(max(_COARSE_PX * (int(a) - 1) - 2, 0), _COARSE_PX * (int(b) + 1) + 3)
        for a, b in zip(first, last, strict=True)
    )
    return down, right


def _between(x: FloatArray, low: float, high: float, width: FloatArray) -> FloatArray:
    """Return 1 between two edges and 0 outside, blurred."""
    return 0.5 * (_error_function((x - low) / width) - _error_function((x - high) / width))


def _slope(values: FloatArray) -> FloatArray:
    """Return how fast values (H, W) change from pixel to pixel."""
    down, right = np.gradient(values)
    return np.hypot(down, right)


def _error_function(x: FloatArray) -> FloatArray:
    """Return erf(x), worked out only where it is not ±1."""
    from scipy.special import erf

    result = np.sign(x)
    near = np.abs(x) < _ERF_IS_ONE
    result[near] = erf(x[near])
    return result


@lru_cache(maxsize=8)
def charuco_rectangles(
    columns: int, rows: int, pitch_mm: float, marker_mm: float, dictionary: str
) -> tuple[Rectangle, ...]:
    """Return all that is black, without overlaps.

    The top left square is black; the markers stand in the white ones, numbered row by row.
    """
    import cv2

    words = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    cells = words.markerSize + 2
    rectangles: list[Rectangle] = []
    marker = 0
    for row in range(rows):
        for column in range(columns):
            left, top = column * pitch_mm, row * pitch_mm
            if row % 2 == column % 2:
                rectangles.append((left, top, left + pitch_mm, top + pitch_mm))
                continue
            bits = np.asarray(cv2.aruco.generateImageMarker(words, marker, cells)) > 0
            marker += 1
            inset = (pitch_mm - marker_mm) / 2
            rectangles += [
                (left + inset + a, top + inset + b, left + inset + c, top + inset + d)
                for a, b, c, d in _black_runs(bits, marker_mm / cells)
            ]
    return tuple(rectangles)


def _black_runs(white: np.ndarray, cell_mm: float) -> list[Rectangle]:
    """Return the black cells of a marker, those that stand beside each other as one rectangle."""
    runs: list[Rectangle] = []
    for row, line in enumerate(white):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], ~line, [0]]).astype(int)))
        for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            runs.append((first * cell_mm, row * cell_mm, last * cell_mm, (row + 1) * cell_mm))
    return runs
