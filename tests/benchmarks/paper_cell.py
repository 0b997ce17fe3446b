"""A cell like the paper's: six-axis arm with a scanner, a ball beside a turntable and on it at two heights.

Nothing here is shared with the solvers.  The arm errs as arms of its class do before a tracker, so that errors of
near poses are alike, or by chance at each pose, as much in the mean.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from tests.arm_cell import ARM_KINDS, SimulatedArm, nominal_flange

KIND = ARM_KINDS["large"]
RADIUS_MM, CENTER_SIGMA_MM, POINT_SIGMA_MM = 20.0, 0.03, 0.02
BOARD_MM, BOARD_RAD = 0.03, 2e-4
MIDDLE_RAD = np.deg2rad([0.0, 10.0, 0.0, 0.0, 45.0, 0.0])
WHITE_MM, WHITE_RAD = 0.3, 3e-4

Errors = Literal["arm", "white"]


def turn(vector: np.ndarray) -> np.ndarray:
    """A rotation (3, 3) by a vector."""
    angle = float(np.linalg.norm(vector))
    if angle == 0:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def pose(rotation: np.ndarray, place: np.ndarray) -> np.ndarray:
    """A transform (4, 4)."""
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = rotation, place
    return made


def vector_of(rotation: np.ndarray) -> np.ndarray:
    """The vector of a small rotation."""
    skew = (rotation - rotation.T) / 2
    return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])


def joints_of(wanted: np.ndarray) -> np.ndarray:
    """The joints, rad, with which the controller believes its flange at a pose."""
    joints = MIDDLE_RAD.copy()
    for _ in range(60):
        now = nominal_flange(KIND, joints)
        off = np.concatenate([(wanted[:3, 3] - now[:3, 3]) / 1000, vector_of(wanted[:3, :3] @ now[:3, :3].T)])
        if np.abs(off).max() < 1e-10:
            return joints
        columns = []
        for joint in range(6):
            moved = joints.copy()
            moved[joint] += 1e-6
            then = nominal_flange(KIND, moved)
            turned = vector_of(then[:3, :3] @ now[:3, :3].T)
            columns.append(np.concatenate([(then[:3, 3] - now[:3, 3]) / 1000, turned]) / 1e-6)
        step = np.linalg.lstsq(np.array(columns).T, off, rcond=None)[0]
        joints = joints + step * min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-12))
    raise AssertionError("a pose that the arm does not reach")


@dataclass(frozen=True, eq=False)
class Shot:
    """One look at the ball: what the controller says, and what the scanner sees."""

    joints_rad: np.ndarray
    told: np.ndarray
    center_mm: np.ndarray
    board: np.ndarray
    angle_rad: float
    mount: int
    cap_mm: np.ndarray


@dataclass(frozen=True, eq=False)
class PaperCell:
    """The truth, and what was captured; `touched_mm` is the ball as a pointed tool on the arm finds it."""

    tool: np.ndarray
    ball_mm: np.ndarray
    axis_point_mm: np.ndarray
    axis_direction: np.ndarray
    on_table_mm: np.ndarray
    touched_mm: np.ndarray
    still: list[Shot]
    table: list[Shot]
    scans: list[Shot]

    def record(self, arm_known: bool) -> dict[str, Any]:
        """The session's record, of looks at the ball alone."""
        names = ("a_mm", "alpha_deg", "d_mm", "theta_deg")
        arm = {"joints": [dict(zip(names, row, strict=True)) for row in KIND.rows]}
        captures = [
            {
                "id": f"{step}-{n:02d}", "step": step, "kind": "center", "center_mm": shot.center_mm.tolist(),
                "pose": shot.told.ravel().tolist(),
                **({"joints_deg": np.rad2deg(shot.joints_rad).tolist()} if arm_known else {}),
                **({"table_deg": float(np.rad2deg(shot.angle_rad)), "mount": f"m{shot.mount}"}
                   if step == "turntable" else {}),
            }
            for step, shots in (("tcp", self.still), ("turntable", self.table))
            for n, shot in enumerate(shots)
        ]  # fmt: skip
        robot = {"arm": arm, "errors": "apply"} if arm_known else {}
        cell = {"pose_convention": "matrix", "sphere_diameter_mm": 2 * RADIUS_MM, "robot": robot}
        return {"format": "scancell-session/1", "name": "paper", "cell": cell, "captures": captures}


def simulate(seed: int, errors: Errors) -> PaperCell:
    """A cell with 4 translations and 10 orientations, 8 angles at 2 heights, and 12 scans of the ball on it."""
    rng = np.random.default_rng([seed, 77])
    arm = SimulatedArm.drawn(KIND, 1.0, rng)
    tool = pose(
        turn(np.array([0.0, 0.0, -1.6])) @ turn(rng.uniform(-0.2, 0.2, 3)),
        rng.uniform(-10, 10, 3) + np.array([35, -120, 140]),
    )
    start = nominal_flange(KIND, MIDDLE_RAD)
    looking = start[:3, :3]
    ball = (start @ tool @ np.array([0.0, 0.0, 300.0, 1.0]))[:3]
    direction = turn(rng.uniform(-0.03, 0.03, 3)) @ np.array([0.0, 0.0, 1.0])
    point = ball - [60.0, 20.0, 150.0]
    on_table = np.array([[90.0, 10.0, 60.0], [80.0, -20.0, 220.0]])

    def actual(joints: np.ndarray, told: np.ndarray) -> np.ndarray:
        if errors == "arm":
            return arm.flange(joints, 0.0, None)
        return told @ pose(turn(WHITE_RAD * rng.standard_normal(3)), WHITE_MM * rng.standard_normal(3))

    def look(rotation: np.ndarray, center: np.ndarray, angle: float = 0.0, mount: int = 0) -> Shot:
        seen = np.array([*rng.uniform(-40, 40, 2), rng.uniform(260, 340)])
        wanted = pose(rotation, center - rotation @ (tool[:3, :3] @ seen + tool[:3, 3]))
        joints = joints_of(wanted)
        told = nominal_flange(KIND, joints)
        scanner = actual(joints, told) @ tool
        inside = scanner[:3, :3].T @ (center - scanner[:3, 3])
        board = pose(scanner[:3, :3].T, inside) @ pose(
            turn(BOARD_RAD * rng.standard_normal(3)), BOARD_MM * rng.standard_normal(3)
        )
        normals = rng.standard_normal((400, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        normals = normals[normals[:, 2] < -0.5]
        cap = inside + normals * (RADIUS_MM + POINT_SIGMA_MM * rng.standard_normal((len(normals), 1)))
        return Shot(joints, told, inside + CENTER_SIGMA_MM * rng.standard_normal(3), board, angle, mount, cap)

    def swung(most: float) -> np.ndarray:
        return looking @ turn(rng.uniform(-most, most, 3))

    def placed(angle: float, mount: int) -> np.ndarray:
        return point + turn(angle * direction) @ on_table[mount]

    still = [look(looking, ball) for _ in range(4)] + [look(swung(0.4), ball) for _ in range(10)]
    angles = 2 * np.pi * np.arange(8) / 8
    table = [look(swung(0.3), placed(a, m), a, m) for m in (0, 1) for a in angles]
    around = 2 * np.pi * np.arange(12) / 12
    scans = [look(swung(0.4), placed(a, 0), a, 0) for a in around]
    touching = joints_of(pose(looking, ball - looking @ [0.0, 0.0, 200.0]))
    told = nominal_flange(KIND, touching)
    tip = np.linalg.inv(actual(touching, told)) @ [*ball, 1.0]
    touched = (told @ tip)[:3] + 0.05 * rng.standard_normal(3)
    return PaperCell(tool, ball, point, direction, on_table, touched, still, table, scans)
