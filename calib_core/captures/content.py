"""What a capture holds: the robot's pose, the points of its file, the sphere that they show."""

from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from calib_core.cell.carriers import balls_in_sight, stands_apart, told_balls
from calib_core.chain.observations import SphereSize
from calib_core.errors import InputError
from calib_core.formats.format import PointKind, Reading
from calib_core.formats.points import known_points, read_file
from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import plural
from calib_core.poses.numbers import parse_pose
from calib_core.records import Capture, Cell, ReadFile, Sphere
from calib_core.records.sphere_class import diameter_sigma_mm
from calib_core.steps import steps_that_show

_PREVIEW_POINTS = 400


def shows_sphere(capture: Capture) -> bool:
    """Return whether a capture is to show the sphere."""
    return capture.step in steps_that_show("sphere", "sphere-on-table")


def shows_board(capture: Capture) -> bool:
    """Return whether a capture is to show the calibration board."""
    return capture.step in steps_that_show("board")


def read_as(capture: Capture, name: str, read: ReadFile, kind: PointKind) -> Reading:
    """Return the reading of one of a capture's files, in the format and with the settings that it names."""
    return read_file(read(name), name, kind, capture.format, capture.format_settings)


def reading_of(capture: Capture, read: ReadFile) -> Reading:
    """Return the reading of a profile or cloud capture's one file.

    Raises
    ------
    InputError
        If the file is of no use, or the capture has not exactly one.
    """
    if len(capture.files) != 1:
        got = plural("{count} file", "{count} files", by="count", count=len(capture.files))
        to_do = "Give each its own capture."
        raise InputError("one file in a {kind} capture", got, to_do, capture.id, kind=capture.kind)
    name = capture.files[0]
    if capture.kind in ("profile", "cloud"):
        return read_as(capture, name, read, capture.kind)
    got = "kind '{kind}', which this version cannot turn into points"
    to_do = "Export the scanner's calibrated profiles or clouds."
    raise InputError("a capture of kind profile, cloud or center", got, to_do, capture.id, kind=capture.kind)


def read_points(capture: Capture, read: ReadFile) -> FloatArray:
    """Return the points of a profile or cloud capture, (N, 2) or (N, 3), in L; raises as `reading_of`."""
    return known_points(reading_of(capture, read), capture.files[0])


def pose_of(cell: Cell, capture: Capture) -> RigidTransform:
    """Return base_from_tool0 of a capture; raises InputError where its pose is wrong, or needed and missing."""
    if capture.pose is None and stands_apart(cell, capture):
        return RigidTransform.identity("base", "tool0")
    if capture.pose is None:
        need = "the robot's pose in the capture's field 'pose' ({pose_convention})"
        to_do = "Read the pose of the flange from the controller and add it."
        raise InputError(need, "none", to_do, capture.id, pose_convention=cell.pose_convention)
    return parse_pose(cell.pose_convention, capture.pose, capture.id)


def sphere_of(cell: Cell, captures: Sequence[Capture]) -> SphereSize:
    """Return the size of the sphere that captures show, of several the largest.

    Raises
    ------
    InputError
        Where it is missing and a capture needs it.
    """
    if any(c.kind in ("profile", "frame", "sweep") and not sizes_in_sight(cell, c) for c in captures):
        to_do = "Add it from the sphere's certificate: profiles cannot be understood without it."
        raise InputError("the sphere's diameter in cell.sphere_diameter_mm", "none", to_do, "session.json")
    seen = {size for capture in captures for size in sizes_in_sight(cell, capture)}
    own = SphereSize(cell.sphere_diameter_mm or 1.0, diameter_sigma_mm(cell))  # measured centres need none
    return max(seen or _told_sizes(cell, balls_in_sight(cell)) or {own}, key=lambda size: size.diameter_mm)


def sizes_in_sight(cell: Cell, capture: Capture) -> tuple[SphereSize, ...]:
    """Return the sizes of the balls that a capture may show, the largest first; none where none is told."""
    sizes = _told_sizes(cell, balls_in_sight(cell, capture))
    if not sizes and cell.sphere_diameter_mm is not None:
        sizes = {SphereSize(cell.sphere_diameter_mm, diameter_sigma_mm(cell))}
    return tuple(sorted(sizes, key=lambda size: -size.diameter_mm))


def diameter_in_sight_mm(cell: Cell, capture: Capture) -> float | None:
    """Return the diameter of the ball that a capture may show, the largest of several; None where none is told."""
    return next((size.diameter_mm for size in sizes_in_sight(cell, capture)), None)


def own_size(cell: Cell, capture: Capture) -> SphereSize | None:
    """Return the size of the ball that a capture shows, in a cell whose balls differ; None where that is open.

    Raises
    ------
    InputError
        Where it is open, and no other captures tell.
    """
    sizes = sizes_in_sight(cell, capture)
    if len(sizes) > 1 and capture.step != "tcp":
        need = "the sphere that it shows, by its name in the capture's field 'mount'"
        to_do = "Name the sphere of cell.spheres."
        raise InputError(need, "one that may have {count} sizes", to_do, capture.id, count=len(sizes))
    differ = len(_told_sizes(cell, balls_in_sight(cell))) > 1
    return sizes[0] if differ and len(sizes) == 1 else None


def names_by_size(cell: Cell, carrier: str) -> dict[SphereSize, str]:
    """Return the names of the balls that a frame carries by their sizes, of those that have one of their own."""
    names: dict[SphereSize, list[str]] = {}
    for ball in told_balls(cell, carrier):
        for size in _told_sizes(cell, [ball]):
            names.setdefault(size, []).append(ball.name)
    return {size: own[0] for size, own in names.items() if len(own) == 1 and len(names) > 1}


def open_sizes(cell: Cell, capture: Capture) -> tuple[SphereSize, ...]:
    """Return the sizes of which a capture's ball has one, the largest first; none where it is known."""
    sizes = sizes_in_sight(cell, capture)
    return sizes if len(sizes) > 1 else ()


def _told_sizes(cell: Cell, balls: Iterable[Sphere]) -> set[SphereSize]:
    """Return the sizes of balls, the cell's where one has none of its own."""
    return {
        SphereSize(
            diameter_mm, diameter_sigma_mm(cell) if ball.diameter_sigma_mm is None else ball.diameter_sigma_mm
        )
        for ball in balls
        if (diameter_mm := ball.diameter_mm or cell.sphere_diameter_mm) is not None
    }


@lru_cache(maxsize=64)
def thinning(count: int) -> NDArray[np.intp]:
    """Return the indices of at most `_PREVIEW_POINTS` points, evenly spread; nobody may change them."""
    return np.unique(np.linspace(0, count - 1, min(count, _PREVIEW_POINTS)).astype(np.intp))


def thinned(points: FloatArray) -> list[list[float]]:
    """Return at most so many of the points (N, 2 or 3) as rows, for drawing."""
    return np.round(points[thinning(len(points))], 4).tolist()
