"""Parts of simple shape with known truth: box, ball, bracket, blade, thin sheet, open bowl.

Each is a closed mesh about the middle of T, and that mesh is the truth.  A bowl is a shell: scanned from above,
little but its inside and its rim is seen.
"""

from collections.abc import Callable

import numpy as np

from calib_core.simulation.motion import FloatArray
from calib_core.simulation.part import PartMesh

Shape = Callable[[], PartMesh]


def box(size_mm: tuple[float, float, float] = (60.0, 40.0, 30.0)) -> PartMesh:
    """Return a box with sharp edges."""
    return _prism(np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array(size_mm[:2]) / 2, size_mm[2])


def bracket() -> PartMesh:
    """Return an angle of two plates, 8 mm thick, 50 mm wide, with a foot of 30 mm."""
    outline = [[-30, -25], [30, -25], [30, -17], [-22, -17], [-22, 25], [-30, 25]]
    return _prism(np.array(outline, dtype=float), 50.0)


def ball(radius_mm: float = 25.0) -> PartMesh:
    """Return a ball; its facets lie at most 4 µm inside of the sphere."""
    return _closed_rings(lambda down: (radius_mm * np.sin(down), -radius_mm * np.cos(down)), 180, 360)


def bowl(radius_mm: float = 40.0, wall_mm: float = 2.0) -> PartMesh:
    """Return a half shell, open upward, with a rounded rim."""
    inner, middle = radius_mm - wall_mm, radius_mm - wall_mm / 2
    outside = np.linspace(0, np.pi / 2, 90)
    rim = np.linspace(0, np.pi, 12)[1:-1]
    inside = outside[::-1]
    across = np.concatenate(
        [radius_mm * np.sin(outside), middle + wall_mm / 2 * np.cos(rim), inner * np.sin(inside)]
    )
    height = np.concatenate([-radius_mm * np.cos(outside), wall_mm / 2 * np.sin(rim), -inner * np.cos(inside)])
    return _turned(across, height + radius_mm / 2, 240)


def blade(length_mm: float = 90.0, chord_mm: float = 40.0, thickness_mm: float = 4.0) -> PartMesh:
    """Return a twisted blade with a rounded nose and a thin tail, closed at both ends."""
    around = np.linspace(0, 2 * np.pi, 160, endpoint=False)
    x = 0.5 * chord_mm * np.cos(around)
    y = 0.5 * thickness_mm * np.sin(around) * (0.6 + 0.4 * np.cos(around)) + 3.0 * np.cos(around) ** 2
    rings = []
    for z in np.linspace(-length_mm / 2, length_mm / 2, 90):
        turn, scale = 0.6 * z / length_mm, 1 - 0.3 * (z / length_mm + 0.5)
        c, s = np.cos(turn), np.sin(turn)
        rings.append(np.column_stack([scale * (c * x - s * y), scale * (s * x + c * y), np.full_like(x, z)]))
    return _tube(np.array(rings))


def sheet(length_mm: float = 80.0, width_mm: float = 60.0, thickness_mm: float = 1.0) -> PartMesh:
    """Return a bent sheet of metal, as thin as one voxel or two."""
    x = np.linspace(-length_mm / 2, length_mm / 2, 81)
    middle = 6 * np.cos(np.pi * x / length_mm)
    slope = np.gradient(middle, x)
    normal = np.column_stack([-slope, np.ones_like(x)]) / np.hypot(slope, 1)[:, None]
    line = np.column_stack([x, middle])
    outline = np.concatenate([line - thickness_mm / 2 * normal, (line + thickness_mm / 2 * normal)[::-1]])
    return _prism(outline, width_mm, quads=True)


SHAPES: dict[str, Shape] = {
    "box": box, "ball": ball, "bracket": bracket, "blade": blade, "sheet": sheet, "bowl": bowl,
}  # fmt: skip


def _prism(outline: FloatArray, height_mm: float, quads: bool = False) -> PartMesh:
    """Return an outline (N, 2), counter-clockwise, drawn out along z; `quads`: its halves face each other."""
    count = len(outline)
    low, high = (np.column_stack([outline, np.full(count, z)]) for z in (-height_mm / 2, height_mm / 2))
    ahead = np.roll(np.arange(count), -1)
    here = np.arange(count)
    walls = np.concatenate(
        [np.column_stack([here, ahead, ahead + count]), np.column_stack([here, ahead + count, here + count])]
    )
    cap = _strip(count) if quads else _ears(outline)
    return PartMesh(np.concatenate([low, high]), np.concatenate([walls, cap[:, ::-1], cap + count]))


def _strip(count: int) -> np.ndarray:
    """Return the triangles of an outline whose first half runs beside its second one."""
    a = np.arange(count // 2 - 1)
    b = count - 1 - a
    return np.concatenate([np.column_stack([a, a + 1, b]), np.column_stack([a + 1, b - 1, b])])


def _ears(outline: FloatArray) -> np.ndarray:
    """Return the triangles of a small outline, by cutting off its ears."""
    left, found = list(range(len(outline))), []
    while len(left) > 3:
        for at in range(len(left)):
            a, b, c = left[at - 1], left[at], left[(at + 1) % len(left)]
            others = outline[[p for p in left if p not in (a, b, c)]]
            if _area(outline[a], outline[b], outline[c]) > 0 and not _inside(
                others, outline[a], outline[b], outline[c]
            ):
                found.append([a, b, c])
                left.pop(at)
                break
    return np.array([*found, left])


def _area(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    ab, ac = b - a, c - a
    return ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]


def _inside(points: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> bool:
    sides = [np.array([_area(p, q, point) for point in points]) for p, q in ((a, b), (b, c), (c, a))]
    return bool(np.any(np.all(np.array(sides) >= 0, axis=0)))


def _closed_rings(
    profile: Callable[[FloatArray], tuple[FloatArray, FloatArray]], rings: int, around: int
) -> PartMesh:
    return _turned(*profile(np.linspace(0, np.pi, rings + 1)), around)


def _turned(across: FloatArray, height: FloatArray, around: int) -> PartMesh:
    """Return what a profile (from the axis, outside first, back to it) is when turned about z."""
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    grid = np.stack(
        [
            across[:, None] * np.cos(angle),
            across[:, None] * np.sin(angle),
            np.repeat(height[:, None], around, axis=1),
        ],
        axis=-1,
    )
    return _cleaned(grid.reshape(-1, 3), _between(len(across), around))


def _tube(rings: FloatArray) -> PartMesh:
    """Return rings (R, A, 3), counter-clockwise seen from above, as a tube closed by fans."""
    count, around = rings.shape[:2]
    points = np.concatenate([rings.reshape(-1, 3), rings[0].mean(axis=0)[None], rings[-1].mean(axis=0)[None]])
    here = np.arange(around)
    ahead = np.roll(here, -1)
    bottom = np.column_stack([ahead, here, np.full(around, count * around)])
    top = np.column_stack([here, ahead, np.full(around, count * around + 1)])
    top[:, :2] += (count - 1) * around
    return _cleaned(points, np.concatenate([_between(count, around), bottom, top]))


def _between(rings: int, around: int) -> np.ndarray:
    here = np.arange(rings * around).reshape(rings, around)
    ahead = np.roll(here, -1, axis=1)
    a, b, c, d = here[:-1], ahead[:-1], ahead[1:], here[1:]
    corners = [np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]
    return np.concatenate([one.reshape(-1, 3) for one in corners])


def _cleaned(points: FloatArray, triangles: np.ndarray) -> PartMesh:
    unique, index = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    triangles = index.ravel()[triangles]
    solid = (np.diff(np.sort(triangles, axis=1), axis=1) > 0).all(axis=1)
    return PartMesh(unique, triangles[solid])
