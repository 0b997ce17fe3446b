"""Which pose next, and which set: chosen by what each takes off the uncertainty at the workpiece."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.observations import Observations, SphereObservation
from calib_core.frames import FloatArray, RigidTransform, rotation_from_vector
from calib_core.guidance.candidates import Candidates, Room, allowed, candidates
from calib_core.guidance.design import Assumed, Design, worst_sigma

_CANDIDATES, _NEAR = 300, 80
_NEAR_MM, _NEAR_RAD = 8.0, 0.08
_STEPS = (1.5, 1.0, 0.5, 0.25)
_UNTIL = 12  # captures: what the set that is thought of makes together
_SEED = 20_270
_SWEEPS = 4
_WORTH = 0.999  # of the criterion: an exchange that gains less is none
_SHARE_SURE = 0.1
_BESIDE_PLAN_MM = 3.0
_TIMID_DEG = (1.0, 2.0, 3.0, 5.0, 8.0, 12.0)
_AXES = np.array(
    [[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1], [1, 1, 0], [1, -1, 0]], dtype=float
)


@dataclass(frozen=True, eq=False)
class Situation:
    """What is known before the next capture.

    Attributes
    ----------
    taken : sequence of SphereObservation
        Without those that are `apart`.
    assumed : Assumed
    room : Room
    agreed : bool
        Whether enough captures agree with each other through one tool and one sphere.
    apart : tuple of str
        Captures that the others contradict.
    with_arm : Assumed or None
        The same with the arm's own errors among the unknowns, where these are to be solved.
    workpiece : (3, 3) or None
        The covariance at the workpiece, mm², that a solve of the captures will state, where they tell it by now.
    """

    taken: Observations
    assumed: Assumed
    room: Room
    agreed: bool = True
    apart: tuple[str, ...] = ()
    with_arm: Assumed | None = None
    workpiece: FloatArray | None = None

    def proposed(self, count: int, seed: int = _SEED) -> Candidates:
        """Return poses that a capture could be taken from."""
        given = self.assumed
        rng = np.random.default_rng([seed, len(self.taken)])
        radius = given.sphere.radius_mm
        found = candidates(self.room, given.mount_from_laser, given.center_mm, radius, count, rng)
        return self.reached(found)

    def reached(self, poses: Candidates) -> Candidates:
        """Return those poses that an arm whose errors are solved reaches; all, where it is not known."""
        arm = None if self.with_arm is None else self.with_arm.arm
        return poses if arm is None else arm.reached(poses)

    def seen_from(self, poses: Candidates) -> list[SphereObservation]:
        """Return what captures from poses will show."""
        radius = self.assumed.sphere.radius_mm
        pairs = zip(poses.poses, poses.centers_in_laser, strict=True)
        seen = [self.room.sight.observation(f"c{k}", *pair, radius) for k, pair in enumerate(pairs)]
        moves = poses.arm_moves
        return seen if moves is None else [replace(o, arm_moves=m) for o, m in zip(seen, moves, strict=True)]


@dataclass(frozen=True, eq=False)
class NextPose:
    """The pose that helps most.

    Attributes
    ----------
    base_from_tool0 : RigidTransform
    center_in_laser_mm : (3,)
        Where the scanner will see the sphere's centre.
    before_mm, after_mm : float
        Standard deviation at the workpiece in the worst direction, without and with it.
    doubt_mm : float
        Twice the standard deviation of where the sphere will be seen, in the worst axis of L.
    sure : bool
        Whether the sphere stays in view wherever it may be by what is known.
    """

    base_from_tool0: RigidTransform
    center_in_laser_mm: FloatArray
    before_mm: float
    after_mm: float
    doubt_mm: float
    sure: bool


def next_pose(situation: Situation, count: int = _CANDIDATES, until: int = _UNTIL) -> NextPose | None:
    """Return the pose that helps most, None where no pose is allowed.

    It is one of a set that together takes most off the uncertainty at the workpiece, up to `until` captures:
    the one that helps most by itself now, refined by others near it while the rest of the set stays where it is.
    """
    poses = situation.proposed(count)
    if not len(poses):
        return None
    compared = _Compared(situation, poses)
    if not compared.sure.any() and len(situation.taken):
        timid = _timid(situation)
        return (_Compared(situation, timid) if len(timid) else compared).best()
    best, rest = compared.best_until(until)
    for step in _STEPS:
        best = _refined(situation, best, rest, step)
    return best


class _Compared:
    """Poses beside each other: what each would do as the next one."""

    def __init__(self, situation: Situation, poses: Candidates, beside: Candidates | None = None) -> None:
        taken, others = list(situation.taken), [] if beside is None else situation.seen_from(beside)
        self.poses, self.before = poses, len(taken)
        self.design = Design([*taken, *others, *situation.seen_from(poses)], situation.assumed)
        self.fixed = len(taken) + len(others)
        self.hessian = self.design.hessian(range(self.before))
        places = range(self.fixed, self.fixed + len(poses))
        self.added = self.design.added(self.hessian, range(self.before), places)
        self.with_others = self.added if beside is None else self.design.adding(range(self.fixed), places)
        radius = situation.assumed.sphere.radius_mm
        self.sure = situation.room.sight.sees(poses.centers_in_laser, radius, self.added.doubt_mm)
        self.doubt_mm = self.added.doubt_mm.max(axis=1)

    def at(self, k: int) -> NextPose:
        """Return one of the poses."""
        return NextPose(
            self.poses.poses[k],
            self.poses.centers_in_laser[k],
            float(worst_sigma(self.design.at_workpiece(self.hessian))),
            float(worst_sigma(self.added.workpiece[k])),
            float(self.doubt_mm[k]),
            bool(self.sure.any()),
        )

    def best(self) -> NextPose:
        """Return the pose that helps most now: of those that surely see the sphere, where there are any."""
        return self.at(self._best_of(_score(self.added.workpiece, self.before)))

    def best_beside(self) -> NextPose:
        """Return the pose with which, and with those beside, the worst direction is known best."""
        return self.at(self._best_of(worst_sigma(self.with_others.workpiece)))

    def best_until(self, until: int) -> tuple[NextPose, Candidates | None]:
        """Return the best pose of a set that makes the captures up to `until`, and the rest of the set."""
        score = _score(self.added.workpiece, self.before)
        more = min(until - self.before, len(self.poses)) - 1
        first = self._best_of(score)
        if more < 1 or not self.sure.any():
            return self.at(first), None
        beside = list(range(self.before))
        chosen = [self.fixed + first]
        for _ in range(more):
            others = [k for k in range(self.fixed, len(self.design)) if k not in chosen]
            chosen.append(_helping_most(self.design, [*beside, *chosen], others))
        index = np.array(chosen) - self.fixed
        one = min(index[self.sure[index]], key=lambda k: score[k])
        rest = [k for k in index if k != one]
        return self.at(int(one)), self.poses.chosen(np.array(rest, dtype=int))

    def _best_of(self, score: FloatArray) -> int:
        if self.sure.any():
            return int(np.argmin(np.where(self.sure, score, np.inf)))
        # The least bold ones, and of those the best.
        bold = self.doubt_mm > np.quantile(self.doubt_mm, _SHARE_SURE)
        return int(np.argmin(np.where(bold, np.inf, score)))


def _refined(situation: Situation, best: NextPose, beside: Candidates | None, step: float) -> NextPose:
    """Return the best of a pose and others near it; those beside it, if any, stay where they are."""
    compared = _Compared(situation, _near(situation, best, step), beside)
    return compared.best() if beside is None else compared.best_beside()


def _timid(situation: Situation) -> Candidates:
    """Return poses that turn the flange little about the sphere: it stays in view by a tool hardly known."""
    given, room = situation.assumed, situation.room
    last = situation.taken[-1].ball_from_scanner
    poses: list[RigidTransform] = []
    places: list[FloatArray] = []
    for side in (1.0, -1.0):
        place = room.sight.safest(given.sphere.radius_mm, side)
        for axis in _AXES:
            for angle in np.deg2rad(_TIMID_DEG):
                turn = given.mount_from_laser.rotation @ rotation_from_vector(axis * angle)
                rotation = last.rotation @ turn @ given.mount_from_laser.rotation.T
                origin = given.center_mm - rotation @ given.mount_from_laser.apply(place)
                pose = room.pose_of(rotation, origin)
                if allowed(room, pose, given.mount_from_laser, given.center_mm, given.sphere.radius_mm):
                    poses.append(pose)
                    places.append(place)
    return situation.reached(Candidates(tuple(poses), np.array(places).reshape(-1, 3)))


def _near(situation: Situation, best: NextPose, step: float) -> Candidates:
    """Return the pose itself and allowed ones near it."""
    rng = np.random.default_rng(_SEED)
    given, room = situation.assumed, situation.room
    steps = rng.standard_normal((_NEAR, 6)) * np.array([_NEAR_RAD] * 3 + [_NEAR_MM] * 3) * step
    poses = [best.base_from_tool0]
    here = room.between(best.base_from_tool0)
    for change in steps:
        turned = here.perturbed([*change[:3], 0.0, 0.0, 0.0])
        # Turned about the sphere, then shifted: the sphere stays in view.
        seen = given.mount_from_laser.apply(best.center_in_laser_mm + change[3:])
        pose = room.pose_of(turned.rotation, given.center_mm - turned.rotation @ seen)
        known = given.mount_from_laser, given.center_mm, given.sphere.radius_mm
        if room.leans_enough(turned.rotation, given.mount_from_laser.rotation) and allowed(room, pose, *known):
            poses.append(pose)
    seen = [(room.between(p) @ given.mount_from_laser).inverse().apply(given.center_mm) for p in poses]
    return situation.reached(Candidates(tuple(poses), np.array(seen).reshape(-1, 3)))


@dataclass(frozen=True, eq=False)
class PlannedSet:
    """Poses for a whole step, in the order in which they help most.

    Attributes
    ----------
    poses : Candidates
    after_mm : (N,)
        Standard deviation at the workpiece in the worst direction after each.
    """

    poses: Candidates
    after_mm: FloatArray


def planned_set(situation: Situation, count: int, grid: int = 500, sweeps: int = _SWEEPS) -> PlannedSet:
    """Return the set of `count` poses that together leave least uncertainty: greedy, then by exchange.

    From each the sphere stays in the field though it may be 3 mm beside its place: a plan is made by a drawing.

    Raises
    ------
    ValueError
        If fewer poses are allowed than are asked for.
    """
    poses = situation.proposed(2 * grid)
    radius = situation.assumed.sphere.radius_mm
    safe = situation.room.sight.sees(poses.centers_in_laser, radius, _BESIDE_PLAN_MM)
    poses = poses.chosen(safe & (np.cumsum(safe) <= grid))
    if len(poses) < count:
        raise ValueError(f"{len(poses)} allowed poses, {count} wanted")
    taken = len(situation.taken)
    design = Design([*situation.taken, *situation.seen_from(poses)], situation.assumed)
    first = list(range(taken))
    chosen = exchanged(design, first, greedy(design, first, count), sweeps)
    ordered = _in_order(design, first, chosen)
    index = np.array(ordered) - taken
    after = [float(worst_sigma(design.workpiece([*first, *ordered[: n + 1]]))) for n in range(len(ordered))]
    return PlannedSet(poses.chosen(index), np.array(after))


def greedy(design: Design, first: Sequence[int], count: int) -> list[int]:
    """Return captures beside the first ones, each the one that helps most when it is chosen."""
    chosen: list[int] = []
    for _ in range(count):
        others = [k for k in range(len(first), len(design)) if k not in chosen]
        chosen.append(_helping_most(design, [*first, *chosen], others))
    return chosen


def _helping_most(design: Design, beside: Sequence[int], others: Sequence[int]) -> int:
    """Return which of others helps most beside some captures."""
    return others[int(np.argmin(_score(design.adding(beside, others).workpiece, len(beside))))]


def _score(workpiece: FloatArray, taken: int) -> FloatArray:
    """Return what the best capture makes least, of covariances (N, 3, 3) at the workpiece.

    First the sum of the variances; the more captures there are, the more the worst direction counts, in which the
    uncertainty is stated: from the start, that leads to sets that are worse in the end.
    """
    values = np.maximum(np.linalg.eigvalsh(workpiece), 1e-18)
    power = min(1 + taken / 4, 6.0)
    return np.sum((values / values.max()) ** power, axis=1)


def exchanged(design: Design, first: Sequence[int], chosen: Sequence[int], sweeps: int) -> list[int]:
    """Return a set of captures in which none can be replaced by another for the better."""
    chosen = list(chosen)
    best = float(worst_sigma(design.workpiece([*first, *chosen])))
    for _ in range(sweeps):
        before = best
        for one in tuple(chosen):
            rest = [k for k in chosen if k != one]
            others = [k for k in range(len(first), len(design)) if k not in rest]
            found = worst_sigma(design.adding([*first, *rest], others).workpiece)
            at = int(np.argmin(found))
            if found[at] < best * _WORTH:
                best, chosen = float(found[at]), [*rest, others[at]]
        if best > before * _WORTH:
            break
    return chosen


def _in_order(design: Design, first: Sequence[int], chosen: Sequence[int]) -> list[int]:
    """Return a set in the order in which each next one helps most."""
    left, ordered = list(chosen), list[int]()
    while left:
        ordered.append(_helping_most(design, [*first, *ordered], sorted(left)))
        left.remove(ordered[-1])
    return ordered


def still_needed(situation: Situation, wanted_sigma_mm: float) -> int | None:
    """Return how many best next captures reach a standard deviation; None: more than a dozen."""
    poses = situation.proposed(150, _SEED + 1)
    taken = len(situation.taken)
    design = Design([*situation.taken, *situation.seen_from(poses)], situation.assumed)
    first, chosen = list(range(taken)), list[int]()
    for count in range(min(12, len(poses)) + 1):
        if float(worst_sigma(design.workpiece([*first, *chosen]))) <= wanted_sigma_mm:
            return count
        others = [k for k in range(taken, len(design)) if k not in chosen]
        if not others:
            return None
        chosen.append(_helping_most(design, [*first, *chosen], others))
    return None
