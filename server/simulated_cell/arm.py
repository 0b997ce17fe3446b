"""The joints of the simulated robot: an arm of UR20's published lengths that reaches the pose it tells."""

import threading

import numpy as np

from calib_core.frames import FloatArray

# a and d in mm, alpha in radians; Denavit and Hartenberg (1955).
_A_MM = (0.0, -862.0, -728.7, 0.0, 0.0, 0.0)
_D_MM = (236.3, 0.0, 0.0, 201.0, 159.3, 154.3)
_ALPHA_RAD = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)
_START = np.array([0.2, -1.2, 1.4, -1.7, -1.6, 0.3])
_ARM_MM = 500.0  # what a radian weighs beside a millimetre
_STEPS = 60
_DAMPING = 1.0
_NEAR = 1e-6


class SimulatedArm:
    """Finds joints by damped Newton steps from those of the pose before: along a way they change little."""

    def __init__(self) -> None:
        self._joints = _START
        self._lock = threading.Lock()

    def joints_rad(self, flange: FloatArray) -> tuple[float, ...]:
        """Return the joints at base_from_tool0 (4, 4), mm; out of reach, the nearest that are found."""
        with self._lock:
            joints = self._joints
            for _ in range(_STEPS):
                off, jacobian = _difference(joints, flange)
                if np.linalg.norm(off) < _NEAR:
                    break
                damped = jacobian.T @ jacobian + _DAMPING * min(1.0, float(off @ off)) * np.eye(6)
                step = np.linalg.solve(damped, jacobian.T @ off)
                joints = joints + step * min(1.0, 0.6 / max(float(np.abs(step).max()), 1e-12))
            self._joints = (joints + np.pi) % (2 * np.pi) - np.pi
            return tuple(map(float, self._joints))


def _difference(joints: FloatArray, flange: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what is missing to the flange, turns weighted to mm, and how the joints change it (6, 6)."""
    frames = _links(joints)
    here = frames[-1]
    turn = flange[:3, :3] @ here[:3, :3].T
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine, cosine = float(np.linalg.norm(axis)) / 2, (float(np.trace(turn)) - 1) / 2
    angle = np.arctan2(sine, cosine)
    rotation = axis / 2 * (angle / sine if sine > 1e-9 else 1.0)
    off = np.concatenate([flange[:3, 3] - here[:3, 3], _ARM_MM * rotation])
    jacobian = np.empty((6, 6))
    for joint in range(6):
        z, origin = frames[joint][:3, 2], frames[joint][:3, 3]
        jacobian[:3, joint] = np.cross(z, here[:3, 3] - origin)
        jacobian[3:, joint] = _ARM_MM * z
    return off, jacobian


def _links(joints: FloatArray) -> list[FloatArray]:
    """Return base_from_link (4, 4) of the base and each of the six links."""
    frames = [np.eye(4)]
    for angle, a, d, alpha in zip(joints, _A_MM, _D_MM, _ALPHA_RAD, strict=True):
        (c, s), (ca, sa) = (np.cos(angle), np.sin(angle)), (np.cos(alpha), np.sin(alpha))
        link = np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])
        frames.append(frames[-1] @ link)
    return frames
