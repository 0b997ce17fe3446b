"""Scan captures as scans: files read on their grid where they have one, every profile with its way into T."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np

from calib_core.captures.content import pose_of, read_as
from calib_core.captures.placement import Placement
from calib_core.captures.stripe_frames import read_profile_frame
from calib_core.captures.sweep import IMAGES, read_sweep, sweep_poses
from calib_core.cell.carriers import scanner_told, stands_still
from calib_core.errors import InputError, MeasurementError
from calib_core.formats.points import known_points
from calib_core.formats.shared.writing import FAR_MM
from calib_core.frames import FloatArray, RigidTransform, stack_matrices
from calib_core.fusion.scan import Scan, SingleArray, as_rows
from calib_core.messages import message, plural
from calib_core.records import Capture, ReadFile, Session

DEFAULT_SIGMA_MM = 0.02
"""Of a cloud without a grid, whose own noise is not estimated."""

_SOME = 1000
_LINES = 300  # of a grid, of which its noise is estimated


@dataclass(frozen=True)
class ScanGroup:
    """Captures that make one scan: one cloud or sweep, or single profiles taken one after the other."""

    captures: tuple[Capture, ...]

    @property
    def name(self) -> str:
        """The capture's id, or the first and the last."""
        first, last = self.captures[0].id, self.captures[-1].id
        return first if first == last else f"{first}…{last}"


class SessionScans(Sequence[Scan]):
    """A session's scans, each read when it is asked for, so that only one is in memory."""

    def __init__(
        self, session: Session, groups: Sequence[ScanGroup], placement: Placement, read: ReadFile
    ) -> None:
        self._session, self._groups, self._placement, self._read = session, list(groups), placement, read

    def read_by(self, read: ReadFile) -> "SessionScans":
        """Return the same scans, their files read in another way."""
        return SessionScans(self._session, self._groups, self._placement, read)

    @property
    def names(self) -> list[str]:
        """The scans' names."""
        return [group.name for group in self._groups]

    @property
    def reader(self) -> ReadFile:
        """What reads their files."""
        return self._read

    def __len__(self) -> int:
        return len(self._groups)

    def __getitem__(self, index: int) -> Scan:  # type: ignore[override]
        """Return one scan; raises InputError where a file, pose or table angle is of no use."""
        return read_scan(self._session, self._groups[index], self._placement, self._read)

    def __iter__(self) -> Iterator[Scan]:
        return (self[index] for index in range(len(self)))


def scan_groups(captures: Sequence[Capture]) -> list[ScanGroup]:
    """Return scans out of captures: neighbouring single profiles that a robot or an axis moves belong together."""
    groups: list[list[Capture]] = []
    for capture in captures:
        last = groups[-1][-1] if groups else None
        single = capture.kind in ("profile", "frame")
        if last is not None and single and _alike(last) == _alike(capture) and not _ended(groups[-1], capture):
            groups[-1].append(capture)
        else:
            groups.append([capture])
    return [ScanGroup(tuple(group)) for group in groups]


def _alike(capture: Capture) -> tuple[object, ...]:
    """Return what profiles of one scan have in common: their kind and their scanner."""
    return capture.kind, capture.scanner


def _ended(group: Sequence[Capture], capture: Capture) -> bool:
    """Return whether the axes stood still for a scan, and have moved; profiles that they take along go on."""
    stood = len(group) > 1 and _readings(group[-1]) == _readings(group[-2])
    return stood and _readings(capture) != _readings(group[-1])


def _readings(capture: Capture) -> tuple[object, ...]:
    return capture.table_deg, capture.axes_deg, capture.axes_mm


def read_scan(session: Session, group: ScanGroup, placement: Placement, read: ReadFile) -> Scan:
    """Return one scan on its grid, with its poses into T.

    Raises
    ------
    InputError
        If a file, a pose or a table angle is of no use, or profiles of one scan differ in their columns.
    """
    first = group.captures[0]
    if first.kind == "center":
        raise InputError("points of the object", "a capture of kind 'center'", "Give it another step.", first.id)
    if first.kind == "cloud":
        points, intensity, near, organised = _cloud(first, read)
        poses, captures = [poses_of(session, group, placement)[0][1]], [first]
    else:
        poses, captures, points, intensity = _profiles(session, group, read, placement)
        points[..., 1] = placement.sheet(first) * points[..., 0] ** 2
        near, organised = RigidTransform.identity("laser", "laser"), len(points) >= 3
    ways = [placement.way(capture, pose) @ near for capture, pose in zip(captures, poses, strict=True)]
    scanner = scanner_told(session.cell, first)
    sigma_mm = scanner.point_sigma_mm or (_noise_mm(points) if organised else DEFAULT_SIGMA_MM)
    looks = None if scanner.z_axis is None else -1 if scanner.z_axis == "toward" else 1
    way = stack_matrices(ways)
    return Scan(group.name, points, way, sigma_mm, organised=organised, looks_along_z=looks, intensity=intensity)


def poses_of(session: Session, group: ScanGroup, placement: Placement) -> list[tuple[Capture, RigidTransform]]:
    """Return each profile's capture and where what carries the scanner is in base, one for a cloud.

    Of an object that the flange carries, where the flange is.
    """
    pairs: list[tuple[Capture, RigidTransform]] = []
    for capture in group.captures:
        if stands_still(session.cell, capture) and not placement.held:
            count = len(capture.files) if capture.kind == "sweep" else 1
            pairs += [(capture, RigidTransform.identity("base", "base"))] * count
        elif capture.kind == "sweep":
            pairs += [(capture, pose) for pose in sweep_poses(session.cell, capture)]
        else:
            pairs.append((capture, pose_of(session.cell, capture)))
    return pairs


def local_origin_mm(points_mm: FloatArray) -> tuple[float, float, float]:
    """Return the zero of coordinates in which single precision holds points (N, 3): 0 unless they lie far off."""
    middle = np.median(points_mm[:: 1 + len(points_mm) // _SOME], axis=0)
    x, y, z = (1000.0 * np.round(middle / 1000.0)).tolist()
    return (x, y, z) if np.abs(middle).max() > FAR_MM else (0.0, 0.0, 0.0)


def _cloud(capture: Capture, read: ReadFile) -> tuple[SingleArray, SingleArray | None, RigidTransform, bool]:
    """Return a cloud's rows (P, C, 3), intensities (P, C), way into L, and whether rows are the scanner's own."""
    if len(capture.files) != 1:
        raise InputError("one file in a cloud", f"{len(capture.files)}", "Give each its own capture.", capture.id)
    name = capture.files[0]
    reading = read_as(capture, name, read, "cloud")
    known = known_points(reading, name)
    origin_mm = local_origin_mm(known)
    near = RigidTransform.of([0.0, 0.0, 0.0], origin_mm, "laser", "laser")
    bright = reading.intensity
    if reading.grid is not None and min(reading.grid) >= 3:
        rows = (reading.points - origin_mm).reshape(*reading.grid, 3).astype(np.float32)
        return rows, None if bright is None else bright.reshape(reading.grid), near, True
    rows = as_rows((known - origin_mm).astype(np.float32))
    return rows, None if bright is None else as_rows(bright[reading.known, None])[..., 0], near, False


def _profiles(
    session: Session, group: ScanGroup, read: ReadFile, placement: Placement
) -> tuple[list[RigidTransform], list[Capture], SingleArray, SingleArray | None]:
    """Return each profile's pose and capture, the points (P, C, 3), and intensities (P, C) where all have some."""
    pairs = poses_of(session, group, placement)
    profiles: list[FloatArray] = []
    bright: list[SingleArray] = []
    names: list[str] = []
    of_frames = False
    for capture in group.captures:
        raw = [PurePosixPath(name).suffix.lower() not in IMAGES for name in capture.files]
        names += capture.files
        if all(raw):
            readings = [read_as(capture, name, read, "profile") for name in capture.files]
            profiles += [one.points for one in readings]
            bright += [one.intensity for one in readings if one.intensity is not None]
            continue
        of_frames = True
        if capture.kind == "sweep":
            profiles += [profile for _, profile in read_sweep(session, capture, read, may_be_blank=True)]
        else:
            profiles.append(read_profile_frame(session, capture, read))
    if of_frames:
        profiles = _on_columns(profiles)
    for name, profile in zip(names, profiles, strict=True):
        if len(profile) != len(profiles[0]):
            raise InputError(
                plural(
                    "{count} column, like the scan's first profile",
                    "{count} columns, like the scan's first profile",
                    by="count",
                    count=len(profiles[0]),
                ),
                f"{len(profile)}",
                "Export every profile with all its columns, blank ones too, or split the scan there.",
                name,
            )
    points = np.zeros((len(profiles), len(profiles[0]), 3), dtype=np.float32)
    points[..., 0::2] = np.array(profiles)
    intensity = np.array(bright) if len(bright) == len(profiles) else None
    return [pose for _, pose in pairs], [capture for capture, _ in pairs], points, intensity


def _on_columns(profiles: Sequence[FloatArray]) -> list[FloatArray]:
    """Return profiles without blanks (N, 2) on common columns, by their x; those of no point are NaN."""
    seen = [profile for profile in profiles if len(profile)]
    if not seen:
        to_do = message("Lengthen the exposure or dim the room, and let the stripe cross the object.")
        raise MeasurementError("a laser stripe in one of the scan's frames", "none", to_do)
    pitch_mm = float(np.median(np.concatenate([np.abs(np.diff(p[:, 0])) for p in seen])))
    low = min(float(p[:, 0].min()) for p in seen)
    high = max(float(p[:, 0].max()) for p in seen)
    if not pitch_mm > 0:
        raise InputError("profiles along x", "points at one x", "Check the plane of light.", "captures")
    rows: list[FloatArray] = []
    for profile in profiles:
        row = np.full((round((high - low) / pitch_mm) + 1, 2), np.nan)
        row[np.round((profile[:, 0] - low) / pitch_mm).astype(int)] = profile
        rows.append(row)
    return rows


def _noise_mm(points: np.ndarray) -> float:
    """Return the noise of a grid's points from third differences along its rows, which a curve has none of."""
    thirds = np.diff(points[:: 1 + len(points) // _LINES, :, 2].astype(float), 3, axis=1)
    known = thirds[np.isfinite(thirds)]
    if known.size < 10:
        return DEFAULT_SIGMA_MM
    return max(1.4826 * float(np.median(np.abs(known))) / np.sqrt(20), 1e-3)
