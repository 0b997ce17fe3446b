"""The next capture of the sphere on the table: angle, height and pose, by what they take off the ±."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from calib_core.chain.observations import SphereObservation, TableObservation, TableObservations
from calib_core.chain.table_start import find_table_start
from calib_core.errors import CalibrationError
from calib_core.evidence.numbers import COVERAGE
from calib_core.frames import FloatArray, RigidTransform
from calib_core.guidance.advice import expanded, inputs_of, inputs_read
from calib_core.guidance.candidates import allowed, candidates
from calib_core.guidance.planner import Situation
from calib_core.guidance.prior import observations_of, situation_of
from calib_core.guidance.table_design import TableDesign, TableGuess
from calib_core.records import Cell, Measured, Meter, ResultsData, Session
from calib_core.steps import steps_that_show

_LEAST = 3  # captures of one mounting from which the table is known about
_STEP_DEG = 30.0
_APART_DEG = 5.0
_POSES = 10
_HIGHER_MM = 100.0
_AT_ONCE = 3  # captures that another height needs before it says anything
_WORTH_A_CHANGE = 0.93  # of the ±: what moving the sphere must bring beside going on where it is
_BEFORE_A_CHANGE = 4
_MOST = 12
_MOUNTED_MM = 80.0  # off the axis, where nothing says where the sphere will stand


@dataclass(frozen=True, eq=False)
class TableSituation:
    """What is known before the next capture on the table.

    Attributes
    ----------
    still : Situation
        Of the captures of the still sphere: tool, scanner and room.
    table : TableGuess
    taken : tuple of TableObservation
    points : (N, 3)
        Of the workpiece, in T, where it should be known well.
    """

    still: Situation
    table: TableGuess
    taken: tuple[TableObservation, ...]
    points: FloatArray


@dataclass(frozen=True, eq=False)
class TableShot:
    """One capture on the table that is thought of.

    Attributes
    ----------
    table_deg : float
        As read.
    mount : str
    higher_mm : float or None
        By how much higher than before the sphere is to be fixed; None where it stays in its place.
    pose : RigidTransform
        base_from_tool0.
    center_in_base_mm : (3,)
        Where the sphere will be.
    after_mm : float
        The standard deviation at the workpiece with it; of a new height, with the three that it needs.
    """

    table_deg: float
    mount: str
    higher_mm: float | None
    pose: RigidTransform
    center_in_base_mm: FloatArray
    after_mm: float


@dataclass(frozen=True, eq=False)
class TableAdvice:
    """What the captures on the table are worth by now, and the one that helps most; None: no pose is allowed."""

    meter: Meter
    next: TableShot | None


def table_situation(session: Session, measured: Sequence[Measured], results: ResultsData) -> TableSituation | None:
    """Return what is known of tool and table; None where too little is for a capture to be chosen."""
    still = situation_of(session, measured, results)
    if still is None or not still.room.sight.carriers.scanner_moves:
        return None
    cell = session.cell
    captures = [
        c
        for c in session.captures
        if c.step == "turntable" and not c.excluded and c.pose is not None and c.table_deg is not None
    ]
    good = {m.capture: m for m in measured if m.verdict != "fail"}
    seen = observations_of(cell, captures, good, still.room.sight, still.assumed.sphere)
    read = {c.id: c for c in captures}
    taken = tuple(
        TableObservation(o, float(np.deg2rad(read[o.capture].table_deg or 0.0)), read[o.capture].mount or "")
        for o in seen
    )
    table = _guess(cell, taken, still)
    if table is None:
        return None
    still = _with_angle_sigma(cell, results, still)
    return TableSituation(still, table, taken, _points(cell, table))


def _with_angle_sigma(cell: Cell, results: ResultsData, still: Situation) -> Situation:
    found = next((r["angle_sigma_deg"] for r in results.values() if r.get("angle_sigma_deg") is not None), None)
    degrees = cell.turntable.angle_sigma_deg if cell.turntable.angle_sigma_deg is not None else found
    if degrees is None:
        return still
    sigmas = replace(still.assumed.sigmas, axes=(float(np.deg2rad(degrees)),))
    return replace(still, assumed=replace(still.assumed, sigmas=sigmas))


def _guess(cell: Cell, taken: TableObservations, still: Situation) -> TableGuess | None:
    names = tuple(dict.fromkeys(o.mount for o in taken))
    if any(sum(o.mount == name for o in taken) >= _LEAST for name in names):
        try:
            start = find_table_start(taken, still.assumed.sphere, still.assumed.mount_from_laser)
        except CalibrationError:
            return None  # what is wrong with the captures, the solve says
        return TableGuess(start.state, names, cell.turntable.direction)
    drawn = None if cell.nominal is None else cell.nominal.base_from_turntable
    if drawn is None or taken:
        return None
    from calib_core.chain.table import TableState

    frame = RigidTransform.from_rounded(drawn, "base", "turntable")
    x, y, z = cell.workpiece_in_turntable_mm or (_MOUNTED_MM, 0.0, _HIGHER_MM)
    place = np.array([[max(float(np.hypot(x, y)), _MOUNTED_MM), 0.0, z]])
    state = TableState(frame.rotation, frame.translation_mm, place)
    return TableGuess(state, ("low",), cell.turntable.direction)


def _points(cell: Cell, table: TableGuess) -> FloatArray:
    """Return where the workpiece is: as the cell says, else from the sphere's lowest place to its highest.

    A workpiece has a height: they are 100 mm apart at least.
    """
    if cell.workpiece_in_turntable_mm is not None:
        return np.array([cell.workpiece_in_turntable_mm], dtype=float)
    places = table.frame.mounts_mm
    low, high = places[np.argmin(places[:, 2])], places[np.argmax(places[:, 2])].copy()
    high[2] = max(float(high[2]), float(low[2]) + _HIGHER_MM)
    return np.array([low, high])


def shots_at(
    now: TableSituation, mount: int, angles_deg: Sequence[float], poses: int = 1
) -> list[tuple[float, RigidTransform, TableObservation]]:
    """Return allowed captures of a mounting at angles of the table, up to `poses` for each."""
    given, room = now.still.assumed, now.still.room
    radius, tool = given.sphere.radius_mm, given.mount_from_laser
    home = room.home if not now.taken else now.taken[-1].sphere.base_from_tool0.rotation
    found: list[tuple[float, RigidTransform, TableObservation]] = []
    for number, angle in enumerate(angles_deg):
        center = now.table.center_in_base(mount, float(np.deg2rad(angle)))
        place = room.sight.safest(radius, 1.0 if (number + len(now.taken)) % 2 else -1.0)
        plain = RigidTransform.of(home, center - home @ tool.apply(place), "base", "tool0")
        some: list[tuple[RigidTransform, FloatArray]] = []
        if allowed(room, plain, tool, center, radius):
            some.append((plain, place))
        if len(some) < poses:
            rng = np.random.default_rng([len(now.taken), mount, round(angle)])
            other = candidates(room, tool, center, radius, poses - len(some), rng)
            some += zip(other.poses, other.centers_in_laser, strict=True)
        for pose, seen in some:
            sphere = room.sight.observation(f"c{number}", pose, seen, radius)
            one = TableObservation(sphere, float(np.deg2rad(angle)), now.table.names[mount])
            found.append((angle, pose, one))
    return found


def next_shot(now: TableSituation) -> TableShot | None:
    """Return the capture that takes most off the uncertainty at the workpiece; None where no pose is allowed."""
    current = _current(now)
    here = shots_at(now, current, _free(now, current))
    if not here:
        return None
    best = _best(now, here)
    higher = None if len(_angles(now, current)) < _BEFORE_A_CHANGE else _another_height(now, current, here)
    if higher is not None:
        return higher
    refined = _best(now, shots_at(now, current, [best[0]], _POSES))
    angle, pose, after = refined if refined[2] < best[2] else best
    center = now.table.center_in_base(current, float(np.deg2rad(angle)))
    return TableShot(angle, now.table.names[current], None, pose, center, after)


def _best(
    now: TableSituation, shots: Sequence[tuple[float, RigidTransform, TableObservation]]
) -> tuple[float, RigidTransform, float]:
    after = _after(now, [[one] for _, _, one in shots])
    k = int(np.argmin(after))
    return shots[k][0], shots[k][1], after[k]


def _after(now: TableSituation, sets: Sequence[TableObservations]) -> list[float]:
    """Return the standard deviation at the workpiece after each of some sets of captures."""
    count = len(now.taken)
    every = [*now.taken, *(one for some in sets for one in some)]
    design = TableDesign(now.still.taken, every, now.still.assumed, now.table, now.points)
    after, at = list[float](), count
    for some in sets:
        after.append(design.sigma_mm([*range(count), *range(at, at + len(some))]))
        at += len(some)
    return after


def _another_height(
    now: TableSituation, current: int, here: Sequence[tuple[float, RigidTransform, TableObservation]]
) -> TableShot | None:
    """Return the first capture at another height, where three there tell clearly more than three more here."""
    stay = [one for _, _, one in _spread(here)]
    choices: list[tuple[TableSituation, float, list[tuple[float, RigidTransform, TableObservation]]]] = []
    seen = now.table.frame.mounts_mm[:, 2]
    up = 1.0 if now.table.frame.axis @ now.table.state.rotation[:, 2] > 0 else -1.0
    for change in (_HIGHER_MM, -_HIGHER_MM):
        if np.any(np.abs(seen[current] + change - seen) < _HIGHER_MM / 2):
            continue
        place = now.table.state.mounts[current] + np.array([0.0, 0.0, up * change])
        there = replace(now, table=now.table.with_mount(_new_name(now.table.names, change), place))
        shots = _spread(shots_at(there, len(there.table.names) - 1, _all_around(0.0)))
        if len(shots) == _AT_ONCE:
            choices.append((there, change, shots))
    if not choices or len(stay) < _AT_ONCE:
        return None
    going_on = _after(now, [stay])[0]
    found = [(_after(there, [[one for _, _, one in shots]])[0], k) for k, (there, _, shots) in enumerate(choices)]
    after, k = min(found)
    if after > _WORTH_A_CHANGE * going_on:
        return None
    there, change, shots = choices[k]
    angle, pose, _ = shots[0]
    center = there.table.center_in_base(len(there.table.names) - 1, float(np.deg2rad(angle)))
    return TableShot(angle, there.table.names[-1], change, pose, center, after)


def _new_name(names: Sequence[str], change_mm: float) -> str:
    name = "high" if change_mm > 0 else "low"
    return name if name not in names else f"{name}-{len(names) + 1}"


def _spread(
    shots: Sequence[tuple[float, RigidTransform, TableObservation]],
) -> list[tuple[float, RigidTransform, TableObservation]]:
    """Return three of them, all around."""
    if len(shots) < _AT_ONCE:
        return list(shots)
    return [shots[(k * len(shots)) // _AT_ONCE] for k in range(_AT_ONCE)]


def _current(now: TableSituation) -> int:
    return now.table.names.index(now.taken[-1].mount) if now.taken else 0


def _angles(now: TableSituation, mount: int) -> list[float]:
    name = now.table.names[mount]
    return [float(np.rad2deg(o.angle_rad)) for o in now.taken if o.mount == name]


def _all_around(first_deg: float) -> list[float]:
    return [float((first_deg + k * _STEP_DEG) % 360.0) for k in range(round(360 / _STEP_DEG))]


def _free(now: TableSituation, mount: int) -> list[float]:
    """Return angles at which a mounting was not seen yet."""
    taken = _angles(now, mount)
    free = [a for a in _all_around(taken[0] if taken else 0.0)
            if all(abs((a - b + 180.0) % 360.0 - 180.0) >= _APART_DEG for b in taken)]  # fmt: skip
    return free or _all_around(15.0 + (taken[0] if taken else 0.0))


def table_advice(session: Session, measured: Sequence[Measured], results: ResultsData) -> TableAdvice | None:
    """Return what to do next for the table, None where too little is known; kept, as `advice.tcp_advice` is."""
    if not any(c.step == "turntable" for c in session.captures):
        return None
    return _advised(inputs_of(session, measured, results, steps_that_show("sphere", "sphere-on-table")))


@lru_cache(maxsize=16)
def _advised(told: str) -> TableAdvice | None:
    session, measured, results = inputs_read(told)
    now = table_situation(session, measured, results)
    return None if now is None or not now.taken else advice_in(now, session.cell.wanted_mm)


def advice_in(now: TableSituation, wanted_mm: float | None) -> TableAdvice:
    """Return what to do next in a situation; every ± is k = 2."""
    sigma = _after(now, [[]])[0]
    meter = Meter(uncertainty_mm=expanded(sigma), wanted_mm=wanted_mm)
    if wanted_mm is not None and COVERAGE * sigma <= wanted_mm:
        return TableAdvice(meter.model_copy(update={"enough": True, "still_needed": 0}), None)
    chosen = next_shot(now)
    if chosen is None:
        return TableAdvice(meter, None)
    update: dict[str, Any] = {"after_next_mm": expanded(chosen.after_mm)}
    if wanted_mm is not None:
        update["still_needed"] = _still_needed(now, wanted_mm / COVERAGE)
    return TableAdvice(meter.model_copy(update=update), chosen)


def _still_needed(now: TableSituation, wanted_sigma_mm: float) -> int | None:
    """Return how many more captures, all around, reach a figure; None: more than a dozen."""
    current = _current(now)
    shots = [one for _, _, one in shots_at(now, current, _free(now, current)[::2])]
    for other in range(len(now.table.names)):
        if other != current:
            shots += [one for _, _, one in shots_at(now, other, _free(now, other)[::2])]
    shots = shots[:_MOST]
    after = _after(now, [shots[: n + 1] for n in range(len(shots))])
    return next((n + 1 for n, sigma in enumerate(after) if sigma <= wanted_sigma_mm), None)


def planned_shots(now: TableSituation, count: int) -> list[TableShot]:
    """Return the next captures on the table, each the one that helps most when it is chosen."""
    planned: list[TableShot] = []
    for _ in range(count):
        shot = next_shot(now)
        if shot is None:
            break
        now = _with_shot(now, shot)
        planned.append(replace(shot, after_mm=_after(now, [[]])[0]))
    return planned


def _with_shot(now: TableSituation, shot: TableShot) -> TableSituation:
    table = now.table
    if shot.mount not in table.names:
        up = 1.0 if table.frame.axis @ table.state.rotation[:, 2] > 0 else -1.0
        place = table.state.mounts[_current(now)] + np.array([0.0, 0.0, up * (shot.higher_mm or 0.0)])
        table = table.with_mount(shot.mount, place)
    angle = float(np.deg2rad(shot.table_deg))
    center = table.center_in_base(table.names.index(shot.mount), angle)
    given, room = now.still.assumed, now.still.room
    seen = (shot.pose @ given.mount_from_laser).inverse().apply(center)
    sphere: SphereObservation = room.sight.observation(
        f"n{len(now.taken)}", shot.pose, seen, given.sphere.radius_mm
    )
    return replace(now, table=table, taken=(*now.taken, TableObservation(sphere, angle, shot.mount)))
