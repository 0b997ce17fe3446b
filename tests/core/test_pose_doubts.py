"""Poses written one way and read another: the mistake is named, and where there is none, none is."""

from collections.abc import Callable

import numpy as np
import pytest

from calib_core.captures.observe import observe_capture
from calib_core.captures.pose_doubts import likely_mistake
from calib_core.chain.observations import SphereSize
from calib_core.chain.start import centers_of, find_start
from calib_core.frames import RigidTransform
from calib_core.records import Session
from calib_core.robots import parse_pose, to_pose
from calib_core.simulation import SimulatedSession, simulate
from calib_core.stages.pipeline import run

SPHERE = SphereSize(40.0)


@pytest.fixture(scope="module")
def cell() -> SimulatedSession:
    return simulate("tcp", 11)


def reread(cell: SimulatedSession, convention: str, write: Callable[[RigidTransform], list[float]]) -> Session:
    """Return the session with its poses written by a function, under a convention's name."""
    record = cell.session.model_dump(mode="json")
    was = record["cell"]["pose_convention"]
    record["cell"]["pose_convention"] = convention
    for capture in record["captures"]:
        capture["pose"] = write(parse_pose(was, capture["pose"]))
    return Session.model_validate(record)


def mistake(cell: SimulatedSession, session: Session) -> str | None:
    observations = [observe_capture(session, c, cell.files.__getitem__) for c in session.captures]
    scatter = find_start(centers_of(observations, SPHERE)).scatter_mm
    return likely_mistake(session.cell, session.captures, observations, SPHERE, scatter)


def in_radians(pose: RigidTransform) -> list[float]:
    numbers = to_pose("kuka", pose)
    return [*numbers[:3], *np.deg2rad(numbers[3:]).tolist()]


def in_centimetres(pose: RigidTransform) -> list[float]:
    numbers = to_pose("fanuc", pose)
    return [*(0.1 * np.array(numbers[:3])).tolist(), *numbers[3:]]


WRONG = {
    "kuka as fanuc": ("fanuc", lambda pose: to_pose("kuka", pose), "read as 'kuka' or 'nachi'"),
    "fanuc as staubli": ("staubli", lambda pose: to_pose("fanuc", pose), "'fanuc' or 'mitsubishi' or 'yaskawa'"),
    "kawasaki as kuka": ("kuka", lambda pose: to_pose("kawasaki", pose), "read as 'kawasaki'"),
    "abb as xyzw": ("quaternion-xyzw", lambda pose: to_pose("abb", pose), "'quaternion-wxyz' or 'abb'"),
    "radians": ("kuka", in_radians, "angles are in radians"),
    "centimetres": ("fanuc", in_centimetres, "positions are in centimetres"),
    "inverted": ("matrix", lambda pose: pose.inverse().matrix.ravel().tolist(), "invert them"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_reading_is_named(cell: SimulatedSession, name: str) -> None:
    convention, write, said = WRONG[name]
    sentence = mistake(cell, reread(cell, convention, write))
    assert sentence is not None
    assert said in sentence


@pytest.mark.parametrize("convention", ["fanuc", "abb", "ur"])
def test_right_poses_are_not_doubted(cell: SimulatedSession, convention: str) -> None:
    assert mistake(cell, reread(cell, convention, lambda pose: to_pose(convention, pose))) is None


def test_the_stage_fails_and_says_it_first(cell: SimulatedSession) -> None:
    session = reread(cell, "staubli", lambda pose: to_pose("fanuc", pose))
    result = run(session, cell.files.__getitem__, "tcp")["tcp"]
    assert result.verdict == "fail"
    assert "read as 'fanuc'" in result.warnings[0]
