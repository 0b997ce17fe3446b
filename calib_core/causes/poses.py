"""What is wrong with a session's poses: how their numbers are read, or which capture they belong to."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, cast

import numpy as np

from calib_core.causes.order import Order, handed_out, shifts, whole_orders
from calib_core.causes.readings import Reading, changes_of, moved_poses, poses_of, readings
from calib_core.causes.search import Posed, best_starts, misfits_mm, resettled
from calib_core.chain.observations import Observations, SphereSize
from calib_core.chain.start import Centers, Start, badness, centers_of, find_start
from calib_core.chain.start_search import random_rotations
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
    observations = of_main_scanner(observations)
    by_id = {capture.id: capture for capture in captures}
    rows = [by_id[o.capture].pose for o in observations]
    numbers = [row for row in rows if row is not None]
    if len(numbers) < max(LEAST_CAPTURES, len(rows)) or len({o.capture for o in observations}) < len(rows):
        return []
    if any(len(row) != CONVENTIONS[cell.pose_convention].count for row in numbers):
        return []
    tried = _tried(cell, numbers, observations, sphere)
    if not tried:
        return []
    told = Reading.told(CONVENTIONS[cell.pose_convention])
    now = next((t for t in tried if t.reading == told and not t.order.moved), None)
    found: list[_Tried] = []
    for one in sorted(tried, key=lambda t: t.cost):
        if one is now or (one.reading == told and not one.order.moved):
            continue
        if _explains(one, now) and not any(_same(one, other) for other in found):
            found.append(one)
    found = [one for one in found if one.cost - found[0].cost < _RIVAL][:_MOST_CAUSES]
    return [_cause(one, now, told, cell, captures, observations) for one in found]


def _tried(
    cell: Cell, rows: Sequence[Sequence[float]], observations: Observations, sphere: SphereSize
) -> list[_Tried]:
    count = len(rows)
    everyone = np.ones(count, dtype=bool)
    hypotheses: list[Posed] = []
    meant: list[Reading] = []
    told = Reading.told(CONVENTIONS[cell.pose_convention])
    by_reading = {reading: _across_robot(reading, rows, observations) for reading in readings(cell, rows)}
    for reading, poses in by_reading.items():
        if poses is None:
            continue
        hypotheses.append(Posed(poses, everyone))
        meant.append(reading)
        if reading == told:
            for places in shifts(count):
                hypotheses.append(Posed([poses[max(place, 0)] for place in places.tolist()], places >= 0))
                meant.append(reading)
            for _, places in whole_orders([o.capture for o in observations]):
                hypotheses.append(Posed([poses[place] for place in places.tolist()], everyone))
                meant.append(reading)
    if not hypotheses:
        return []
    centers = centers_of(observations, sphere)
    starts = [(meant[h], start) for h, start in best_starts(centers, hypotheses, _SETTLED).items()]
    own = by_reading.get(told)
    if own is not None:
        starts += [(told, start) for start in _with_swaps(centers, own)]
    best = min((start for _, start in starts), key=lambda start: _badness(start, count))
    scale_mm = max(_LEAST_SCALE_MM, best.scatter_mm)
    found: list[_Tried] = []
    for reading, start in starts:
        poses = by_reading[reading]
        assert poses is not None
        misfits = misfits_mm(Posed(poses, everyone).centers(centers), start)
        changed = (reading.convention != told.convention) + (reading.mm_per_unit != told.mm_per_unit)
        changed += (reading.radians != told.radians) + (reading.way != told.way)
        for allowed in (False, True) if reading == told else (False,):
            order = handed_out(misfits, scale_mm, allowed)
            if order.moved:
                given = Posed([poses[max(place, 0)] for place in order.pose_of.tolist()], order.pose_of >= 0)
                again = resettled(given, centers, start)
                misfits = misfits_mm(Posed(poses, everyone).centers(centers), again)
                order = handed_out(misfits, scale_mm)
            cost = order.cost + _COST_OF_A_FACTOR * changed
            found.append(_Tried(poses, reading, start, order, cost, _off(misfits, order)))
    return found


def _across_robot(
    reading: Reading, rows: Sequence[Sequence[float]], observations: Observations
) -> list[RigidTransform] | None:
    """Return the poses by a reading from what carries the scanner; None where it cannot read them."""
    poses = poses_of(reading, rows)
    if poses is None:
        return None
    return [o.carriers.ball_from_scanner(pose) for o, pose in zip(observations, poses, strict=True)]


def of_main_scanner(observations: Observations) -> Observations:
    """Return the observations of one ball by one scanner, those that are most."""
    of = [(o.scanner, o.carriers, o.ball) for o in observations]
    most = max(dict.fromkeys(of), key=of.count, default=None)
    return [o for o, one in zip(observations, of, strict=True) if one == most]


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
    own, given = misfits_mm[moved, moved], misfits_mm[moved, order.pose_of[moved]]
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
    observations: Observations,
) -> Finding:
    if one.reading == told:
        return _order_cause(one, captures, observations)
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


def _order_cause(one: _Tried, captures: Sequence[Capture], observations: Observations) -> Finding:
    names = [o.capture for o in observations]
    places = one.order.pose_of.tolist()
    moved, lost = one.order.moved, one.order.lost
    given = {names[k]: names[places[k]] for k in moved}
    left = "-lost" if lost else ""
    values: dict[str, Any] = {"lost": ", ".join(names[k] for k in lost)}
    if whole := _whole_order(one.order, names):
        code = codes.POSE_LIST_ORDER
        values |= {"how": whole[0], "places": whole[1]}
    elif one.order.swapped and len(moved) == 2:
        code = codes.SWAPPED_POSES
        values |= {"how": f"two{left}", "first": names[moved[0]], "second": names[moved[1]]}
    elif (step := one.order.step) is not None:
        code = codes.SHIFTED_POSES
        values |= {"how": f"{'before' if step < 0 else 'after'}{left}", "places": abs(step)}
        values |= {"first": names[min(moved + lost)], "last": names[max(moved + lost)]}
    else:
        code = codes.SWAPPED_POSES
        listed = ", ".join(names[k] for k in moved[:8]) + (", …" if len(moved) > 8 else "")
        values |= {"how": f"mixed{left}", "listed": listed}
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


def _whole_order(order: Order, names: Sequence[str]) -> tuple[str, int] | None:
    """Return how the whole list of poses is out of order, and by how many places; None where it is not."""
    if len(order.moved) < _WHOLE_SHARE * len(names):
        return None
    known = order.pose_of >= 0
    for said, places in whole_orders(names):
        if (order.pose_of[known] == places[known]).mean() >= _WHOLE_SHARE:
            return said, int(places[0])
    return None


def _scatter(before: float | None, after: float) -> BeforeAfter:
    return BeforeAfter(label="Scatter of the sphere's centre", unit="mm", before=before, after=after)


def _slug(kind: str, said: str) -> str:
    words = "".join(c if c.isascii() and c.isalnum() else "-" for c in said.lower())
    return f"{kind}-{'-'.join(part for part in words.split('-') if part)}"[:64].rstrip("-")
