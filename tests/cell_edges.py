"""The edges of a cell, listed from its record: what the simulator is checked by, apart from how solvers walk them.

From base outwards: the axes, the robot's pose, the mount of each scanner on the flange or in base, and the place
of each ball on what carries it.  The frame that an axis moves bears the axis's name; that of the axis `table` is
`turntable`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from calib_core.cell.axes import axes_of, carrier_of_axis, frame_of, readings
from calib_core.cell.carriers import ball_name, other_end, scanner_mount
from calib_core.cell.consistency import require_consistent
from calib_core.records import Capture, Cell, CellAxis, Scanner, Sphere
from calib_core.steps import steps_that_show

EdgeKind = Literal["axis", "pose", "mount", "place"]


@dataclass(frozen=True)
class Edge:
    """One link of a cell: `outof` moves with `into`.

    Attributes
    ----------
    kind : str
        `axis`: where it stands is sought, how far it moved is read in each capture; `pose`: measured in each
        capture; `mount` of a scanner and `place` of a ball: fixed, sought or known.
    name : str
        Of the axis, scanner or ball; empty of the robot and of a scanner that has no name.
    into, outof : str
        What carries, and what is carried: `base`, `tool0`, `turntable`, an axis's name, `laser` or `laser:NAME`,
        and of a ball `ball:NAME`.
    told : CellAxis, Scanner, Sphere or None
        Its record.
    """

    kind: EdgeKind
    name: str
    into: str
    outof: str
    told: CellAxis | Scanner | Sphere | None = None


@dataclass(frozen=True)
class Edges:
    """The edges of a cell, each after what carries it: a tree whose root is base."""

    all: tuple[Edge, ...]

    def of(self, kind: EdgeKind) -> tuple[Edge, ...]:
        """Return the edges of one kind."""
        return tuple(edge for edge in self.all if edge.kind == kind)

    def to_base(self, frame: str) -> tuple[Edge, ...]:
        """Return the edges from a frame of the cell down to base, the frame's own first."""
        found: list[Edge] = []
        while frame != "base":
            found.append(next(edge for edge in self.all if edge.outof == frame))
            frame = found[-1].into
        return tuple(found)

    def way(self, into: str, outof: str) -> tuple[tuple[Edge, bool], ...]:
        """Return the edges from `into` to `outof`, each with whether it is passed against its direction.

        What both have in common on their way to base moves nothing between them, and is not on it.
        """
        down, up = self.to_base(into), self.to_base(outof)
        backwards = [(edge, True) for edge in down if edge not in up]
        return (*backwards, *((edge, False) for edge in reversed(up) if edge not in down))


def edges_of(cell: Cell, captures: Sequence[Capture] = ()) -> Edges:
    """Return the edges of a cell.

    Parameters
    ----------
    cell : Cell
    captures : sequence of Capture
        They tell of the turntable and of the ball's mountings on it, where the cell does not.

    Raises
    ------
    InputError
        If the record contradicts itself or the captures: a loop, a gap, a name that is told twice.
    """
    require_consistent(cell, captures)
    axes = axes_of(cell, captures)
    mounts = [*_mounts(cell)]
    return Edges((*_axes(axes), _pose(axes), *mounts, *_balls(cell, captures, axes, mounts)))


def _axes(axes: Sequence[CellAxis]) -> Iterator[Edge]:
    """Give the axes, each after the one that carries it."""
    waiting, given = [*axes], {"base"}
    while waiting:
        axis = next(one for one in waiting if carrier_of_axis(one, axes) in given)
        waiting.remove(axis)
        given.add(axis.name)
        yield Edge("axis", axis.name, frame_of(carrier_of_axis(axis, axes)), frame_of(axis.name), axis)


def _pose(axes: Sequence[CellAxis]) -> Edge:
    under = [axis.name for axis in axes if axis.carries == "robot"]
    return Edge("pose", "", frame_of(under[-1]) if under else "base", "tool0")


def _mounts(cell: Cell) -> Iterator[Edge]:
    if not cell.scanners:
        yield Edge("mount", "", scanner_mount(cell), "laser", cell.scanner)
    for name, scanner in (cell.scanners or {}).items():
        yield Edge("mount", name, scanner_mount(cell, name), f"laser:{name}", scanner)


def _balls(
    cell: Cell, captures: Sequence[Capture], axes: Sequence[CellAxis], mounts: Sequence[Edge]
) -> Iterator[Edge]:
    """Give the balls of the cell.

    Where it names none: one at the robot's other end from each kind of mount, and each mounting on the last axis
    that moved between its captures.
    """
    ends = [end for end in ("base", "tool0") if any(end == other_end(scanner_mount(cell, m.name)) for m in mounts)]
    for ball in cell.spheres or []:
        yield Edge("place", ball.name, frame_of(ball.on or ends[0]), f"ball:{ball.name}", ball)
    if cell.spheres:
        return
    for end in ends:
        name = ball_name(end)
        yield Edge("place", name, end, f"ball:{name}")
    carrying = [axis.name for axis in axes if axis.carries == "object"]
    shown = [one for one in captures if one.step in steps_that_show("sphere-on-table")]
    for mount in dict.fromkeys(one.mount for one in shown if carrying):
        stood = [readings(one) for one in shown if one.mount == mount]
        moved = [name for name in carrying if len({where.get(name) for where in stood}) > 1]
        name = mount or "sphere-on-table"
        yield Edge("place", name, frame_of((moved or carrying)[-1]), f"ball:{name}")
