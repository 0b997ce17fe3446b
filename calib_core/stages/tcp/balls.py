"""Captures that show several balls: their arcs told apart, and named as the cell names them."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from calib_core.captures.more_arcs import further_arcs
from calib_core.cell.carriers import ball_name, told_balls, told_distances
from calib_core.chain.balls import by_distances, labelled
from calib_core.chain.model import ChainState
from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.tcp import TcpSolution, by_scanner
from calib_core.findings import Finding
from calib_core.findings.codes.captures import CAPTURE_OF_NO_BALL
from calib_core.graph.stage_input import Observed, StageInput
from calib_core.records import Cell
from calib_core.records.topology import FoundSphere

_LEAST_WITH_MORE = 3
"""Captures with further arcs; in fewer it is a reflection or another round thing."""


def all_arcs(
    given: StageInput, observations: Sequence[SphereObservation], carriers: Iterable[str]
) -> list[SphereObservation] | None:
    """Return observations with those of further arcs in their captures; None where nothing hints at several balls.

    `carriers`: what carries the balls that they show.
    """
    by_id = {capture.id: capture for capture in given.captures}
    single = Counter(o.capture for o in observations)
    arcs: list[SphereObservation] = []
    for o in observations:
        arcs.append(o)
        if single[o.capture] == 1:
            more = further_arcs(given.session, by_id[o.capture], given.read)
            arcs += [replace(one, arm_moves=o.arm_moves) for one in more]
    with_more = sum(count > 1 for count in Counter(o.capture for o in arcs).values())
    told = max((len(told_balls(given.session.cell, carrier)) for carrier in carriers), default=0)
    return arcs if with_more >= _LEAST_WITH_MORE or told > 1 else None


def with_all_balls(given: StageInput, observed: Observed, sphere: SphereSize) -> Observed:
    """Return what captures saw, arcs of other balls too, where they show several."""
    arcs = all_arcs(given, observed.observations, {o.carriers.ball for o in observed.observations})
    found = labelled(arcs, sphere, by_scanner(arcs)) if arcs else None
    if found is None:
        return observed
    unused = [*observed.unused, *of_no_ball([o.capture for o in observed.observations], found)]
    return Observed([o for o in found if o.ball], observed.failed, unused)


def of_no_ball(own: Sequence[str], found: Sequence[SphereObservation]) -> list[Finding]:
    """Return the captures none of whose arcs is of a ball."""
    kept = {o.capture for o in found if o.ball}
    stray = list(dict.fromkeys(name for name in own if name not in kept))
    return [CAPTURE_OF_NO_BALL(stray)] if stray else []


def with_told_names(cell: Cell, state: ChainState) -> Mapping[tuple[str, str], str]:
    """Return the names of balls by what carries each and how they were told apart: the cell's where those fit."""
    layout, places = state.walk.layout, state.position.places
    names = {place: _alone(cell, *place) for place in layout.places}
    for carrier in {carrier for carrier, _ in layout.places}:
        some = [n for n, (on, _) in enumerate(layout.places) if on == carrier]
        told = [ball.name for ball in told_balls(cell, carrier)]
        found = by_distances(places[some], told, told_distances(cell)) if len(some) > 1 else None
        for n, name in zip(some, found or (), strict=False):
            names[layout.places[n]] = name
    return names


def _alone(cell: Cell, carrier: str, name: str) -> str:
    """Return the name of a ball that stands alone on what carries it, or the one by which it was told apart."""
    told = told_balls(cell, carrier)
    return name or (told[0].name if len(told) == 1 else ball_name(carrier))


def named_by_distances(
    cell: Cell, observations: Sequence[SphereObservation], solution: TcpSolution
) -> list[SphereObservation] | None:
    """Return observations whose balls have the cell's names, where distances of those are told; None without."""
    if not told_distances(cell):
        return None
    names = with_told_names(cell, solution.held.state)
    found = [replace(o, ball=names[o.carriers.ball, o.ball]) for o in observations]
    changed = [one.ball != o.ball for one, o in zip(found, observations, strict=True)]
    return found if np.any(changed) and len(solution.held.state.position.places) > 1 else None


def spheres_found(cell: Cell, solution: TcpSolution) -> list[FoundSphere]:
    """Return every ball that no axis carries, and who saw it."""
    held, names = solution.held, with_told_names(cell, solution.held.state)
    walk, found = held.state.walk, list[FoundSphere]()
    for n, (carrier, name) in enumerate(walk.layout.places):
        if walk.layout.rides[n].any():
            continue
        place = walk.layout.place(n)
        seen = [solution.captures[k] for k in np.flatnonzero(solution.used) if walk.place[k] == n]
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
