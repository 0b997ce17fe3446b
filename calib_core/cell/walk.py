"""The way from a scanner to the ball that it sees, and what an error of the robot's pose moves on it.

The scanner is mounted on the flange or stands in base; the ball stands in base (or on the turntable there) or is
carried by the flange.  A point q of L lies at ball_from_scanner(k) · mount_from_laser · q of what carries the
ball.  The way leads over the robot where one of the two alone is on the flange: forwards with the scanner there,
backwards with the ball.  Then the pose's error acts, with the lever from the flange to the ball; otherwise it
moves nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib_core.frames import FloatArray, RigidTransform, skew

Carrier = Literal["tool0", "base"]
"""The frames that carry scanners and balls; a turntable stands in base."""


@dataclass(frozen=True)
class Carriers:
    """What carries the scanner, and what the ball."""

    scanner: Carrier = "tool0"
    ball: Carrier = "base"

    @property
    def over_robot(self) -> int:
        """1 where the way from scanner to ball leads from the flange to base, −1 the other way, 0 not over it."""
        return (self.ball == "base") - (self.scanner == "base")

    def ball_from_scanner(self, base_from_tool0: RigidTransform) -> RigidTransform:
        """Return the transform between the two that carry, at a pose of the robot."""
        if self.over_robot == 0:
            return RigidTransform.identity(self.ball, self.scanner)
        return base_from_tool0 if self.over_robot > 0 else base_from_tool0.inverse()


@dataclass(frozen=True, eq=False)
class Walk:
    """The ways of K captures.

    Attributes
    ----------
    rotations, translations : (K, 3, 3), (K, 3)
        base_from_tool0 as recorded, mm.
    over_robot : (K,)
        As `Carriers` has it.
    """

    rotations: FloatArray
    translations: FloatArray
    over_robot: FloatArray

    @classmethod
    def of(cls, poses: Sequence[RigidTransform], carriers: Sequence[Carriers]) -> "Walk":
        """Return the ways of captures with the robot's poses."""
        return cls(
            np.array([pose.rotation for pose in poses]).reshape(-1, 3, 3),
            np.array([pose.translation_mm for pose in poses]).reshape(-1, 3),
            np.array([float(one.over_robot) for one in carriers]),
        )

    def chosen(self, which: np.ndarray) -> "Walk":
        """Return those of some captures."""
        return Walk(self.rotations[which], self.translations[which], self.over_robot[which])

    @property
    def poses(self) -> tuple[FloatArray, FloatArray]:
        """Rotations and translations."""
        return self.rotations, self.translations

    def laser_from_base(self, mount_rotation: FloatArray) -> FloatArray:
        """Return how balls move in L with the reported position of the flange in base, (K, 3, 3).

        The axes of base as L sees them; against them where the flange carries the ball.

        Parameters
        ----------
        mount_rotation : (3, 3)
            Of mount_from_laser.
        """
        if (self.over_robot > 0).all():
            return mount_rotation.T @ np.swapaxes(self.rotations, 1, 2)
        axes = np.where((self.over_robot > 0)[:, None, None], np.swapaxes(self.rotations, 1, 2), np.eye(3))
        return self.over_robot[:, None, None] * (mount_rotation.T @ axes)

    def levers(
        self, mount_rotation: FloatArray, mount_translation: FloatArray, centers_in_laser: FloatArray
    ) -> FloatArray:
        """Return from the flange to each ball, (K, 3), along the axes of L, mm.

        Parameters
        ----------
        mount_rotation, mount_translation : (3, 3), (3,)
            Of mount_from_laser.
        centers_in_laser : (K, 3)
            Where the balls are seen.
        """
        from_mount = centers_in_laser + mount_rotation.T @ mount_translation
        if (self.over_robot > 0).all():
            return from_mount
        flange = np.where((self.over_robot < 0)[:, None], self.translations @ mount_rotation, 0.0)
        return np.where((self.over_robot != 0)[:, None], from_mount - flange, 0.0)

    def moves(self, laser_from_base: FloatArray, levers: FloatArray) -> FloatArray:
        """Return how balls move in L by the robot's error along and about base's axes, (K, 3, 6), mm and mm/rad.

        The error is the reported position less the true one, and the turn from the reported orientation to the
        true one.

        Parameters
        ----------
        laser_from_base, levers : (K, 3, 3), (K, 3)
            As the methods of these names return them.
        """
        in_base = np.einsum("kji,kj->ki", laser_from_base, levers) * self.over_robot[:, None]
        return np.concatenate([laser_from_base, laser_from_base @ skew(in_base)], axis=2)
