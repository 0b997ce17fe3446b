"""A turntable as a rotary axis with the places of a ball on it: c = T + R · Rz(scale · angle) · s_m.

(R, T) is base_from_turntable and s_m the place of the ball's mounting m.  Turning or shifting it about and along
its own z, with every s_m moved back, changes nothing: only the two tilts and the two shifts across z are unknowns,
and the frame's own rule fixes the rest afterwards.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.cell.layout import AXIS_UNKNOWNS, AxisState
from calib_core.frames import FloatArray


@dataclass(frozen=True, eq=False)
class TableReadings:
    """What the captures say of the table.

    Attributes
    ----------
    angles_rad : (K,)
        As read.
    mounts : (K,) int
        Which mounting of the sphere.
    mount_count : int
        How many mountings there are.
    """

    angles_rad: FloatArray
    mounts: np.ndarray
    mount_count: int

    def chosen(self, used: np.ndarray) -> "TableReadings":
        """Return only the captures of a mask (K,)."""
        return replace(self, angles_rad=self.angles_rad[used], mounts=self.mounts[used])


@dataclass(frozen=True, eq=False)
class TableState:
    """One guess of the turntable: R (3, 3) and T (3,) of its frame in base, mounts (M, 3) in it, encoder scale.

    A linear axis `shifts` what it carries: it has no place of its own, and its mounts are in base at zero.
    """

    rotation: FloatArray
    origin: FloatArray
    mounts: FloatArray
    scale: float = 1.0
    shifts: bool = False

    @property
    def mounts_in_base(self) -> FloatArray:
        """The mounts at zero, (M, 3)."""
        return self.mounts if self.shifts else self.mounts @ self.rotation.T + self.origin

    @property
    def axis(self) -> AxisState:
        """The axis alone."""
        return AxisState(self.rotation, self.origin, self.scale)

    def moved(self, step: FloatArray) -> "TableState":
        """Return the guess after a step of the axis and of every mount, (5 + 3 M,)."""
        axis = self.axis.moved(step[:AXIS_UNKNOWNS])
        mounts = self.mounts + step[AXIS_UNKNOWNS:].reshape(-1, 3)
        return TableState(axis.rotation, axis.origin, mounts, axis.scale, self.shifts)

    def centers(self, readings: TableReadings) -> FloatArray:
        """Return where the sphere stands in base, (K, 3), mm."""
        angle = self.scale * readings.angles_rad
        x, y, z = self.mounts[readings.mounts].T
        cosine, sine = np.cos(angle), np.sin(angle)
        return np.column_stack([cosine * x - sine * y, sine * x + cosine * y, z]) @ self.rotation.T + self.origin
