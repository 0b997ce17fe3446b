"""Sessions whose poses are wrong in every way that users get them wrong: shared by benchmark and tests."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import Session
from calib_core.robots import CONVENTIONS, parse_pose, to_pose

SIX = ("kuka", "fanuc", "staubli", "kawasaki", "ur")
SEVEN = ("quaternion-wxyz", "quaternion-xyzw")
Write = Callable[[RigidTransform], list[float]]


@dataclass(frozen=True)
class Wrong:
    """Poses written in one way and told in another."""

    name: str
    written: Write
    told: str


@dataclass(frozen=True, eq=False)
class Measured:
    """A session, its captures measured, and its true poses."""

    session: Session
    observations: list[SphereObservation]
    sphere: SphereSize

    @property
    def poses(self) -> list[RigidTransform]:
        return [o.base_from_tool0 for o in self.observations]


def wrong_readings() -> Iterator[Wrong]:
    """Give every wrong convention × unit × inverse among conventions with as many numbers."""
    for group in (SIX, SEVEN, ("matrix",)):
        for true in group:
            for told in group:
                for mm_per_unit in (1.0, 1000.0):
                    for inverse in (False, True):
                        if true == told and not inverse and mm_per_unit == CONVENTIONS[told].mm_per_unit:
                            continue
                        way = " inverted" if inverse else ""
                        unit = "mm" if mm_per_unit == 1 else "m"
                        yield Wrong(
                            f"{true} in {unit}{way} told as {told}", writer(true, mm_per_unit, inverse), told
                        )


def writer(convention: str, mm_per_unit: float, inverse: bool) -> Write:
    def write(pose: RigidTransform) -> list[float]:
        numbers = np.array(to_pose(convention, pose.inverse() if inverse else pose))
        factor = CONVENTIONS[convention].mm_per_unit / mm_per_unit
        numbers[[3, 7, 11] if convention == "matrix" else [0, 1, 2]] *= factor
        return numbers.tolist()

    return write


def rewritten(session: Session, told: str, write: Write) -> Session:
    """Return the session with its poses written by a function, under a convention's name."""
    record = session.to_json()
    was = record["cell"]["pose_convention"]
    record["cell"]["pose_convention"] = told
    for capture in record["captures"]:
        capture["pose"] = write(parse_pose(was, capture["pose"]))
    return Session.model_validate(record)


def reordered(session: Session, places: list[int]) -> Session:
    """Return the session with each capture having the pose of another."""
    record = session.to_json()
    poses = [capture["pose"] for capture in record["captures"]]
    for capture, place in zip(record["captures"], places, strict=True):
        capture["pose"] = poses[place]
    return Session.model_validate(record)


def swapped(count: int, rng: np.random.Generator) -> list[int]:
    places = list(range(count))
    one, other = rng.choice(count, 2, replace=False).tolist()
    places[one], places[other] = other, one
    return places


def shifted(count: int, rng: np.random.Generator) -> list[int]:
    first = int(rng.integers(0, count - 3))
    run = list(range(first, count))
    step = int(rng.choice([1, -1]))
    return [*range(first), *(run[-step:] + run[:-step])]


def repaired(session: Session, truth: list[RigidTransform]) -> bool:
    """Return whether the session's poses are the true ones, but for the digits that were written."""
    poses = [parse_pose(session.cell.pose_convention, c.pose or []) for c in session.captures]
    return all(
        np.linalg.norm(p.translation_mm - t.translation_mm) < 0.01 and _turn(p.rotation.T @ t.rotation) < 1e-4
        for p, t, c in zip(poses, truth, session.captures, strict=True)
        if not c.excluded
    )


def _turn(rotation: FloatArray) -> float:
    return float(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1.0, 1.0)))
