"""What is wrong with a session's poses: how their numbers are read, or which capture they belong to."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, cast

import numpy as np

from calib_core.causes.order import Order, handed_out, shifts, whole_orders
from calib_core.causes.readings import Reading, changes_of, moved_poses, poses_of, readings
from calib_core.causes.search import Posed, best_starts, misfits_mm, resettled
from calib_core.chain.guesses import random_rotations
from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.chain.start import Centers, Start, badness, centers_of, find_start
from calib_core.findings import Finding
from calib_core.findings.codes import causes as codes
from calib_core.frames import FloatArray, RigidTransform
from calib_core.poses.conventions import CONVENTIONS
from calib_core.records import BeforeAfter, Capture, CauseKind, Cell, RootCause

LEAST_CAPTURES = 7
"""With fewer, a wrong reading may fit well by chance."""

_SETTLED, _SETTLED_SWAPS = 12, 4
_LONGEST_SWAPPED = 40
_LOST = 6.0
_MUCH_BETTER = 0.5
_LEAST_SCALE_MM = 0.05
_GAIN = 6.0  # of the summed costs, so that captures that fit by chance do not count
_LEAST_GAIN_OF_ORDER = 1.0  # beside what giving a capture another pose costs
_ORDER_FITS_MM = 2.0  # poses that are handed out rightly leave what the arm errs by: below 1 mm
_FEW, _ORDER_OF_FEW_FITS_MM = 10, 1.0  # of few captures, wrong ones may fit to more
_RIVAL = 6.0  # of the summed costs, by which another cause may fit worse and still be told
_COST_OF_A_FACTOR = 0.5
_MOST_CAUSES = 3
_WHOLE_SHARE = 0.6  # of the captures that a wrong order moves, and that agree on it


@dataclass(frozen=True, eq=False)
class _List:
    """Poses of a list by the names (N) of their captures, and at which places of it the captures (K) stand."""

    names: list[str]
    rows: list[list[float]]
    own: np.ndarray


@dataclass(frozen=True, eq=False)
class _Tried:
    """A hypothesis that was settled."""

    poses: list[RigidTransform]
    reading: Reading
    start: Start
    order: Order
    cost: float
    misfit_mm: tuple[float, float] = (0.0, 0.0)


def pose_causes(
    cell: Cell, captures: Sequence[Capture], observations: Observations, sphere: SphereSize
) -> list[Finding]:
    """Return what would make the captures fit far better: another reading of all poses, or poses handed out anew.

    Parameters
    ----------
    cell : Cell
    captures : sequence of Capture
        All of the session: those of the observations, and others whose poses are to be changed with them.
    observations : sequence of SphereObservation
        One a capture, of a sphere that stands still or is on the flange; their poses are not looked at.  Of
        several scanners or spheres those are tried that most captures are of.
    sphere : SphereSize

    Returns
    -------
    list of Finding
        With their remedies, the likeliest first; none where the poses fit as they are, or fewer than seven
        captures show the sphere.
    """
    groups = _groups(observations)
    main = next(iter(groups), [])
    found = _causes(cell, captures, main, main, sphere)
    if len(groups) == 1 or any(one.code == codes.POSE_READING.name for one in found):
        return found
    if whole := _causes(cell, captures, main, observations, sphere):
        return whole
    return [*found, *(one for group in groups[1:] for one in _causes(cell, captures, group, group, sphere))]


def _causes(
    cell: Cell, captures: Sequence[Capture], observations: Observations, listed: Observations, sphere: SphereSize
) -> list[Finding]:
    """Return the same by one scanner's captures of one ball, whose poses are among those that are listed.

    Others may be in the list: then it is asked whether it stands as a whole in another order, or is shifted.
    """
    of_others, seen = len(listed) > len(observations), {o.capture for o in listed}
    numbers = {capture.id: capture.pose for capture in captures if capture.id in seen}
    names, rows = [*numbers], [row for row in numbers.values() if row is not None]
    if len(observations) < LEAST_CAPTURES or len(rows) < len(listed):
        return []
    if any(len(row) != CONVENTIONS[cell.pose_convention].count for row in rows):
        return []
    poses = _List(names, rows, np.array([names.index(o.capture) for o in observations]))
    tried = _tried(cell, poses, observations, sphere)
    if not tried:
        return []
    told = Reading.told(CONVENTIONS[cell.pose_convention])
    now = next((t for t in tried if t.reading == told and not t.order.moved), None)
    found: list[_Tried] = []
    for one in sorted(tried, key=lambda t: t.cost):
        if one is now or (one.reading == told and not one.order.moved):
            continue
        if of_others and one.order.step is None and _whole_order(one.order, names) is None:
            continue
        if _explains(one, now) and not any(_same(one, other) for other in found):
            found.append(one)
    found = [one for one in found if one.cost - found[0].cost < _RIVAL][: 1 if of_others else _MOST_CAUSES]
    return [_cause(one, now, told, cell, captures, poses) for one in found]


def _tried(cell: Cell, listed: _List, observations: Observations, sphere: SphereSize) -> list[_Tried]:
    own, rows = listed.own, listed.rows
    everyone, alone = np.ones(len(own), dtype=bool), len(own) == len(rows)
    hypotheses: list[Posed] = []
    meant: list[Reading] = []
    told = Reading.told(CONVENTIONS[cell.pose_convention])
    asked = readings(cell, rows) if alone else [told]
    by_reading = {reading: _across_robot(reading, rows, observations) for reading in asked}
    for reading, poses in by_reading.items():
        if poses is None:
            continue
        orders = [own]
        if reading == told:
            orders += [places[own] for places in shifts(len(rows))]
            orders += [places[own] for _, places in whole_orders(listed.names)]
        hypotheses += [Posed([poses[max(place, 0)] for place in order.tolist()], order >= 0) for order in orders]
        meant += [reading] * len(orders)
    if not hypotheses:
        return []
    centers = centers_of(observations, sphere)
    starts = [(meant[h], start) for h, start in best_starts(centers, hypotheses, _SETTLED).items()]
    as_told = by_reading.get(told)
    if as_told is not None and alone:
        starts += [(told, start) for start in _with_swaps(centers, as_told)]
    best = min((start for _, start in starts), key=lambda start: _badness(start, len(own)))
    scale_mm = max(_LEAST_SCALE_MM, best.scatter_mm)
    found: list[_Tried] = []
    for reading, start in starts:
        poses = by_reading[reading]
        assert poses is not None
        every = Posed(poses, everyone).centers(centers)
        misfits = misfits_mm(every, start)
        changed = (reading.convention != told.convention) + (reading.mm_per_unit != told.mm_per_unit)
        changed += (reading.radians != told.radians) + (reading.way != told.way)
        for allowed in (False, True) if reading == told else (False,):
            order = handed_out(misfits, scale_mm, own, allowed)
            if order.moved:
                given = Posed([poses[max(place, 0)] for place in order.pose_of.tolist()], order.pose_of >= 0)
                again = resettled(given, centers, start)
                misfits = misfits_mm(every, again)
                order = handed_out(misfits, scale_mm, own)
            cost = order.cost + _COST_OF_A_FACTOR * changed
            found.append(_Tried(poses, reading, start, order, cost, _off(misfits, order)))
    return found


def _across_robot(
    reading: Reading, rows: Sequence[Sequence[float]], observations: Observations
) -> list[RigidTransform] | None:
    """Return the poses by a reading from what carries one scanner; None where it cannot read them."""
    poses = poses_of(reading, rows)
    return None if poses is None else [observations[0].carriers.ball_from_scanner(pose) for pose in poses]


def of_main_scanner(observations: Observations) -> Observations:
    """Return the observations of one ball by one scanner, those that are most."""
    return next(iter(_groups(observations)), [])


def _groups(observations: Observations) -> list[Observations]:
    """Return the observations of each ball by each scanner, the most first."""
    groups: dict[object, list[SphereObservation]] = {}
    for one in observations:
        groups.setdefault((one.scanner, one.carriers, one.ball), []).append(one)
    return sorted(groups.values(), key=len, reverse=True)


def _with_swaps(centers: Centers, poses: list[RigidTransform]) -> list[Start]:
    """Return the start by the recorded poses, and the best ones with two of them exchanged."""
    count = len(poses)
    posed = Posed(poses, np.ones(count, dtype=bool))
    start = find_start(posed.centers(centers))
    if count > _LONGEST_SWAPPED:
        return [start]
    pairs: list[Posed] = []
    for one, other in combinations(range(count), 2):
        exchanged = list(poses)
        exchanged[one], exchanged[other] = exchanged[other], exchanged[one]
        pairs.append(Posed(exchanged, posed.known))
    near = random_rotations(6)
    near[0] = start.rotation
    found = best_starts(centers, pairs, _SETTLED_SWAPS, near)
    return [start, *found.values()]


def _badness(start: Start, count: int) -> float:
    """Return the robust cost of a start; captures without a pose cost as much as lost ones."""
    return badness(start) + (count - len(start.misfit_mm)) * (_LOST + float(np.log(max(start.scatter_mm, 0.05))))


def _off(misfits_mm: FloatArray, order: Order) -> tuple[float, float]:
    """Return how far the moved captures lie off, RMS: with their own poses, and with those that they get."""
    moved = order.moved
    own, given = misfits_mm[moved, order.own[moved]], misfits_mm[moved, order.pose_of[moved]]
    return (float(np.sqrt(np.mean(own**2))), float(np.sqrt(np.mean(given**2)))) if moved else (0.0, 0.0)


def _explains(one: _Tried, now: _Tried | None) -> bool:
    """Return whether a hypothesis fits so much better than the poses as they are that chance is no reason."""
    if now is None:
        return not one.order.moved or _fits(one)
    gain = now.cost - one.cost
    if one.order.moved:
        return gain > _LEAST_GAIN_OF_ORDER and _fits(one)
    better = one.start.scatter_mm < _MUCH_BETTER * now.start.scatter_mm
    return better and gain > _GAIN


def _fits(one: _Tried) -> bool:
    """Return whether captures with their poses handed out lie as close together as an arm's allow."""
    few = len(one.order.pose_of) < _FEW
    return one.start.scatter_mm < (_ORDER_OF_FEW_FITS_MM if few else _ORDER_FITS_MM)


def _same(one: _Tried, other: _Tried) -> bool:
    """Return whether two hypotheses give all captures the same poses."""
    if one.order.pose_of.tolist() != other.order.pose_of.tolist():
        return False
    return all(np.allclose(a.matrix, b.matrix, atol=1e-6) for a, b in zip(one.poses, other.poses, strict=True))


def _cause(
    one: _Tried,
    now: _Tried | None,
    told: Reading,
    cell: Cell,
    captures: Sequence[Capture],
    listed: _List,
) -> Finding:
    if one.reading == told:
        return _order_cause(one, captures, listed)
    said = one.reading.words(told.convention)
    before = None if now is None else now.start.scatter_mm
    name = one.reading.same_numbers()
    remedy = RootCause(
        id=_slug("pose-reading", said),
        kind="pose-reading",
        evidence=[_scatter(before, one.start.scatter_mm)],
        changes=changes_of(one.reading, cell, captures),
        pose_reading=None if name else one.reading.record(),
    )
    return codes.POSE_READING(
        remedy=remedy,
        said=said,
        compared="alone" if before is None else "instead",
        after_mm=one.start.scatter_mm,
        before_mm=before or 0.0,
        way="convention" if name else "convert",
        convention=name or "",
    )


def _order_cause(one: _Tried, captures: Sequence[Capture], listed: _List) -> Finding:
    names, order = listed.names, one.order
    whole = _whole_order(order, names)
    pose_of = _pose_of_all(order, len(names), None if whole is None else whole[2])
    moved = [k for k, place in enumerate(pose_of) if place not in (k, -1)]
    lost = [k for k, place in enumerate(pose_of) if place == -1]
    given = {names[k]: names[pose_of[k]] for k in moved}
    left = "-lost" if lost else ""
    values: dict[str, Any] = {"lost": ", ".join(names[k] for k in lost)}
    if whole is not None:
        code = codes.POSE_LIST_ORDER
        values |= {"how": whole[0], "places": whole[1]}
    elif order.swapped and len(moved) == 2:
        code = codes.SWAPPED_POSES
        values |= {"how": f"two{left}", "first": names[moved[0]], "second": names[moved[1]]}
    elif (step := order.step) is not None:
        code = codes.SHIFTED_POSES
        values |= {"how": f"{'before' if step < 0 else 'after'}{left}", "places": abs(step)}
        values |= {"first": names[min(moved + lost)], "last": names[max(moved + lost)]}
    else:
        code = codes.SWAPPED_POSES
        named = ", ".join(names[k] for k in moved[:8]) + (", …" if len(moved) > 8 else "")
        values |= {"how": f"mixed{left}", "listed": named}
    about = [names[k] for k in sorted(moved + lost)]
    kind = cast(CauseKind, code.name)
    remedy = RootCause(
        id=_slug(kind, names[min(moved)]),
        kind=kind,
        evidence=[
            BeforeAfter(
                label="Misfit of these captures, RMS", unit="mm", before=one.misfit_mm[0], after=one.misfit_mm[1]
            )
        ],
        captures=about,
        changes=moved_poses(given, [names[k] for k in lost], captures),
        poses_from=given,
    )
    return code(about, remedy=remedy, **values)


def _whole_order(order: Order, names: Sequence[str]) -> tuple[str, int, np.ndarray] | None:
    """Return how a whole list of poses is out of order, by how many places, and that order; None if it is not."""
    if len(order.moved) < _WHOLE_SHARE * len(order.own):
        return None
    known = order.pose_of >= 0
    for said, places in whole_orders(names):
        if (order.pose_of[known] == places[order.own][known]).mean() >= _WHOLE_SHARE:
            return said, int(places[0]), places
    return None


def _pose_of_all(order: Order, count: int, whole: np.ndarray | None) -> list[int]:
    """Return the place of the pose of all captures that a list has, −1 of none, by the order of some of them.

    What a whole order or a shift does to these it does to those of others in between, and at the list's ends.
    """
    own, lost = order.own, order.lost
    pose_of, others = np.arange(count), np.isin(np.arange(count), own, invert=True)
    settled = np.where(order.pose_of >= 0, order.pose_of, own)
    settled[lost] = -1
    pose_of[own] = settled
    if whole is not None:
        pose_of[others] = whole[others]
    elif (step := order.step) is not None:
        about = sorted([*order.moved, *lost])
        first = 0 if about[0] == 0 else own[about[0]]
        last = count - 1 if about[-1] == len(own) - 1 else own[about[-1]]
        run = np.flatnonzero(others[first : last + 1]) + first
        pose_of[run] = np.where((run + step >= 0) & (run + step < count), run + step, -1)
    return pose_of.tolist()


def _scatter(before: float | None, after: float) -> BeforeAfter:
    return BeforeAfter(label="Scatter of the sphere's centre", unit="mm", before=before, after=after)


def _slug(kind: str, said: str) -> str:
    words = "".join(c if c.isascii() and c.isalnum() else "-" for c in said.lower())
    return f"{kind}-{'-'.join(part for part in words.split('-') if part)}"[:64].rstrip("-")
