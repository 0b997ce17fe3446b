"""Captures of the verification that calibrated: the same files, the same points, or the same poses."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from typing import Final

import numpy as np

from calib_core.chain.observations import Observations, SphereObservation
from calib_core.findings.codes.verify import NOT_HELD_OUT
from calib_core.frames import RigidTransform, vector_from_rotation
from calib_core.records import Capture, ReadFile
from calib_core.records.findings import Finding

_SAME_POINT_MM: Final = 1e-3
_SAME_MM, _SAME_RAD = 0.1, 2e-4  # as controllers report one pose twice


def that_calibrated(
    held_out: Sequence[Capture],
    calibrating: Sequence[Capture],
    seen: Observations,
    seen_when_calibrating: Observations,
    read: ReadFile,
) -> list[Finding]:
    """Return a finding for each way in which captures of the verification are those of the calibration.

    Parameters
    ----------
    held_out, calibrating : sequence of Capture
        None of them excluded.
    seen, seen_when_calibrating : sequence of SphereObservation
        The sphere as they saw it; those of the still sphere alone.
    read : callable
        Returns the bytes of a file by its name in a capture.
    """
    same: dict[str, dict[str, str]] = {
        "files": dict(_same_files(held_out, calibrating, read)),
        "points": dict(_same(seen, seen_when_calibrating, _same_points)),
        "poses": dict(_same(seen, seen_when_calibrating, _same_poses)),
    }
    told: set[str] = set()
    findings: list[Finding] = []
    for how, pairs in same.items():
        own = {name: other for name, other in pairs.items() if name not in told}
        told |= own.keys()
        if own:
            each = {name: {"other": other} for name, other in own.items()}
            findings.append(NOT_HELD_OUT(list(own), each=each, same=how))
    return findings


def _same_files(
    held_out: Sequence[Capture], calibrating: Sequence[Capture], read: ReadFile
) -> Iterator[tuple[str, str]]:
    known = {_content(capture, read): capture.id for capture in calibrating if capture.files}
    for capture in held_out:
        if capture.files and (other := known.get(_content(capture, read))) is not None:
            yield capture.id, other


def _content(capture: Capture, read: ReadFile) -> tuple[str, ...]:
    return tuple(hashlib.sha256(read(name)).hexdigest() for name in capture.files)


_Alike = Callable[[SphereObservation, SphereObservation], bool]


def _same(seen: Observations, before: Observations, alike: _Alike) -> Iterator[tuple[str, str]]:
    for one in seen:
        other = next((other for other in before if alike(one, other)), None)
        if other is not None:
            yield one.capture, other.capture


def _same_points(one: SphereObservation, other: SphereObservation) -> bool:
    points, others = one.points_in_laser_mm, other.points_in_laser_mm
    if points.shape != others.shape:
        return False
    if not len(points):
        return bool(np.abs(one.center_in_laser_mm - other.center_in_laser_mm).max() < _SAME_POINT_MM**2)
    return bool(np.abs(points - others).max() < _SAME_POINT_MM)


def _same_poses(one: SphereObservation, other: SphereObservation) -> bool:
    return is_same_pose(one.base_from_tool0, other.base_from_tool0)


def is_same_pose(one: RigidTransform, other: RigidTransform) -> bool:
    """Return whether a controller may have reported one pose twice."""
    apart = one.inverse() @ other
    turned_rad = float(np.linalg.norm(vector_from_rotation(apart.rotation)))
    return float(np.linalg.norm(apart.translation_mm)) < _SAME_MM and turned_rad < _SAME_RAD
