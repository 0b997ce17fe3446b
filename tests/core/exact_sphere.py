"""Exact captures of a sphere, without any noise, for tests of what must then come out exactly."""

from dataclasses import dataclass

import numpy as np

from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.frames import FloatArray, RigidTransform, rotation_from_vector

SPHERE = SphereSize(40.0)


@dataclass(frozen=True, eq=False)
class ExactCell:
    """Poses at which a sphere is seen exactly where it should be."""

    tool: RigidTransform
    center_mm: FloatArray
    poses: list[RigidTransform]
    seen_mm: FloatArray

    @property
    def rotations(self) -> FloatArray:
        return np.array([pose.rotation for pose in self.poses])

    @property
    def translations(self) -> FloatArray:
        return np.array([pose.translation_mm for pose in self.poses])

    def profiles(self) -> list[SphereObservation]:
        """The captures as profiles, |y| known and its sign not."""
        return [
            _profile(f"p{k}", pose, seen)
            for k, (pose, seen) in enumerate(zip(self.poses, self.seen_mm, strict=True))
        ]

    def centers(self) -> list[SphereObservation]:
        """The captures as measured centres."""
        return [
            SphereObservation(f"p{k}", pose, "center", np.empty((0, 3)), seen, 1e-6 * np.eye(3))
            for k, (pose, seen) in enumerate(zip(self.poses, self.seen_mm, strict=True))
        ]


def exact_cell(seed: int, turns_rad: FloatArray, tool: RigidTransform | None = None) -> ExactCell:
    """Return a cell seen at given orientations (K, 3), everything else drawn from a seed."""
    rng = np.random.default_rng(seed)
    if tool is None:
        tool = RigidTransform.of(rng.uniform(-2, 2, 3), rng.uniform(-300, 300, 3), "tool0", "laser")
    center = rng.uniform(-1000, 1000, 3)
    nominal = rotation_from_vector(rng.uniform(-2, 2, 3))
    count = len(turns_rad)
    seen = np.column_stack(
        [
            rng.uniform(-20, 20, count),
            rng.uniform(4, 16, count) * rng.choice([-1.0, 1.0], count),
            rng.uniform(150, 230, count),
        ]
    )
    poses: list[RigidTransform] = []
    for turn, place in zip(turns_rad, seen, strict=True):
        rotation = nominal @ rotation_from_vector(turn)
        poses.append(RigidTransform.of(rotation, center - rotation @ tool.apply(place), "base", "tool0"))
    return ExactCell(tool, center, poses, seen)


def turns(seed: int, translations: int, orientations: int) -> FloatArray:
    """Return the rotation vectors of some equal and some different orientations, (K, 3), within ±0.6 rad."""
    rng = np.random.default_rng([seed, 1])
    return np.concatenate([np.zeros((translations, 3)), rng.uniform(-0.6, 0.6, (orientations, 3))])


def _profile(name: str, pose: RigidTransform, seen: FloatArray) -> SphereObservation:
    radius = float(np.sqrt(SPHERE.radius_mm**2 - seen[1] ** 2))
    angle = np.linspace(-1.1, 1.1, 60)
    points = np.column_stack([seen[0] + radius * np.sin(angle), 0 * angle, seen[2] - radius * np.cos(angle)])
    center = np.array([seen[0], 0.0, seen[2]])
    return SphereObservation(name, pose, "profile", points, center, 1e-6 * np.eye(3), radius, 1e-3)
