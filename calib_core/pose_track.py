"""Poses between the poses of a track that was sampled in time."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.messages import plural

_SLACK_S = 1e-3


def interpolate_poses(
    track_times_s: ArrayLike, track: Sequence[RigidTransform], times_s: ArrayLike, where: str = ""
) -> list[RigidTransform]:
    """Return the poses at given times: positions linearly, orientations by slerp between neighbours of the track.

    Parameters
    ----------
    track_times_s : (K,)
        In any order; at least two, all different.
    track : sequence of K RigidTransform
        Between the same two frames.
    times_s : (N,)
        Within the track's time; a millisecond beyond its ends is taken for the end.
    where : str
        Named in errors.

    Returns
    -------
    list of N RigidTransform

    Raises
    ------
    InputError
        If the track has fewer than two poses or repeats a time, or a time lies outside it.
    """
    from scipy.spatial.transform import Rotation, Slerp

    at, wanted = np.asarray(track_times_s, dtype=float), np.asarray(times_s, dtype=float)
    if len(track) < 2 or len(at) != len(track):
        raise InputError(
            "a pose track of at least two poses, each with its time",
            plural(
                "{count} pose and {count_other} times",
                "{count} poses and {count_other} times",
                by="count",
                count=len(track),
                count_other=len(at),
            ),
            "Record the robot's pose from before the first profile to after the last.",
            where,
        )
    order = np.argsort(at)
    at, ordered = at[order], [track[i] for i in order]
    if not (np.isfinite(at).all() and np.isfinite(wanted).all() and (np.diff(at) > 0).all()):
        need = "finite times, each pose of the track at its own"
        raise InputError(need, "NaN or a time that stands twice", "Correct it.", where)
    outside = (wanted < at[0] - _SLACK_S) | (wanted > at[-1] + _SLACK_S)
    if outside.any():
        first = float(wanted[outside][0])
        raise InputError(
            "times within the pose track, {start:g} s to {end:g} s",
            "{first:g} s ({outside} of {count} outside)",
            "Check that scanner and robot share one clock, and record a longer track.",
            where,
            start=at[0],
            end=at[-1],
            first=first,
            outside=int(outside.sum()),
            count=len(wanted),
        )
    wanted = np.clip(wanted, at[0], at[-1])
    rotations = Slerp(at, Rotation.from_matrix([pose.rotation for pose in ordered]))(wanted).as_matrix()
    positions = np.array([pose.translation_mm for pose in ordered])
    moved = np.column_stack([np.interp(wanted, at, positions[:, axis]) for axis in range(3)])
    into, outof = ordered[0].into, ordered[0].outof
    return [RigidTransform.of(r, t, into, outof) for r, t in zip(rotations, moved, strict=True)]
