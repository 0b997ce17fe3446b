"""Mountings of several balls on a table or positioner: arcs told apart, and named as the cell names them."""

from collections.abc import Sequence
from dataclasses import replace

from calib_core.cell.carriers import told_distances
from calib_core.chain.observations import SphereSize, TableObservation
from calib_core.chain.turntable import KnownTool, TurntableOptions, TurntableSolution, balls_of_arcs
from calib_core.records import Cell
from calib_core.stages.tcp.balls import with_told_names


def balls_of_mountings(
    cell: Cell,
    arcs: Sequence[TableObservation],
    sphere: SphereSize,
    tool: KnownTool,
    options: TurntableOptions,
) -> list[TableObservation] | None:
    """Return arcs with a mounting for each ball, None where one ball in each explains them.

    Arcs of no ball have a sphere whose `ball` is empty.
    """
    balls = balls_of_arcs(arcs, sphere, tool, options)
    if balls is None:
        return None
    several = {o.mount for o, n in zip(arcs, balls, strict=True) if n > 0}
    return [_with_ball(o, int(n), o.mount in several) for o, n in zip(arcs, balls, strict=True)]


def _with_ball(arc: TableObservation, ball: int, among_several: bool) -> TableObservation:
    name = f"{arc.mount or 'sphere'}-{ball + 1}" if among_several else arc.mount
    return replace(arc, mount=name, sphere=replace(arc.sphere, ball="" if ball < 0 else name or "sphere"))


def named_by_distances(
    cell: Cell, arcs: Sequence[TableObservation], solution: TurntableSolution
) -> list[TableObservation] | None:
    """Return arcs whose balls have the cell's names, where told distances name them; None where they do not."""
    told, known = told_distances(cell), with_told_names(cell, solution.state, solution.unknowns_covariance)
    named = {name for one in told for name in (one.one, one.other)}
    names = {place: name if name in named else place[1] for place, name in known.items()}
    if not any(names[o.axis, o.mount] in named for o in arcs):
        return None
    return [replace(o, mount=names[o.axis, o.mount]) for o in arcs]
