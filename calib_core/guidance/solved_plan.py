"""Further captures of a cell that is solved, whatever its edges: each where a ball's place in view is known least.

Nothing of the way from scanner to ball is written here a second time: `cell.walk` says where a ball is seen, and
`chain.likelihood` what captures tell of it.  A machine is sent only to orientations that it took before, along the
ways that it went: what a gantry cannot do is not asked of it.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.cell.layout import Layout
from calib_core.cell.walk import Walk, foot_moves, ways
from calib_core.chain.arrays import chain_data
from calib_core.chain.likelihood import linearised_at
from calib_core.chain.model import ChainState
from calib_core.chain.observations import SphereObservation
from calib_core.chain.scanner import ScannerPriors
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray, RigidTransform
from calib_core.guidance.candidates import AWAY_MM, Room, keep_free, places_in_view
from calib_core.guidance.design import MOUNTED_MM, SPHERE_MM, TURN_RAD, worst_sigma
from calib_core.guidance.solved_cell import SolvedCell

_CANDIDATES, _ROUNDS = 240, 6
_AT_EDGE = 0.5  # of the readings, as of poses: the ends of the ways tell most
_STEP = 1e-4  # rad and mm, of the differences by which places in view follow the unknowns
_STANDS_MM = 1.0  # ways shorter than this are noise
_APPROACH_MM = 150.0
_LEAST_NOISE_MM = 0.02
_AWAY_MM, _CHOICE = (AWAY_MM, 20.0, 10.0, 5.0), 3  # how far off poses of before, where so many times more are
_SEED = 20_271


@dataclass(frozen=True, eq=False)
class Shot:
    """One capture that is thought of.

    Attributes
    ----------
    pose, approach : RigidTransform, RigidTransform or None
        base_from_tool0 as the robot reports it, and where it comes from: back along the scanner's view.
    by_robot : bool
        Whether the robot's pose matters.
    readings : mapping
        Where the axes are to stand, by their names, rad and mm.
    mount, scanner, sphere : str
        How the ball is mounted, whose capture it is, and the ball's name.
    after_mm : float
        With it, the standard deviation of where a ball is seen, at worst.
    """

    pose: RigidTransform
    approach: RigidTransform | None
    by_robot: bool
    readings: Mapping[str, float]
    mount: str
    scanner: str
    sphere: str
    after_mm: float


@dataclass(frozen=True, eq=False)
class _Thought:
    """Captures that could be taken, N of them."""

    walk: Walk
    seen: FloatArray
    approaches: list[RigidTransform | None]
    observations: list[SphereObservation]


def planned_captures(known: SolvedCell, count: int, *, on_axes: bool, verifying: bool = False) -> list[Shot]:
    """Return up to `count` captures of balls on axes, or of the others, each the one that tells most.

    Those that verify are of every ball and scanner in turn, and as far from poses of before as the machine goes.
    """
    return planned_with_covariance(known, count, on_axes=on_axes, verifying=verifying)[0]


def planned_with_covariance(
    known: SolvedCell,
    count: int,
    *,
    on_axes: bool | None = None,
    verifying: bool = False,
    until_mm: float = 0.0,
    least_each: int = 0,
) -> tuple[list[Shot], FloatArray]:
    """Return the same, of all balls where `on_axes` is None, and the covariance of the edges' unknowns with them.

    No more than it takes for `after_mm` to come down to `until_mm`, but `least_each` of each ball by each scanner.
    """
    rng = np.random.default_rng([_SEED, len(known.taken)])
    thought = _thought_of(known, on_axes, rng)
    if not thought.observations:
        return [], np.zeros((0, 0))
    data = chain_data([*known.taken, *thought.observations], known.sphere, None, ScannerPriors(), known.layout)
    moves, taken = _moves(known, thought.walk), len(known.taken)
    every = moves.reshape(-1, moves.shape[2])
    noise = np.where(thought.walk.over_robot == 0, _LEAST_NOISE_MM, known.sigmas.largest_position_mm)
    noise = np.maximum(noise, _LEAST_NOISE_MM)[:, None, None] ** 2 * np.eye(3)

    def covariance(chosen: Sequence[int]) -> FloatArray:
        """Return that of the edges' unknowns, with the chosen ones taken."""
        if not taken and not chosen:
            return covariance_of(_with_edges(np.zeros((known.layout.unknowns,) * 2), known.layout))
        some = data.chosen(np.isin(np.arange(data.count), [*range(taken), *(taken + k for k in chosen)]))
        hessian = linearised_at(some, ChainState.at(some, known.position), known.sigmas).hessian
        return covariance_of(_with_edges(hessian, known.layout))[: known.layout.unknowns, : known.layout.unknowns]

    chosen, shots, now = list[int](), list[Shot](), covariance([])
    far = _far(known, thought, count) if verifying else np.ones(len(thought.observations), dtype=bool)
    pairs = [known.pair_of(one) for one in thought.observations]
    if verifying:  # one capture alone of a ball by a scanner says nothing
        some = known.pairs[: max(count // 2, 1)]
        far &= np.array([pair in some for pair in pairs])
    for _ in range(min(count, int(far.sum()))):
        left = far & ~np.isin(np.arange(len(far)), chosen)
        often = Counter(pairs[k] for k in chosen)
        if few := [pair for pair in {*pairs} if often[pair] < least_each]:
            left &= np.array([pair in few for pair in pairs])
        if verifying:
            least = min(often[pairs[k]] for k in np.flatnonzero(left))
            left &= np.array([often[pair] == least for pair in pairs])
        reach = moves @ now
        own = noise + reach @ np.swapaxes(moves, 1, 2)
        toward = reach @ every.T  # what each takes off the variances of all places in view
        gained = np.einsum("kij,kij->k", toward, np.linalg.solve(own, toward))
        chosen.append(int(np.argmax(np.where(left, gained, -1.0))))
        now = covariance(chosen)
        after = worst_sigma(moves @ now @ np.swapaxes(moves, 1, 2))
        shots.append(_shot(known, thought, chosen[-1], float(after.max())))
        if shots[-1].after_mm <= until_mm and len(few) < 2 and (not few or often[few[0]] + 1 == least_each):
            break
    return shots, now


def _with_edges(hessian: FloatArray, layout: Layout) -> FloatArray:
    """Return a Hessian with what is known of all edges beforehand: where they are, to some metres."""
    sigmas = np.full(layout.unknowns, SPHERE_MM)
    for n in range(len(layout.mounts)):
        sigmas[layout.mount(n)] = [TURN_RAD] * 3 + [MOUNTED_MM] * 3
    for a in range(len(layout.axes)):
        sigmas[layout.axis(a)] = [TURN_RAD] * 2 + [SPHERE_MM] * 2 + [1.0]
    known, every = hessian.copy(), np.arange(layout.unknowns)
    known[every, every] += 1 / sigmas**2
    return known


def _far(known: SolvedCell, thought: _Thought, count: int) -> np.ndarray:
    """Return which captures are from poses other than those of before, (N,), as far as enough of them are."""
    before = [one.base_from_tool0.translation_mm for one in known.taken]
    at = thought.walk.translations[:, None] - np.array(before)
    nearest = np.where(thought.walk.over_robot == 0, np.inf, np.linalg.norm(at, axis=2).min(axis=1))
    enough = min(_CHOICE * count, len(nearest))
    return next((nearest >= least for least in _AWAY_MM if (nearest >= least).sum() >= enough), nearest > 0.0)


def _shot(known: SolvedCell, thought: _Thought, k: int, after_mm: float) -> Shot:
    walk, seen = thought.walk, thought.observations[k]
    return Shot(
        seen.base_from_tool0,
        thought.approaches[k],
        bool(walk.over_robot[k]),
        known.readings_asked(int(walk.place[k]), walk.readings[k]),
        known.mounts[int(walk.place[k])],
        seen.scanner,
        seen.ball,
        after_mm,
    )


def _thought_of(known: SolvedCell, on_axes: bool | None, rng: np.random.Generator) -> _Thought:
    """Return captures that the cell could take: in view, on ways that the machine went, within the limits."""
    pairs = [pair for pair in known.pairs if on_axes in (None, known.rides(pair[1]))]
    parts = [part for pair in pairs for part in _of_pair(known, pair, _CANDIDATES // len(pairs), rng)]
    observations = [one for part in parts for one in part.observations]
    which = [known.pair_of(one) for one in observations]
    walk = _walk(
        known,
        [one.base_from_tool0 for one in observations],
        np.array([pair[0] for pair in which], dtype=int),
        np.array([pair[1] for pair in which], dtype=int),
        np.concatenate([part.walk.readings for part in parts] or [np.zeros((0, len(known.layout.axes)))]),
    )
    seen = np.concatenate([part.seen for part in parts] or [np.zeros((0, 3))])
    return _Thought(walk, seen, [one for part in parts for one in part.approaches], observations)


def _of_pair(known: SolvedCell, pair: tuple[int, int], count: int, rng: np.random.Generator) -> list[_Thought]:
    """Return captures of one ball by one scanner."""
    found, enough = list[_Thought](), 0
    for _ in range(_ROUNDS):
        part = _drawn(known, pair, 2 * count, rng)
        found.append(part)
        enough += len(part.observations)
        if enough >= count:
            break
    return found


def _drawn(known: SolvedCell, pair: tuple[int, int], count: int, rng: np.random.Generator) -> _Thought:
    scanner, place = pair
    sight, mount = known.sights[scanner], known.mount(scanner)
    readings = known.drawn_readings(place, count, _AT_EDGE, rng)
    before = known.poses_of(scanner)
    chosen = [before[k] for k in rng.integers(len(before), size=count)]
    each = np.full(count, scanner), np.full(count, place)
    walk = _walk(known, chosen, *each, readings)
    moves = walk.over_robot[0] if count else 0.0
    if moves:
        wanted = places_in_view(sight, known.radius_mm, count, rng)
        held, ends = mount.apply(wanted), known.position.places[walk.place]
        if moves > 0:  # the flange carries the scanner
            held, ends = replace(walk, translations=np.zeros((count, 3))).balls(known.position)[0], held
        else:
            turned, moved = foot_moves(known.layout.axes, known.position.axes, readings)
            held = np.einsum("kji,kj->ki", turned, held - moved)
        shifts = held - np.einsum("kij,kj->ki", walk.rotations, ends)
        walk = replace(walk, translations=_on_its_ways(shifts, before))
    seen = walk.seen(known.position)
    poses = [
        RigidTransform.of(r, t, "base", "tool0") for r, t in zip(walk.rotations, walk.translations, strict=True)
    ]
    good = sight.sees(seen, known.radius_mm)
    approaches: list[RigidTransform | None] = [None] * count
    if moves:
        good &= _allowed(known, walk, seen, scanner)
        if _ways_of(before).shape[0] == 3:
            back = known.approach_in_laser(scanner) * _APPROACH_MM
            approaches = [_backed(pose, mount, back, moves) for pose in poses]
    kept = np.flatnonzero(good)
    observations = [known.observation(pair, poses[k], seen[k], readings[k], f"n{k}") for k in kept]
    return _Thought(walk.chosen(good), seen[good], [approaches[k] for k in kept], observations)


def _backed(pose: RigidTransform, mount: RigidTransform, back: FloatArray, moves: float) -> RigidTransform:
    """Return a pose drawn back along the scanner's view (3,), whichever of scanner and ball the flange carries."""
    away = pose.rotation @ mount.rotation @ back if moves > 0 else -mount.rotation @ back
    return RigidTransform.of(pose.rotation, pose.translation_mm + away, "base", "tool0")


def _allowed(known: SolvedCell, walk: Walk, seen: FloatArray, scanner: int) -> np.ndarray:
    """Return which poses keep within the limits, in base, (N,)."""
    rotations, translations = walk.on_foot(known.position.axes)
    poses = [RigidTransform.of(r, t, "base", "tool0") for r, t in zip(rotations, translations, strict=True)]
    mount = known.mount(scanner)
    sight = replace(known.sights[scanner], carriers=known.carriers(scanner, int(walk.place[0])))
    room = Room(sight, known.cell.limits, np.eye(3))
    each = zip(poses, seen, strict=True)
    return np.array(
        [keep_free(room, [p], mount, (room.between(p) @ mount).apply(at), known.radius_mm)[0] for p, at in each],
        dtype=bool,
    )


def _ways_of(poses: Sequence[RigidTransform]) -> FloatArray:
    """Return along which directions a machine's flange went, (m, 3), orthonormal."""
    at = np.array([pose.translation_mm for pose in poses])
    _, sizes, directions = np.linalg.svd(at - at.mean(axis=0), full_matrices=False)
    return directions[sizes / np.sqrt(max(len(at) - 1, 1)) > _STANDS_MM]


def _on_its_ways(shifts: FloatArray, before: Sequence[RigidTransform]) -> FloatArray:
    """Return places of the flange (N, 3) brought to the nearest ones that the machine can reach."""
    along, middle = _ways_of(before), np.mean([pose.translation_mm for pose in before], axis=0)
    return middle + (shifts - middle) @ along.T @ along


def _walk(
    known: SolvedCell,
    poses: Sequence[RigidTransform],
    scanner: np.ndarray,
    place: np.ndarray,
    readings: FloatArray,
) -> Walk:
    carriers = [known.carriers(int(s), int(p)) for s, p in zip(scanner, place, strict=True)]
    return ways(known.layout, poses, carriers, scanner, place, readings)


def _moves(known: SolvedCell, walk: Walk) -> FloatArray:
    """Return how the places in view follow the edges' unknowns, (N, 3, unknowns)."""
    layout, at = known.layout, known.position
    found = np.zeros((len(walk.place), 3, layout.unknowns))
    for column in np.flatnonzero(~layout.fixed):
        step = np.zeros(layout.unknowns)
        step[column] = _STEP
        ahead, behind = (walk.seen(at.moved(layout, sign * step)) for sign in (1.0, -1.0))
        found[:, :, column] = (ahead - behind) / (2 * _STEP)
    return found
