"""Before any capture: from how many on an arm's own errors are worth to be solved with the tool.

Everything is linear: a still ball seen from poses around it tells tool, ball and the arm's terms (`arms.errors`),
each believed as large as arms of its class have it.  What counts is where other poses then put points, all over
the space in front of the arm, against each other: a shift or turn of all of them together is the base's.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.arms.errors import arm_moves, arm_terms, reach_of
from calib_core.arms.inverse import joints_of_poses
from calib_core.arms.kinematics import flange_of_joints, joint_lines
from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform, rotation_from_vector, skew
from calib_core.messages import message
from calib_core.records import ArmTable, Record

COUNTS = (8, 12, 15, 20, 30, 45, 60)
_BETTER = 0.95  # less is not worth telling joints
_REST_MM = 0.1  # that its terms leave
_MOUNT, _SEEN = np.array([100.0, 0.0, 100.0]), np.array([100.0, 0.0, 300.0])  # scanner, and ball, in tool0
_TURN_RAD, _SPREAD_MM = np.deg2rad(60.0), 25.0
_HELD, _DRAWN, _TRIES, _SEED = 40, 150, 3, 3737


class ArmWorth(Record):
    """What so many captures do to the RMS error at other poses, and whether that pays.

    `without_mm` is with the controller's poses, `with_mm` with poses corrected by the arm's errors.
    """

    captures: int
    without_mm: float
    with_mm: float
    worth_it: bool


def arm_worth(
    arm: ArmTable, own_mm: float, tilt_deg: float = 30.0, counts: Sequence[int] = COUNTS
) -> list[ArmWorth]:
    """Return what captures of a still ball will make of an arm's own errors.

    Parameters
    ----------
    arm : ArmTable
        Of six turning joints.
    own_mm : float
        The arm's repeatability, an axis.
    tilt_deg : float
        How far the scanner leans about the ball.
    counts : sequence of int
        How many captures.

    Raises
    ------
    InputError
        If the arm has others than six turning joints.
    """
    if len(arm.joints) != 6 or any(joint.kind != "revolute" for joint in arm.joints):
        to_do = message("Plan without the arm's name.")
        raise InputError("an arm of six turning joints", "something else", to_do, "arm_name")
    rng = np.random.default_rng(_SEED)
    home = _home(arm, rng)
    ball = flange_of_joints(arm, home).apply(_SEEN)
    aside = 0.25 * reach_of(arm)
    held = _Rows.held(arm, _poses(arm, home, rng, ball + rng.uniform(-aside, aside, (_HELD, 3)), 30.0))
    rows = _Rows.seen(arm, _poses(arm, home, rng, np.tile(ball, (max(counts), 1)), tilt_deg))
    found: list[ArmWorth] = []
    for count in counts:
        without, with_terms = rows.first(count).errors(held, float(np.hypot(own_mm, _REST_MM)))
        pays = with_terms < _BETTER * without
        found.append(ArmWorth(captures=count, without_mm=without, with_mm=with_terms, worth_it=pays))
    return found


def _home(arm: ArmTable, rng: np.random.Generator) -> list[float]:
    """Return joints that hold the flange downwards in front of the arm, far from where it cannot move freely."""
    reach, best, found = reach_of(arm), -1.0, [0.0] * 6
    for joints in rng.uniform(-130, 130, (_DRAWN, 6)).tolist():
        flange = flange_of_joints(arm, joints)
        out = float(np.hypot(*flange.translation_mm[:2])) / reach
        points, axes, at = joint_lines(arm, joints)
        moves = np.hstack([np.cross(axes, at - points) / reach, axes])
        free = float(np.linalg.svd(moves, compute_uv=False)[-1])
        if 0.3 < out < 0.75 and flange.rotation[2, 2] < -0.7 and free > best:
            best, found = free, joints
    return found


_Seen = tuple[RigidTransform, FloatArray, FloatArray]  # the flange, its joints, the ball


def _poses(
    arm: ArmTable, home: list[float], rng: np.random.Generator, balls: FloatArray, tilt_deg: float
) -> list[_Seen]:
    """Return poses that see balls (K, 3) in base, each from another side; each that the arm reaches."""
    middle, many = flange_of_joints(arm, home).rotation, _TRIES * len(balls)
    tilt, turn = np.zeros((many, 3)), np.zeros((many, 3))
    size, aside = np.deg2rad(tilt_deg) * np.sqrt(rng.uniform(size=many)), rng.uniform(-np.pi, np.pi, many)
    tilt[:, 0], tilt[:, 1] = size * np.cos(aside), size * np.sin(aside)
    turn[:, 2] = rng.uniform(-_TURN_RAD, _TURN_RAD, many)
    leaning = zip(turn, tilt, strict=True)
    rotations = np.array([middle @ rotation_from_vector(a) @ rotation_from_vector(b) for a, b in leaning])
    seen = np.repeat(balls, _TRIES, axis=0)
    origins = seen - (rotations @ (_SEEN + rng.uniform(-_SPREAD_MM, _SPREAD_MM, (many, 3)))[:, :, None])[:, :, 0]
    joints, reached = joints_of_poses(arm, rotations, origins, np.tile(home, (many, 1)))
    first = [k for some in np.arange(many).reshape(-1, _TRIES) for k in some[reached[some]][:1]]
    return [(RigidTransform.of(rotations[k], origins[k], "base", "tool0"), joints[k], seen[k]) for k in first]


@dataclass(frozen=True, eq=False)
class _Rows:
    """How observations, or points measured, (K, 3, …), follow tool and ball, and the arm's terms as believed."""

    edges: FloatArray
    terms: FloatArray

    @classmethod
    def seen(cls, arm: ArmTable, seen: Sequence[_Seen]) -> "_Rows":
        edges = np.zeros((len(seen), 3, 9))
        moved = _moved(arm, seen, [ball - flange.translation_mm for flange, _, ball in seen])
        for k, (flange, _, ball) in enumerate(seen):
            edges[k, :, :3] = skew(flange.inverse().apply(ball) - _MOUNT)
            edges[k, :, 3:6], edges[k, :, 6:] = -np.eye(3), flange.rotation.T
        back = np.array([flange.rotation.T for flange, _, _ in seen])
        return cls(edges, -back @ moved)

    @classmethod
    def held(cls, arm: ArmTable, seen: Sequence[_Seen]) -> "_Rows":
        arms = [flange.rotation @ _SEEN for flange, _, _ in seen]
        tool = np.hstack([-skew(_SEEN - _MOUNT), np.eye(3)])
        edges, terms = np.array([flange.rotation @ tool for flange, _, _ in seen]), _moved(arm, seen, arms)
        places = np.array([flange.apply(_SEEN) for flange, _, _ in seen])
        away = (places - places.mean(axis=0)) / 1000.0
        together, _ = np.linalg.qr(np.hstack([np.tile(np.eye(3), (len(seen), 1)), skew(away).reshape(-1, 3)]))

        def apart(rows: FloatArray) -> FloatArray:
            flat = rows.reshape(len(together), -1)
            return (flat - together @ (together.T @ flat)).reshape(rows.shape)

        return cls(apart(edges), apart(terms))

    def first(self, count: int) -> "_Rows":
        return _Rows(self.edges[:count], self.terms[:count])

    def errors(self, held: "_Rows", noise_mm: float) -> tuple[float, float]:
        """Return the RMS error of held points, in 3-D, without the arm's terms and with them."""
        edges = self.edges.reshape(-1, self.edges.shape[2])
        terms = self.terms.reshape(len(edges), -1)
        at = np.zeros((3 * len(held.edges), edges.shape[1]))
        at[:, :6] = held.edges.reshape(-1, 6)
        of_terms = held.terms.reshape(len(at), -1)
        back = np.linalg.pinv(edges, rcond=1e-9)
        swallowed = at @ back
        without = np.sum((swallowed @ terms - of_terms) ** 2) + noise_mm**2 * np.sum(swallowed**2)
        design, both = np.hstack([edges, terms]) / noise_mm, np.hstack([at, of_terms])
        known = design.T @ design
        known[np.arange(edges.shape[1], len(known)), np.arange(edges.shape[1], len(known))] += 1.0
        with_terms = np.sum((both @ np.linalg.pinv(known, rcond=1e-12, hermitian=True)) * both)
        rest = 3 * _REST_MM**2
        many = len(held.edges)
        return float(np.sqrt(without / many + rest)), float(np.sqrt(with_terms / many + rest))


def _moved(arm: ArmTable, seen: Sequence[_Seen], arms: Sequence[FloatArray]) -> FloatArray:
    """Return how points that the flange holds by arms move in base with the terms as believed, (K, 3, p)."""
    moves = arm_moves(arm, [joints.tolist() for _, joints, _ in seen]) * [term.sigma for term in arm_terms(arm)]
    return moves[:, :3] - np.array([skew(one) for one in arms]) @ moves[:, 3:]
