"""Poses between poses, and sweeps that use them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.captures.sweep import read_sweep, sweep_poses
from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.pose_track import interpolate_poses
from calib_core.records import Session, parse_session

SMALL = st.floats(-1, 1)


def pose(vector: tuple[float, ...]) -> RigidTransform:
    return RigidTransform.of(np.array(vector[:3]), 100 * np.array(vector[3:]), "base", "tool0")


@settings(deadline=None)
@given(st.tuples(*[SMALL] * 6), st.tuples(*[SMALL] * 6), st.floats(0, 1))
def test_a_pose_between_two_is_on_the_straight_way(
    first: tuple[float, ...], second: tuple[float, ...], fraction: float
) -> None:
    a, b = pose(first), pose(second)
    (between,) = interpolate_poses([2.0, 4.0], [a, b], [2.0 + 2 * fraction])
    whole, part = a.difference(b), a.difference(between)
    np.testing.assert_allclose(part, fraction * whole, atol=1e-7)


def test_the_track_itself_comes_back_in_any_order() -> None:
    track = [pose((0.1 * k, 0.2, 0.0, k, -k, 0.0)) for k in range(5)]
    order = [3, 0, 4, 1, 2]
    found = interpolate_poses([float(k) for k in order], [track[k] for k in order], np.arange(5.0))
    for got, given_pose in zip(found, track, strict=True):
        np.testing.assert_allclose(got.matrix, given_pose.matrix, atol=1e-12)
    assert (found[0].into, found[0].outof) == ("base", "tool0")


@pytest.mark.parametrize(
    ("times", "wanted", "words"),
    [
        ([0.0, 0.0], [0.0], "stands twice"),
        ([0.0, 1.0], [1.5, 0.5], "1.5 s \\(1 of 2 outside\\)"),
        ([0.0, np.nan], [0.0], "NaN"),
        ([0.0], [0.0], "2 poses and 1 times"),
    ],
)
def test_bad_tracks_say_what_is_wrong(times: list[float], wanted: list[float], words: str) -> None:
    track = [pose((0,) * 6), pose((0.1,) * 6)]
    with pytest.raises(InputError, match=words):
        interpolate_poses(times, track, wanted, "s01")


def session(**fields: object) -> Session:
    capture = {
        "id": "s01",
        "step": "scan",
        "kind": "sweep",
        "files": ["captures/a.csv", "captures/b.csv"],
        **fields,
    }
    return parse_session(
        {"format": "scancell-session/1", "cell": {"pose_convention": "abb"}, "captures": [capture]}
    )


def read(name: str) -> bytes:
    return b"x_mm,z_mm\n" + b"".join(b"%d,%d\n" % (i, 200 if name.endswith("a.csv") else 210) for i in range(20))


def test_a_sweep_gives_each_profile_its_pose() -> None:
    track = [{"t_s": 0.0, "pose": [0, 0, 500, 1, 0, 0, 0]}, {"t_s": 1.0, "pose": [100, 0, 500, 1, 0, 0, 0]}]
    timed = session(timestamps_s=[0.25, 0.75], pose_track=track)
    rows = read_sweep(timed, timed.captures[0], read)
    assert [row[0].translation_mm.tolist() for row in rows] == [[25, 0, 500], [75, 0, 500]]
    assert [row[1][0, 1] for row in rows] == [200, 210]
    given_poses = session(poses=[[25, 0, 500, 1, 0, 0, 0], [75, 0, 500, 1, 0, 0, 0]])
    same = sweep_poses(given_poses.cell, given_poses.captures[0])
    for got, row in zip(same, rows, strict=True):
        np.testing.assert_allclose(got.matrix, row[0].matrix, atol=1e-12)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({}, "'poses', or 'timestamps_s' with 'pose_track'"),
        ({"poses": [[0, 0, 500, 1, 0, 0, 0]]}, "as many poses as files, 2"),
        ({"timestamps_s": [0.0], "pose_track": []}, "as many timestamps_s as files, 2"),
    ],
)
def test_sweeps_without_their_poses_are_refused(fields: dict[str, object], words: str) -> None:
    bad = session(**fields)
    with pytest.raises(InputError, match=words):
        sweep_poses(bad.cell, bad.captures[0])
