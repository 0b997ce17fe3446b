"""Mountings of several balls on a table or positioner: arcs told apart, and named as the cell names them."""

from dataclasses import replace
from itertools import pairwise

from calib_core.cell.carriers import told_balls, told_distances
from calib_core.chain.observations import SphereSize, TableObservation, TableObservations
from calib_core.chain.table_captures import balls_of_arcs
from calib_core.chain.table_given import KnownTool, TurntableOptions
from calib_core.chain.turntable import TurntableSolution
from calib_core.records import Cell
from calib_core.stages.tcp.balls import with_told_names


def balls_of_mountings(
    arcs: TableObservations, sphere: SphereSize, tool: KnownTool, options: TurntableOptions
) -> list[TableObservation] | None:
    """Return arcs with a mounting for each ball, None where one ball in each explains them.

    Arcs of no ball have a sphere whose `ball` is empty.
    """
    balls = balls_of_arcs(arcs, sphere, tool, options)
    if balls is None:
        return None
    several = {o.mount for o, n in zip(arcs, balls, strict=True) if n > 0}
    return [_with_ball(o, int(n), o.mount in several) for o, n in zip(arcs, balls, strict=True)]


def balls_in_turn(
    cell: Cell, captures: TableObservations, sphere: SphereSize, tool: KnownTool, options: TurntableOptions
) -> list[TableObservation] | None:
    """Return captures of balls that are never seen at once, with a mounting for each; None where there are none.

    One that was seen at a place, and from some capture on at another, is one ball that was moved.
    """
    named = balls_of_mountings(captures, sphere, tool, options)
    for mount in {o.mount for o in captures} if named else ():
        own = [
            one.mount for one, o in zip(named or (), captures, strict=True) if o.mount == mount and one.sphere.ball
        ]
        balls, changes = len({*own}), sum(one != other for one, other in pairwise(own))
        told = max(len(told_balls(cell, o.axis)) for o in captures if o.mount == mount)
        if balls > 1 and changes < balls and told < 2:
            return None
    return named


def _with_ball(arc: TableObservation, ball: int, among_several: bool) -> TableObservation:
    name = f"{arc.mount or 'sphere'}-{ball + 1}" if among_several else arc.mount
    return replace(arc, mount=name, sphere=replace(arc.sphere, ball="" if ball < 0 else name or "sphere"))


def named_by_distances(
    cell: Cell, arcs: TableObservations, solution: TurntableSolution
) -> list[TableObservation] | None:
    """Return arcs whose balls have the cell's names, where told distances name them; None where they do not."""
    told, known = told_distances(cell), with_told_names(cell, solution.state, solution.unknowns_covariance)
    named = {name for one in told for name in (one.one, one.other)}
    names = {place: name if name in named else place[1] for place, name in known.items()}
    if not any(names[o.axis, o.mount] in named for o in arcs):
        return None
    return [replace(o, mount=names[o.axis, o.mount]) for o in arcs]
