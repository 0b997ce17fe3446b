"""Captures that show several balls: their arcs told apart, and named as the cell names them."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from calib_core.captures.content import names_by_size
from calib_core.captures.more_arcs import further_arcs
from calib_core.cell.axes import moved_axes
from calib_core.cell.carriers import ball_name, rides_on_axis, told_balls, told_distances
from calib_core.cell.layout import KnownDistance
from calib_core.chain.arrays import layout_of
from calib_core.chain.balls import by_distances, labelled, wrong_distance
from calib_core.chain.foot_of_balls import linear_feet
from calib_core.chain.foot_start import foot_axes, on_foot
from calib_core.chain.held import Held
from calib_core.chain.model import ChainState
from calib_core.chain.observations import Observations, SphereObservation, SphereSize, by_scanner
from calib_core.chain.several_starts import moving_axes
from calib_core.chain.tcp import LEAST_CAPTURES
from calib_core.chain.tcp_solution import TcpSolution
from calib_core.findings import Finding
from calib_core.findings.codes import several_spheres as codes
from calib_core.findings.codes.captures import CAPTURE_OF_NO_BALL
from calib_core.frames import FloatArray
from calib_core.graph.stage_input import Observed, StageInput
from calib_core.records import Cell
from calib_core.records.topology import FoundSphere

_ONE_BALL_MM = 1.5
"""Scatter of a scanner's arcs, as if they were of one ball: what is more is of several."""
_MOST_IN_BALLS = 0.9
_LEAST_WITH_MORE = 3
"""Captures with further arcs; in fewer it is a reflection or another round thing."""


def all_arcs(
    given: StageInput, observations: Observations, carriers: Iterable[str]
) -> list[SphereObservation] | None:
    """Return observations with those of further arcs in their captures; None where nothing hints at several balls.

    `carriers`: what carries the balls that they show.
    """
    by_id = {capture.id: capture for capture in given.captures}
    single = Counter(o.capture for o in observations)
    arcs, with_more = list[SphereObservation](), 0
    for o in observations:
        arcs.append(o)
        if single[o.capture] == 1:  # of a sweep each profile has an arc
            more = [*further_arcs(given.session, by_id[o.capture], given.read)]
            arcs += [replace(one, arm_moves=o.arm_moves) for one in more]
            with_more += bool(more)
    told = max((len(told_balls(given.session.cell, carrier)) for carrier in carriers), default=0)
    return arcs if with_more >= _LEAST_WITH_MORE or told > 1 else None


def with_all_balls(given: StageInput, observed: Observed, sphere: SphereSize) -> Observed:
    """Return what captures saw, arcs of other balls too, where they show several."""
    if (told := _named_by_mounts(given, observed.observations)) is not None:
        return replace(observed, observations=told)
    arcs = all_arcs(given, observed.observations, {o.carriers.ball for o in observed.observations})
    if arcs is None:
        return observed
    named = labelled(_standing(given.session.cell, arcs, sphere), sphere, by_scanner(arcs))
    if named is None:
        return observed
    if len({one.ball for one in named if one.ball}) < 2:
        alone = [replace(arc, sphere=one.sphere) for arc, one in zip(arcs, named, strict=True) if one.ball]
        return replace(observed, observations=alone)
    found = [replace(arc, ball=one.ball, sphere=one.sphere) for arc, one in zip(arcs, named, strict=True)]
    found = named_by_sizes(given.session.cell, found)
    seen = [o for o in found if o.ball]
    unused = [*observed.unused, *of_no_ball([o.capture for o in observed.observations], seen)]
    return Observed(seen, observed.failed, unused)


def named_by_sizes(cell: Cell, arcs: Observations) -> list[SphereObservation]:
    """Return arcs of several balls with the names of those that the cell tells by their sizes."""
    shown = {(o.carriers.ball, o.ball): o.sphere for o in arcs if o.ball}
    found = {
        (carrier, ball): name
        for (carrier, ball), size in shown.items()
        if size is not None
        and [*shown.values()].count(size) == 1
        and (name := names_by_size(cell, carrier).get(size)) is not None
    }
    return [replace(o, ball=found.get((o.carriers.ball, o.ball), o.ball)) for o in arcs]


def _named_by_mounts(given: StageInput, observations: Observations) -> list[SphereObservation] | None:
    """Return observations of the balls that captures name as their mountings; None where these are not several."""
    names = {capture.id: capture.mount or "" for capture in given.captures}
    balls = {names[o.capture] for o in observations}
    if len(balls) < 2 or "" in balls or any(o.sphere is None and o.sizes for o in observations):
        return None
    return [replace(o, ball=names[o.capture]) for o in observations]


def balls_in_turn(
    given: StageInput, observations: Observations, sphere: SphereSize
) -> list[SphereObservation] | None:
    """Return captures of balls that are never seen at once, told apart; None where one ball was moved."""
    if any(o.ball for o in observations):
        return None
    named = labelled(_standing(given.session.cell, observations, sphere), sphere, by_scanner(observations))
    balls = [one.ball for one in named or () if one.ball]
    changes = sum(one != other for one, other in pairwise(balls))
    if len({*balls}) < 2 or changes < len({*balls}) or len(balls) < _MOST_IN_BALLS * len(observations):
        return None
    both = zip(observations, named or (), strict=True)
    return [replace(o, ball=one.ball, sphere=one.sphere) for o, one in both if one.ball]


def _standing(cell: Cell, arcs: Observations, sphere: SphereSize) -> Observations:
    """Return arcs as of a robot whose foot stands still, where they tell how its axes lie; else as they are.

    A scanner that sees one ball tells it, or one before which arcs of some ball come together.
    """
    layout = layout_of(arcs, moving_axes(arcs, moved_axes(cell)))
    groups = by_scanner(arcs) if layout.axes else []
    for some in groups:
        own = [arcs[k] for k in some]
        if len(told_balls(cell, own[0].carriers.ball)) < 2 and len(own) >= LEAST_CAPTURES:
            axes, start = foot_axes(own, sphere, layout)
            if start.scatter_mm < _ONE_BALL_MM:
                return on_foot(arcs, layout, axes)
    for some in sorted(groups, key=len, reverse=True):
        if (found := linear_feet([arcs[k] for k in some], sphere, layout)) is not None:
            return on_foot(arcs, layout, found)
    return arcs


def of_no_ball(own: Sequence[str], found: Observations) -> list[Finding]:
    """Return the captures none of whose arcs is among those of balls that were found."""
    kept = {o.capture for o in found}
    stray = list(dict.fromkeys(name for name in own if name not in kept))
    return [CAPTURE_OF_NO_BALL(stray)] if stray else []


def with_told_names(cell: Cell, state: ChainState, covariance: FloatArray) -> Mapping[tuple[str, str], str]:
    """Return the names of balls by what carries each and how they were told apart: the cell's where those fit."""
    layout = state.walk.layout
    of_carrier = Counter(carrier for carrier, _ in layout.places)
    names = {
        (on, name): _alone(cell, on, name if of_carrier[on] > 1 or rides_on_axis(on) else "")
        for on, name in layout.places
    }
    for carrier in {carrier for carrier, _ in layout.places}:
        some = [n for n, (on, _) in enumerate(layout.places) if on == carrier]
        told = [ball.name for ball in told_balls(cell, carrier)]
        found = by_distances(*placed(state, covariance, some), told, told_distances(cell)) if len(some) > 1 else []
        for n, name in zip(some, found[0] if found else (), strict=False):
            names[layout.places[n]] = name
    return names


def placed(state: ChainState, covariance: FloatArray, some: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Return the places (B, 3) of some balls, and their part of the unknowns' covariance."""
    columns = np.concatenate([np.arange(3) + state.walk.layout.firsts[n] for n in some])
    return state.position.places[some], covariance[np.ix_(columns, columns)]


def _alone(cell: Cell, carrier: str, name: str) -> str:
    """Return the name of a ball that stands alone on what carries it, or the one by which it was told apart."""
    told = told_balls(cell, carrier)
    return name or (told[0].name if len(told) == 1 else ball_name(carrier))


def named_by_distances(
    cell: Cell, observations: Observations, solution: TcpSolution
) -> list[SphereObservation] | None:
    """Return observations whose balls have the cell's names, where distances of those are told; None without."""
    if not told_distances(cell):
        return None
    names = with_told_names(cell, solution.held.state, solution.held.covariance)
    found = [replace(o, ball=names[o.carriers.ball, o.ball]) for o in observations]
    changed = [one.ball != o.ball for one, o in zip(found, observations, strict=True)]
    return found if np.any(changed) and len(solution.held.state.position.places) > 1 else None


def other_arcs(given: StageInput, observations: Observations, used: np.ndarray) -> list[SphereObservation] | None:
    """Return observations in which captures of two arcs that were not used show the other one; None without."""
    by_id = {capture.id: capture for capture in given.captures}
    single, found = Counter(o.capture for o in observations), list(observations)
    for k in np.flatnonzero(~used).tolist():
        own = observations[k]
        more = further_arcs(given.session, by_id[own.capture], given.read) if single[own.capture] == 1 else ()
        if (other := next(iter(more), None)) is not None:
            found[k] = replace(other, arm_moves=own.arm_moves, ball=own.ball)
    changed = any(one is not own for one, own in zip(found, observations, strict=True))
    return found if changed else None


def findings_of_balls(cell: Cell, held: Held) -> list[Finding]:
    """Return where the balls that no axis carries are not those that the cell tells of."""
    layout = held.state.walk.layout
    still = [n for n in range(len(layout.places)) if not layout.rides[n].any()]
    found: list[Finding] = []
    for carrier in dict.fromkeys(layout.places[n][0] for n in still):
        some = [n for n in still if layout.places[n][0] == carrier]
        told, many = [ball.name for ball in told_balls(cell, carrier)], len(some)
        if many < len(told):
            found.append(codes.NOT_ALL_SEEN(count=many, told=len(told)))
        elif many > len(told) > 0:
            found.append(codes.MORE_THAN_TOLD(count=many, told=len(told)))
        if many > 1 and any({d.one, d.other} <= {*told} for d in told_distances(cell)):
            there = placed(held.state, held.covariance, some)
            ways = len(by_distances(*there, told, told_distances(cell)))
            found += [_not_used(wrong_distance(*there, told, told_distances(cell)))] if ways == 0 else []
            found += [codes.NAMED_EITHER_WAY(count=ways)] if ways > 1 else []
    return found


def _not_used(wrong: tuple[KnownDistance, float] | None) -> Finding:
    if wrong is None:
        return codes.DISTANCES_NOT_USED(contradicted="all")
    known, found_mm = wrong
    return codes.DISTANCES_NOT_USED(
        contradicted="one", first=known.one, second=known.other, found_mm=found_mm, told_mm=known.mm
    )


def spheres_found(cell: Cell, solution: TcpSolution) -> list[FoundSphere]:
    """Return every ball that no axis carries, and who saw it."""
    held = solution.held
    names = with_told_names(cell, held.state, held.covariance)
    walk, found = held.state.walk, list[FoundSphere]()
    for n, (carrier, name) in enumerate(walk.layout.places):
        if walk.layout.rides[n].any():
            continue
        place = walk.layout.place(n)
        seen = [solution.each.ids[k] for k in np.flatnonzero(solution.each.used) if walk.place[k] == n]
        found.append(
            FoundSphere.model_validate(
                {
                    "name": names[carrier, name],
                    "in": carrier,
                    "center_mm": held.state.position.places[n].tolist(),
                    "covariance": held.covariance[place, place].tolist(),
                    "captures": list(dict.fromkeys(seen)),
                }
            )
        )
    return found
