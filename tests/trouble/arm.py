"""A six-axis arm by its Denavit–Hartenberg rows: what it reports, and where its errors bring it."""

from dataclasses import dataclass

import numpy as np

from calib_core.simulation.motion import FloatArray

# a, alpha, d of a welding robot with a reach of about 1.6 m (mm, rad).
_A = np.array([150.0, 700.0, 120.0, 0.0, 0.0, 0.0])
_ALPHA = np.array([-np.pi / 2, 0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, 0.0])
_D = np.array([450.0, 0.0, 0.0, 640.0, 0.0, 100.0])
_HOME = np.array([0.1, -1.2, 0.6, 0.1, 1.0, 0.2])


@dataclass(frozen=True, eq=False)
class ArmErrors:
    """What makes an arm go elsewhere than it reports; zero by default.

    Attributes
    ----------
    joints_rad, lengths_mm, twists_rad : (6,)
        Offsets of the joints' zeros, of a and d of the links, and of alpha.
    gears_rad : (6, 2)
        Amplitude and phase of a once-per-turn error of each gear (ratio 1 : 1 of the last stage).
    sag_rad_per_mm : float
        How far joints 2 and 3 give way by the arm's horizontal reach.
    """

    joints_rad: FloatArray
    lengths_mm: FloatArray
    twists_rad: FloatArray
    gears_rad: FloatArray
    sag_rad_per_mm: float = 0.0

    @classmethod
    def none(cls) -> "ArmErrors":
        """Return those of a perfect arm."""
        return cls(np.zeros(6), np.zeros(6), np.zeros(6), np.zeros((6, 2)))


def flange(joints_rad: FloatArray, errors: ArmErrors | None = None) -> FloatArray:
    """Return base_from_tool0 (4, 4) at joint angles (6,), of the nominal arm or of one with errors."""
    angles, a, alpha = joints_rad, _A, _ALPHA
    if errors is not None:
        angles = angles + errors.joints_rad + errors.gears_rad[:, 0] * np.sin(2 * angles + errors.gears_rad[:, 1])
        a, alpha = a + errors.lengths_mm, alpha + errors.twists_rad
        reach = float(np.hypot(*flange(joints_rad)[:2, 3]))
        angles = angles + errors.sag_rad_per_mm * reach * np.array([0.0, 1.0, 0.6, 0.0, 0.0, 0.0])
    matrix: FloatArray = np.eye(4)
    for theta, length, twist, shift in zip(angles, a, alpha, _D, strict=True):
        c, s, ct, st = np.cos(theta), np.sin(theta), np.cos(twist), np.sin(twist)
        matrix = matrix @ np.array(
            [[c, -s * ct, s * st, length * c], [s, c * ct, -c * st, length * s], [0, st, ct, shift], [0, 0, 0, 1]]
        )
    return matrix


def joints_for(wanted: FloatArray, start: FloatArray | None = None) -> FloatArray:
    """Return joint angles (6,) that bring the nominal arm to a pose (4, 4): damped least squares."""
    joints: FloatArray = _HOME.copy() if start is None else start.copy()
    for _ in range(200):
        off = _difference(flange(joints), wanted)
        if np.abs(off).max() < 1e-9:
            break
        jacobian = np.empty((6, 6))
        for k in range(6):
            step = np.zeros(6)
            step[k] = 1e-6
            jacobian[:, k] = (off - _difference(flange(joints + step), wanted)) / 1e-6
        square = jacobian.T @ jacobian + 1e-6 * np.eye(6)
        move = np.linalg.solve(square, jacobian.T @ off)
        joints = joints + move * min(1.0, 0.3 / max(float(np.abs(move).max()), 1e-12))
    return joints


def _difference(here: FloatArray, there: FloatArray) -> FloatArray:
    """Return position (in metres, to go with radians) and rotation from one pose to another, (6,)."""
    turn = there[:3, :3] @ here[:3, :3].T
    angle = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    scale = angle / np.sin(angle) if 1e-9 < angle < 3.1 else 1.0
    return np.concatenate([(there[:3, 3] - here[:3, 3]) / 1000, axis * scale])
