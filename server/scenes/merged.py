"""The merged cloud of a session, or its scans where none is stored, as thin as a browser bears."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from calib_core.cell.carriers import rides_with_robot
from calib_core.cell.found import ScannerPlaced, known_scanner, on_flange
from calib_core.errors import CalibrationError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import ReadFile, Result, Session
from calib_core.stages.merge.record import MergeResult
from calib_core.steps import table_stages, tool_stages

if TYPE_CHECKING:
    from calib_core.captures.placement import Placement
    from calib_core.captures.scans import ScanGroup

MAX_SCAN_POINTS = 500_000
"""At most this many points of cloud or scans are sent as a whole; with captures and details it stays below 1M."""

MAX_WAITING_POINTS = 120_000
"""At most so many points of scans that wait to be merged: they are sent again as each one comes."""

KnownScans = dict[str, tuple[object, FloatArray, int]]
"""By a scan's name: what it was read from, its points, and how many there were."""

Points = TypeVar("Points", bound=NDArray[Any])

ReadOutput = Callable[[str], bytes | None]
"""Gives a file that a stage made beside its result, by its name; None where there is none."""


@dataclass(frozen=True, eq=False)
class MergedScans:
    """Points of the merged cloud; or of all scans, as they were measured, before cleaning and fusion.

    Attributes
    ----------
    points_mm : (N, 3)
        In `frame`.
    scan : (N,) int
        The number of the scan that each point belongs to; in a merged cloud of the one that weighs most there, −1
        where none does. Empty where a stored cloud does not say.
    names : tuple of str
        The scans' names.
    frame : "turntable", "base" or "tool0"
        The last where the flange holds what was scanned.
    measured : int
        How many points there are before thinning.
    every_mm : (measured, 3) or None
        All points of a merged cloud.
    every_scan : (measured,) int or None
        Of the same points, as `scan`.
    every_intensity : (measured,) or None
        Of the same points.
    waiting : bool
        Whether these are scans that nothing was merged of yet: they are told apart by their colours.
    """

    points_mm: NDArray[np.floating]
    scan: NDArray[np.int64]
    names: tuple[str, ...]
    frame: Literal["turntable", "base", "tool0"]
    measured: int
    every_mm: NDArray[np.floating] | None = None
    every_scan: NDArray[np.int64] | None = None
    every_intensity: NDArray[np.floating] | None = None
    waiting: bool = False

    @property
    def fused(self) -> bool:
        """Whether this is the cleaned and merged cloud."""
        return self.every_mm is not None

    @property
    def intensity(self) -> NDArray[np.floating] | None:
        """How bright each of `points_mm` came back, None where the scans did not say."""
        every = self.every_intensity
        return None if every is None else every[thinned(np.arange(len(every)), MAX_SCAN_POINTS)]

    @property
    def on_table(self) -> bool:
        """Whether its points stand in the turntable's frame."""
        return self.frame == "turntable"

    @property
    def on_flange(self) -> bool:
        """Whether the flange holds what was scanned."""
        return rides_with_robot(self.frame)


def merged_cloud(results: Mapping[str, Result], read: ReadOutput) -> MergedScans | None:
    """Return the cloud that the merge stored, evenly thinned; None where there is none."""
    from calib_core.archive.stored_clouds import read_stored_ply

    merge = results.get("merge")
    if not isinstance(merge, MergeResult) or merge.cloud is None:
        return None
    data = read(merge.cloud)
    if data is None:
        return None
    try:
        stored = read_stored_ply(data, merge.cloud)
    except CalibrationError:
        return None  # an archive's file that another version wrote: the scans are shown
    every, scans = stored.points_mm, stored.scans
    if not len(every):
        return None
    names = merge.scan_names if scans is not None else ()
    if scans is not None and scans.max() >= len(names):
        scans, names = None, ()  # the result beside it is of another merge
    few = thinned(np.arange(len(every)), MAX_SCAN_POINTS)
    shown = scans[few] if scans is not None else np.zeros(0, dtype=np.int64)
    return MergedScans(every[few], shown, names, merge.frame, len(every), every, scans, stored.intensity)


def merged_scans(
    session: Session, results: Mapping[str, Result], read: ReadFile, known: KnownScans | None = None
) -> MergedScans | None:
    """Return the scans that a merge used, before it those that count, evenly thinned; None where none can be read.

    Scans stand where the calibration puts them: nothing is registered here. Each is read once if `known` is kept.
    """
    from calib_core.captures.placement import placement_of
    from calib_core.captures.scans import scan_groups

    scans = [c for c in session.captures if c.step == "scan" and not c.excluded]
    stages = dict.fromkeys((*tool_stages(), *table_stages()))
    solved = [results[stage].model_dump(by_alias=True) for stage in stages if stage in results]
    placement, most = placement_of(session.cell, scans, solved), MAX_WAITING_POINTS
    if placement is None:
        return None
    turned = any(scan.table_deg is not None for scan in scans) or bool(placement.axes)
    merge = results.get("merge")
    if isinstance(merge, MergeResult):
        used = {row.capture for row in merge.residuals if row.used}
        scans, most = [scan for scan in scans if scan.id in used], MAX_SCAN_POINTS
        turned = merge.frame == "turntable"
    if not turned:
        placement = replace(placement, base_from_turntable=None)
    groups = scan_groups(scans)
    known = {} if known is None else known
    waiting = not isinstance(merge, MergeResult)
    basis = (placement.told, waiting)
    placed: dict[str, np.ndarray] = {}
    measured = 0
    for group in groups:
        key = (basis, tuple(group.captures))
        if known.get(group.name, (None,))[0] != key:
            known[group.name] = (key, *_read(session, group, placement, read, most))
        _, points, count = known[group.name]
        if count:
            placed[group.name] = thinned(points, max(most // len(groups), 1))
            measured += count
    for gone in known.keys() - {group.name for group in groups}:
        del known[gone]
    if not measured:
        return None
    numbers = np.repeat(np.arange(len(placed)), [len(cloud) for cloud in placed.values()])
    still = "base" if placement.base_from_turntable is None else "turntable"
    frame = "tool0" if placement.held else still
    points = np.concatenate(list(placed.values()))
    return MergedScans(points, numbers, tuple(placed), frame, measured, waiting=waiting)


def _read(
    session: Session, group: "ScanGroup", placement: "Placement", read: ReadFile, most: int
) -> tuple[FloatArray, int]:
    """Return a scan's points in the frame of all, thinned, and how many there are: none where it is of no use."""
    from calib_core.captures.scans import read_scan

    try:
        scan = read_scan(session, group, placement, read)
    except CalibrationError:
        return np.zeros((0, 3)), 0  # its measurement, or the merge, has said why
    points = _placed(scan.points_in_laser_mm, scan.turntable_from_laser)
    return thinned(points, most), len(points)


def thinned(points: Points, most: int) -> Points:
    """Return at most so many of the rows, evenly chosen in their order."""
    if len(points) <= most:
        return points
    return cast(Points, points[np.linspace(0, len(points) - 1, most).astype(np.int64)])


def scanner_on_flange(session: Session, results: Mapping[str, Result]) -> RigidTransform | None:
    """Return the scanner on the flange by the whole chain, else by the tcp stage, else as it was brought."""
    for stage in (*tool_stages(), *table_stages()):
        result = results.get(stage)
        if isinstance(result, ScannerPlaced) and (found := result.placed_scanner) is not None:
            return found if on_flange(found) else None
    known = known_scanner(session.cell)
    return known if known is not None and on_flange(known) else None


def _placed(points_in_laser: NDArray[np.float32], ways: FloatArray) -> FloatArray:
    """Return the points (N, 3) that came back, brought into one frame by a pose each row or one for all."""
    points = points_in_laser.astype(float)
    moved = np.einsum("pij,pcj->pci", ways[:, :3, :3], points) if len(ways) > 1 else points @ ways[0, :3, :3].T
    moved = moved + ways[:, None, :3, 3]
    return moved[np.isfinite(moved).all(axis=2)]
