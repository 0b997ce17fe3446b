"""A sphere on a turntable: where it stands in base, as a function of the angle read and of the unknowns.

c = T + R · Rz(scale · angle) · s_m, with base_from_turntable = (R, T) and the place s_m of the sphere's mounting
m.  Turning or shifting base_from_turntable about and along its own z, with every s_m moved back, changes nothing:
only the two tilts and the two shifts across z are unknowns, and the frame's own rule fixes the rest afterwards.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.frames import FloatArray, nearest_rotation, rotation_from_vector

AXIS_UNKNOWNS = 5
"""rx ry (tilts, on the right), tx ty (shifts along T's own x and y), and the encoder's scale; then the mounts."""

SCALE_COLUMN = 4
_STEP_LIMIT = (0.1, 0.1, 20.0, 20.0, 0.05)
_MOUNT_STEP_MM = 20.0


@dataclass(frozen=True, eq=False)
class TableReadings:
    """What the captures say of the table.

    Attributes
    ----------
    angles_rad : (K,)
        As read; anything where the capture is not of the table.
    mounts : (K,) int
        Which mounting of the sphere; −1 where the sphere stands still beside the table.
    mount_count : int
        How many mountings there are.
    """

    angles_rad: FloatArray
    mounts: np.ndarray
    mount_count: int

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return AXIS_UNKNOWNS + 3 * self.mount_count

    def chosen(self, used: np.ndarray) -> "TableReadings":
        """Return only the captures of a mask (K,)."""
        return replace(self, angles_rad=self.angles_rad[used], mounts=self.mounts[used])

    def step_limit(self) -> FloatArray:
        """Return the longest step of each unknown, (size,)."""
        return np.array([*_STEP_LIMIT, *[_MOUNT_STEP_MM] * (3 * self.mount_count)])


@dataclass(frozen=True, eq=False)
class TablePlaces:
    """Where the sphere of each capture of the table stands.

    Attributes
    ----------
    on_table : (K,) bool
    centers : (N, 3)
        In base, mm, of the N captures on the table.
    jacobian : (N, 3, size)
        Of the centres by the unknowns.
    levers : (N, 3)
        Of the centres by the table's angle, mm/rad.
    """

    on_table: np.ndarray
    centers: FloatArray
    jacobian: FloatArray
    levers: FloatArray


@dataclass(frozen=True, eq=False)
class TableState:
    """One guess of the turntable: R (3, 3) and T (3,) of its frame in base, mounts (M, 3) in it, encoder scale."""

    rotation: FloatArray
    origin: FloatArray
    mounts: FloatArray
    scale: float = 1.0

    def moved(self, step: FloatArray) -> "TableState":
        """Return the guess after a step (size,)."""
        turn = rotation_from_vector(np.array([step[0], step[1], 0.0]))
        return TableState(
            nearest_rotation(self.rotation @ turn),
            self.origin + self.rotation[:, :2] @ step[2:4],
            self.mounts + step[AXIS_UNKNOWNS:].reshape(-1, 3),
            self.scale + float(step[SCALE_COLUMN]),
        )

    def step_to(self, other: "TableState") -> FloatArray:
        """Return the step (size,) that leads from this guess to one that is near."""
        turn = self.rotation.T @ other.rotation
        step = np.zeros(AXIS_UNKNOWNS + self.mounts.size)
        step[:2] = 0.5 * (turn[2, 1] - turn[1, 2]), 0.5 * (turn[0, 2] - turn[2, 0])
        step[2:4] = self.rotation[:, :2].T @ (other.origin - self.origin)
        step[SCALE_COLUMN] = other.scale - self.scale
        step[AXIS_UNKNOWNS:] = (other.mounts - self.mounts).ravel()
        return step

    def in_table(self, readings: TableReadings) -> FloatArray:
        """Return the sphere's centres in T as the table has turned, (N, 3), of the captures on the table."""
        on_table = readings.mounts >= 0
        angle = self.scale * readings.angles_rad[on_table]
        x, y, z = self.mounts[readings.mounts[on_table]].T
        cosine, sine = np.cos(angle), np.sin(angle)
        return np.column_stack([cosine * x - sine * y, sine * x + cosine * y, z])

    def places(self, readings: TableReadings) -> TablePlaces:
        """Return where the spheres of the captures stand, and the derivatives."""
        on_table = readings.mounts >= 0
        turned = self.in_table(readings)
        u, v, z = turned.T
        angles, mounts = readings.angles_rad[on_table], readings.mounts[on_table]
        zero = np.zeros_like(u)
        levers = np.column_stack([-v, u, zero])
        columns = np.zeros((len(u), 3, readings.size))  # in T first
        columns[:, :, 0] = np.column_stack([zero, -z, v])
        columns[:, :, 1] = np.column_stack([z, zero, -u])
        columns[:, 0, 2] = columns[:, 1, 3] = 1.0
        columns[:, :, SCALE_COLUMN] = angles[:, None] * levers
        cosine, sine = np.cos(self.scale * angles), np.sin(self.scale * angles)
        rows, first = np.arange(len(u)), AXIS_UNKNOWNS + 3 * mounts
        columns[rows, 0, first], columns[rows, 0, first + 1] = cosine, -sine
        columns[rows, 1, first], columns[rows, 1, first + 1] = sine, cosine
        columns[rows, 2, first + 2] = 1.0
        return TablePlaces(
            on_table,
            turned @ self.rotation.T + self.origin,
            self.rotation @ columns,
            levers @ self.rotation.T,
        )
