"""What a capture holds: the robot's pose, the points of its file, the sphere that they show."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from calib_core.chain.observations import SphereSize
from calib_core.errors import InputError
from calib_core.formats.format import PointKind, Reading
from calib_core.formats.points import known_points, read_file
from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import plural
from calib_core.poses.numbers import parse_pose
from calib_core.records import Capture, Cell
from calib_core.records.callbacks import ReadFile
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
        raise InputError(
            "one file in a {kind} capture", got, "Give each its own capture.", capture.id, kind=capture.kind
        )
    name = capture.files[0]
    if capture.kind in ("profile", "cloud"):
        return read_as(capture, name, read, capture.kind)
    raise InputError(
        "a capture of kind profile, cloud or center",
        "kind '{kind}', which this version cannot turn into points",
        "Export the scanner's calibrated profiles or clouds.",
        capture.id,
        kind=capture.kind,
    )


def read_points(capture: Capture, read: ReadFile) -> FloatArray:
    """Return the points of a profile or cloud capture, (N, 2) or (N, 3), in L; raises as `reading_of`."""
    return known_points(reading_of(capture, read), capture.files[0])


def pose_of(cell: Cell, capture: Capture) -> RigidTransform:
    """Return base_from_tool0 of a capture; raises InputError where its pose is missing or wrong."""
    if capture.pose is None:
        raise InputError(
            "the robot's pose in the capture's field 'pose' ({pose_convention})",
            "none",
            "Read the pose of the flange from the controller and add it.",
            capture.id,
            pose_convention=cell.pose_convention,
        )
    return parse_pose(cell.pose_convention, capture.pose, capture.id)


def sphere_of(cell: Cell, captures: Sequence[Capture]) -> SphereSize:
    """Return the sphere's size; raises InputError where it is missing and a capture needs it."""
    diameter_mm = cell.sphere_diameter_mm
    if diameter_mm is None:
        if any(capture.kind in ("profile", "frame", "sweep") for capture in captures):
            raise InputError(
                "the sphere's diameter in cell.sphere_diameter_mm",
                "none",
                "Add it from the sphere's certificate: profiles cannot be understood without it.",
                "session.json",
            )
        diameter_mm = 1.0  # measured centres do not depend on it
    return SphereSize(diameter_mm, diameter_sigma_mm(cell))


@lru_cache(maxsize=64)
def thinning(count: int) -> NDArray[np.intp]:
    """Return the indices of at most `_PREVIEW_POINTS` points, evenly spread; nobody may change them."""
    return np.unique(np.linspace(0, count - 1, min(count, _PREVIEW_POINTS)).astype(np.intp))


def thinned(points: FloatArray) -> list[list[float]]:
    """Return at most so many of the points (N, 2 or 3) as rows, for drawing."""
    return np.round(points[thinning(len(points))], 4).tolist()
