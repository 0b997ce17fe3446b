"""Which mistake in the poses explains that they do not fit the scans: a convention, a unit, the way round."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.start import centers_of, find_start
from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.records import Capture, Cell
from calib_core.robots import CONVENTIONS, Convention, parse_pose

_LEAST_CAPTURES = 7  # with fewer, a wrong reading may fit well by chance
_MUCH_BETTER = 0.2
_ANGLES = ("ZYX", "XYZ", "ZYZ")
_LENGTHS = {"metres": 1000.0, "centimetres": 10.0, "inches": 25.4}

Reading = Callable[[list[float]], RigidTransform]


def likely_mistake(
    cell: Cell,
    captures: Sequence[Capture],
    observations: Sequence[SphereObservation],
    sphere: SphereSize,
    scatter_mm: float,
) -> str | None:
    """Return the reading of the poses by which the captures fit together far better, as a sentence, if any.

    Parameters
    ----------
    cell : Cell
    captures : those of the observations, among others
    observations : one a capture
    sphere : SphereSize
    scatter_mm : float
        Of the captures about the best answer by the poses as they are read now.
    """
    numbers = {capture.id: capture.pose for capture in captures}
    rows = [numbers[o.capture] for o in observations]
    if len(rows) < _LEAST_CAPTURES or len({o.capture for o in observations}) < len(rows):
        return None
    best_mm, best = _MUCH_BETTER * scatter_mm, None
    for words, reading in _readings(CONVENTIONS[cell.pose_convention]):
        try:
            poses = [reading(row) for row in rows if row is not None]
        except InputError:
            continue
        if len(poses) < len(rows) or _one_orientation(poses):
            continue
        moved = [replace(o, base_from_tool0=pose) for o, pose in zip(observations, poses, strict=True)]
        found_mm = find_start(centers_of(moved, sphere)).scatter_mm
        if found_mm < best_mm:
            best_mm, best = found_mm, words
    if best is None:
        return None
    return f"The captures fit together, to {best_mm:.2f} mm instead of {scatter_mm:.1f} mm, {best}."


def _readings(now: Convention) -> Iterator[tuple[str, Reading]]:
    """Yield other ways to read a pose's numbers, each with when it would be right."""
    others: dict[tuple[str, str, float], list[str]] = {}
    for other in CONVENTIONS.values():
        if other.count == now.count:
            others.setdefault((other.form, other.listed, other.mm_per_unit), []).append(other.name)
    others.pop((now.form, now.listed, now.mm_per_unit))
    for names in others.values():
        said = " or ".join(f"'{name}'" for name in names)
        yield f"if the poses are read as {said}: correct cell.pose_convention", _as(names[0])
    read = _as(now.name)
    if now.form in _ANGLES:
        yield (
            "if the poses' angles are in radians: convert them to degrees",
            lambda row: read([*row[:3], *np.rad2deg(row[3:]).tolist()]),
        )
    for unit, factor in _LENGTHS.items():
        yield (
            f"if the poses' positions are in {unit}: convert them",
            lambda row, factor=factor: _scaled(read(row), factor / now.mm_per_unit),
        )
    yield (
        "if the poses are those of the base in the flange's frame: invert them",
        lambda row: RigidTransform(read(row).inverse().matrix, "base", "tool0"),
    )
    yield (
        "if the poses' rotations are those of the base in the flange's frame: transpose them",
        lambda row: RigidTransform.of(read(row).rotation.T, read(row).translation_mm, "base", "tool0"),
    )


def _as(name: str) -> Reading:
    return lambda row: parse_pose(name, row)


def _scaled(pose: RigidTransform, factor: float) -> RigidTransform:
    return RigidTransform.of(pose.rotation, factor * pose.translation_mm, "base", "tool0")


def _one_orientation(poses: Sequence[RigidTransform]) -> bool:
    """Return whether all poses have one orientation: then positions alone always fit."""
    first = poses[0].rotation
    return all(np.trace(first.T @ pose.rotation) > 1 + 2 * np.cos(np.deg2rad(2.0)) for pose in poses)
