"""Arms that err as trackers find them, before a tracker: the ball on the flange, its centre seen from beside.

Its own forward model: joints that turn about axes which are a little off, with offsets, gears that ripple and lag,
coupling, links that sag, a base that warms and a cable that pulls.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib_core.records import Session
from calib_core.simulation.motion import FloatArray


@dataclass(frozen=True)
class ArmKind:
    """An arm's rows (a mm, alpha deg, d mm, theta deg) and how far arms of its class err, standard deviations.

    Attributes
    ----------
    rows : (6, 4)
    offset_rad, link_mm, axis_rad : float
        Of joints' zeros, of lengths, and of angles between axes.
    sag_rad : float
        By which the second and third joint sag, stretched out.
    coupling, ripple_rad, backlash_rad, warm_mm, cable_mm : float
        Of the wrist's joints by the one before; of gears, once and twice a turn; of a joint by the side it comes
        from; along z over a session; at the flange, with the wrist's turn.
    """

    rows: tuple[tuple[float, float, float, float], ...]
    offset_rad: float = 1e-3
    link_mm: float = 0.3
    axis_rad: float = 4e-4
    sag_rad: float = 4e-4
    coupling: float = 1e-4
    ripple_rad: float = 1e-4
    backlash_rad: float = 5e-5
    warm_mm: float = 0.03
    cable_mm: float = 0.03


def _spherical(d1: float, a1: float, a2: float, a3: float, d4: float, d6: float) -> Any:
    return (
        (a1, -90, d1, 0), (a2, 0, 0, -90), (a3, -90, 0, 0), (0, 90, d4, 0), (0, -90, 0, 0), (0, 0, d6, 180),
    )  # fmt: skip


def _offset_wrist(a2: float, a3: float, d1: float, d4: float, d5: float, d6: float) -> Any:
    return (
        (0, 90, d1, 0), (a2, 0, 0, 0), (a3, 0, 0, 0), (0, 90, d4, 0), (0, -90, d5, 0), (0, 0, d6, 0),
    )  # fmt: skip


ARM_KINDS: dict[str, ArmKind] = {
    "desktop": ArmKind(_spherical(135, 0, 135, 38, 120, 70), 2e-3, 0.2, 6e-4, 2e-4, 2e-4, 2e-4, 1e-4, 0.02, 0.05),
    "small": ArmKind(_spherical(290, 0, 270, 70, 302, 72), 1.2e-3, 0.25, 5e-4, 3e-4),
    "cobot": ArmKind(_offset_wrist(-612.7, -571.55, 180.7, 174.15, 119.85, 116.55), 1.5e-3, 0.4, 6e-4, 6e-4),
    "medium": ArmKind(_spherical(475, 150, 600, 120, 720, 85), 8e-4, 0.3, 4e-4, 4e-4, 1e-4, 8e-5),
    "large": ArmKind(_spherical(630, 175, 900, 175, 960, 135), 6e-4, 0.4, 3e-4, 4e-4, 1e-4, 6e-5, 4e-5),
    "heavy": ArmKind(_spherical(675, 350, 1150, 41, 1000, 215), 5e-4, 0.5, 2.5e-4, 5e-4, 5e-5, 5e-5, 4e-5, 0.06),
}
"""Six classes of arms, from a desk to 200 kg."""

_SWING_DEG = {
    "wide": (90.0, 45.0, 40.0, 110.0, 80.0, 150.0),
    "usual": (50.0, 30.0, 30.0, 45.0, 40.0, 60.0),
    "near": (30.0, 20.0, 20.0, 25.0, 25.0, 30.0),
}
_MIDDLE_DEG = {False: (0.0, 10.0, 0.0, 0.0, 45.0, 0.0), True: (0.0, -70.0, 80.0, -100.0, -90.0, 0.0)}


@dataclass(frozen=True, eq=False)
class SimulatedArm:
    """One arm of a kind, as it is."""

    kind: ArmKind
    changes: FloatArray
    sag: FloatArray
    coupling: FloatArray
    ripple: FloatArray
    backlash: FloatArray
    warm_mm: float
    cable_mm: FloatArray

    @classmethod
    def drawn(cls, kind: ArmKind, size: float, rng: np.random.Generator) -> "SimulatedArm":
        """Return one of a kind whose errors are `size` times the usual ones; zero: a right one."""
        links, turns = (6, 2), (6, 4)
        changes = np.zeros((6, 5))
        changes[:, [0, 2]] = rng.normal(0, kind.link_mm, links)
        changes[:, [1, 4]] = rng.normal(0, kind.axis_rad, links)
        changes[:, 3] = rng.normal(0, kind.offset_rad, 6)
        ripple = rng.normal(0, kind.ripple_rad, turns)
        ripple[:, [1, 3]] = rng.uniform(0, 2 * np.pi, links)
        ripple[:, [0, 2]] *= size
        return cls(
            kind,
            size * changes,
            size * np.abs(rng.normal(0, kind.sag_rad, 2)),
            size * rng.normal(0, kind.coupling, 2),
            ripple,
            size * rng.normal(0, kind.backlash_rad, 6),
            size * float(rng.normal(0, kind.warm_mm)),
            size * rng.normal(0, kind.cable_mm, 3),
        )

    def flange(self, joints_rad: FloatArray, share: float = 0.0, side: FloatArray | None = None) -> FloatArray:
        """Return where the flange truly is, (4, 4), at a share of the session, joints coming from a side (6,)."""
        q = joints_rad.copy()
        a, b, c, d = self.ripple.T
        q += a * np.sin(joints_rad + b) + c * np.sin(2 * joints_rad + d)
        q += self.backlash * (np.zeros(6) if side is None else side)
        q[4:] += self.coupling * joints_rad[3:5]
        rows = np.array(self.kind.rows)
        reach = np.abs(rows[1, 0]) + np.abs(rows[2, 0]) + np.abs(rows[3, 2])
        nominal = _chain(rows, joints_rad, np.zeros((6, 5)))
        out = np.hypot(nominal[0, 3], nominal[1, 3]) / reach
        q[1:3] += self.sag * out * np.array([1.0, 0.6])
        found = _chain(rows, q, self.changes)
        found[:3, 3] += [0.0, 0.0, self.warm_mm * share]
        found[:3, 3] += self.cable_mm * np.sin(joints_rad[3:6])
        return found


def nominal_flange(kind: ArmKind, joints_rad: FloatArray) -> FloatArray:
    """Return where a kind's controller believes its flange, (4, 4)."""
    return _chain(np.array(kind.rows), joints_rad, np.zeros((6, 5)))


def _chain(rows: FloatArray, joints: FloatArray, changes: FloatArray) -> FloatArray:
    found = np.eye(4)
    for (a, alpha, d, theta), q, (da, dalpha, dd, dtheta, beta) in zip(rows, joints, changes, strict=True):
        turn, twist = np.deg2rad(theta) + q + dtheta, np.deg2rad(alpha) + dalpha
        c, s, ca, sa = np.cos(turn), np.sin(turn), np.cos(twist), np.sin(twist)
        found = found @ np.array(
            [
                [c, -s * ca, s * sa, (a + da) * c],
                [s, c * ca, -c * sa, (a + da) * s],
                [0, sa, ca, d + dd],
                [0, 0, 0, 1],
            ]
        )
        tilt = np.eye(4)
        tilt[0, 0] = tilt[2, 2] = np.cos(beta)
        tilt[0, 2], tilt[2, 0] = np.sin(beta), -np.sin(beta)
        found = found @ tilt
    return found


@dataclass(frozen=True, eq=False)
class ArmCell:
    """A session of an arm before a tracker, and as many poses again that it has not: (H, 6), (H, 4, 4), (H, 3)."""

    session: Session
    arm: SimulatedArm
    base_from_laser: FloatArray
    ball_in_tool0: FloatArray
    held_joints_deg: FloatArray
    held_poses: FloatArray
    held_centers: FloatArray


def simulate_arm(
    kind: str | ArmKind,
    seed: int,
    captures: int = 30,
    *,
    size: float = 1.0,
    swing: str = "usual",
    tracker_sigma_mm: float = 0.02,
    held: int = 200,
    errors: str | None = None,
    bumped_deg: Sequence[float] | None = None,
) -> ArmCell:
    """Return a cell of one arm of a kind; random poses, of which some are the session's.

    Parameters
    ----------
    kind : str or ArmKind
        A name is of `ARM_KINDS`.
    seed : int
    captures : int
    size : float
        Of the arm's errors; zero is a right arm.
    swing : {"wide", "usual", "near"}
        How far the joints move.
    tracker_sigma_mm : float
    held : int
        How many poses more.
    errors : str, optional
        As `cell.robot.errors`.
    bumped_deg : (6,), optional
        By which zeros of the same arm moved since: a later session of it, from other poses.
    """
    rng = np.random.default_rng([seed, 37])
    made = ARM_KINDS[kind] if isinstance(kind, str) else kind
    arm = SimulatedArm.drawn(made, size, rng)
    if bumped_deg is not None:
        changes = arm.changes.copy()
        changes[:, 3] += np.deg2rad(bumped_deg)
        arm, rng = replace(arm, changes=changes), np.random.default_rng([seed, 38])
    cobot = made.rows[0][1] > 0
    count = captures + held
    middle, swings = np.deg2rad(_MIDDLE_DEG[cobot]), np.deg2rad(_SWING_DEG[swing])
    joints: FloatArray = np.rad2deg(middle + rng.uniform(-1, 1, (count, 6)) * swings).round(4)
    ball, turned = np.array([0.0, 0.0, 90.0]) + rng.uniform(-60, 60, 3), rng.normal(size=4)
    base_from_laser = np.eye(4)
    base_from_laser[:3, :3] = _rotation(turned / np.linalg.norm(turned))
    base_from_laser[:3, 3] = [2500.0, -800.0, 300.0]
    laser_from_base = np.linalg.inv(base_from_laser)
    shares = np.concatenate([np.linspace(-1, 1, captures), rng.uniform(-1, 1, held)])
    sides = np.sign(rng.normal(size=(count, 6)))
    nominal = np.array([nominal_flange(made, np.deg2rad(row)) for row in joints])
    true = np.array([arm.flange(np.deg2rad(q), s, e) for q, s, e in zip(joints, shares, sides, strict=True)])
    in_base = true[:, :3, :3] @ ball + true[:, :3, 3]
    seen = in_base @ laser_from_base[:3, :3].T + laser_from_base[:3, 3]
    seen += rng.normal(0, tracker_sigma_mm, (count, 3))
    names = "a_mm", "alpha_deg", "d_mm", "theta_deg"
    robot: dict[str, Any] = {"arm": {"joints": [dict(zip(names, row, strict=True)) for row in made.rows]}}
    if errors is not None:
        robot["errors"] = errors
    record = {
        "format": "scancell-session/1",
        "name": f"simulated {kind if isinstance(kind, str) else 'other'} arm before a tracker, seed {seed}",
        "cell": {
            "arrangement": "sphere-on-robot",
            "pose_convention": "matrix",
            "scanner": {"point_sigma_mm": tracker_sigma_mm},
            "robot": robot,
        },
        "captures": [
            {
                "id": f"p{n + 1:03d}", "step": "tcp", "kind": "center", "center_mm": seen[n].tolist(),
                "pose": nominal[n].ravel().tolist(), "joints_deg": joints[n].tolist(),
            }
            for n in range(captures)
        ],
    }  # fmt: skip
    return ArmCell(
        Session.model_validate(record),
        arm,
        base_from_laser,
        ball,
        joints[captures:],
        nominal[captures:],
        seen[captures:],
    )


def later_on_an_arm(
    kind: str,
    seed: int,
    step: str,
    *,
    bumped_deg: Sequence[float] = (0.0,) * 6,
    tool_mm: float = 0.0,
    ball_mm: float = 0.0,
    errors: str | None = None,
) -> Session:
    """Return a session of a scanner on an arm and a still ball, and captures since, zeros, scanner or ball moved.

    Parameters
    ----------
    kind, seed
        Of `simulate_arm`, 30 captures.
    step : {"recheck", "verify"}
        Eight of the same poses, or twelve others.
    bumped_deg : (6,)
        By which zeros moved since.
    tool_mm, ball_mm : float
        By which scanner and ball moved since.
    errors : str, optional
        As `cell.robot.errors`.
    """
    cell, rng = simulate_arm(kind, seed, 30, held=12, errors=errors), np.random.default_rng([seed, 39])
    changes = cell.arm.changes.copy()
    changes[:, 3] += np.deg2rad(bumped_deg)
    bumped, data = replace(cell.arm, changes=changes), cell.session.to_json()
    tool0_from_laser = np.eye(4)
    tool0_from_laser[:3, 3] = [60.0, -40.0, 120.0]
    ball = np.array([450.0, 20.0, 150.0, 1.0])

    def seen(joints_deg: Any, arm: SimulatedArm, off: tuple[float, float]) -> list[float]:
        flange = arm.flange(np.deg2rad(joints_deg), 0.0, np.sign(rng.normal(size=6)))
        in_laser = np.linalg.inv(flange @ tool0_from_laser) @ (ball + np.array([0.0, off[1], 0.0, 0.0]))
        found: list[float] = (in_laser[:3] + np.array([off[0], 0.0, 0.0]) + rng.normal(0, 0.02, 3)).tolist()
        return found

    del data["cell"]["arrangement"]
    for capture in data["captures"]:
        capture["center_mm"] = seen(capture["joints_deg"], cell.arm, (0.0, 0.0))
    if step == "recheck":
        since = [{**data["captures"][k], "id": f"r{k:02d}"} for k in range(0, 30, 4)]
    else:
        others = zip(cell.held_joints_deg.tolist(), cell.held_poses, strict=True)
        since = [
            {**data["captures"][0], "id": f"v{k:02d}", "joints_deg": joints, "pose": pose.ravel().tolist()}
            for k, (joints, pose) in enumerate(others)
        ]
    for capture in since:
        again = seen(capture["joints_deg"], bumped, (tool_mm, ball_mm))
        data["captures"].append({**capture, "step": step, "center_mm": again})
    return Session.model_validate(data)


def later_before_a_tracker(
    kind: str | ArmKind,
    seed: int,
    captures: int,
    *,
    swing: str = "usual",
    errors: str | None = None,
    mm: float = 0.0,
) -> Session:
    """Return a session of `simulate_arm` and 30 captures of other poses since, to verify; it moved by `mm`."""
    cell = simulate_arm(kind, seed, captures, swing=swing, errors=errors, held=30)
    data = cell.session.to_json()
    if errors is None:
        data["cell"]["robot"] = {}
    others = zip(cell.held_joints_deg.tolist(), cell.held_poses, cell.held_centers, strict=True)
    data["captures"] += [
        {
            **data["captures"][0], "id": f"v{k:02d}", "step": "verify", "joints_deg": joints,
            "pose": pose.ravel().tolist(), "center_mm": (seen + np.array([mm, 0.0, 0.0])).tolist(),
        }
        for k, (joints, pose, seen) in enumerate(others)
    ]  # fmt: skip
    return Session.model_validate(data)


def _rotation(q: FloatArray) -> FloatArray:
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def held_out_rms_mm(cell: ArmCell, base_from_laser: FloatArray, ball: FloatArray, poses: FloatArray) -> float:
    """Return by how much an answer predicts the held-out centres wrong, RMS in 3-D, by poses (H, 4, 4) of them."""
    in_base = poses[:, :3, :3] @ ball + poses[:, :3, 3]
    seen = (in_base - base_from_laser[:3, 3]) @ base_from_laser[:3, :3]
    return float(np.sqrt(np.mean(np.sum((seen - cell.held_centers) ** 2, axis=1))))
