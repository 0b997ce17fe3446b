"""Before a cell of any topology stands: captures of each ball by each scanner, and what they tell of it."""

from collections import Counter
from collections.abc import Iterator

import numpy as np

from calib_core.cell.titles import axis_title, scanner_title
from calib_core.chain.undetermined import open_directions
from calib_core.evidence.numbers import COVERAGE
from calib_core.frame_graph import apart_moves
from calib_core.frames import FloatArray, RigidTransform
from calib_core.guidance.described import CellThoughtOf
from calib_core.guidance.design import worst_sigma
from calib_core.guidance.solved_plan import Shot, planned_with_covariance
from calib_core.messages import Message, message
from calib_core.poses.numbers import to_pose
from calib_core.records import Record
from calib_core.records.base import Matrix4

_EACH, _LEAST_EACH, _MOST = 10, 6, 120  # captures by one scanner of one ball; of all together
_OPEN_MM = 20.0  # beyond it ± is no figure
_OPEN_RAD = np.deg2rad(2.0)


class PlannedCapture(Record):
    """One capture of a cell that does not stand yet: where about flange and axes are, and ± (k = 2) after it.

    `uncertainty_mm` is of where a ball is seen, at worst, null while a direction is open; `by_robot` says whether
    the robot's pose matters.
    """

    scanner: str | None
    sphere: str
    base_from_tool0: Matrix4
    numbers: list[float]
    by_robot: bool
    axes_deg: dict[str, float] | None = None
    axes_mm: dict[str, float] | None = None
    uncertainty_mm: float | None


class PlannedEdge(Record):
    """What a plan will tell of a scanner, of where one is to another, or of an axis: ± (k = 2), worst direction.

    A figure is null where the captures leave a direction open, or where there is none: `open` says what.  `title`
    is what people call it.
    """

    name: str
    title: str
    position_mm: float | None
    orientation_deg: float | None
    open: list[str]


class EdgesPlan(Record):
    """The captures to take, in the order in which they help most, and what they tell.

    `reachable` is null where no ± is wanted; `unseen` says what a scanner does not see from where it stands.
    """

    reachable: bool | None
    uncertainty_mm: float | None
    captures: list[PlannedCapture]
    edges: list[PlannedEdge]
    unseen: list[str]
    sentence: str


def plan_edges(known: CellThoughtOf, wanted_mm: float | None, most: int) -> EdgesPlan:
    """Return the captures of a described cell that tell its edges, as many as it takes."""
    count = min(max(_EACH * len(known.pairs), most), _MOST)
    until = 0.0 if wanted_mm is None else wanted_mm / COVERAGE
    shots, covariance = planned_with_covariance(known, count, until_mm=until, least_each=_LEAST_EACH)
    captures = [_capture(known, shot) for shot in shots]
    reached = captures[-1].uncertainty_mm if captures else None
    reachable = None if wanted_mm is None else reached is not None and reached <= wanted_mm
    return EdgesPlan(
        reachable=reachable,
        uncertainty_mm=reached,
        captures=captures,
        edges=[*_edges(known, covariance)] if captures else [],
        unseen=[*_unseen(known, shots)],
        sentence=_sentence(known, shots, reached, wanted_mm, reachable),
    )


def _unseen(known: CellThoughtOf, shots: list[Shot]) -> Iterator[Message]:
    seen = {(shot.scanner, shot.sphere) for shot in shots}
    for s, p in known.pairs:
        (scanner, on), (carrier, sphere) = known.layout.mounts[s], known.layout.places[p]
        if (scanner, sphere) not in seen:
            yield message(
                "The scanner '{scanner}' does not see '{sphere}' on '{carrier}': bring it nearer to the axis, or "
                "tell where it is (center_mm).",
                scanner=scanner or on, sphere=sphere, carrier=carrier,
            )  # fmt: skip


def _capture(known: CellThoughtOf, shot: Shot) -> PlannedCapture:
    kinds = {axis.name: axis.kind for axis in known.layout.axes}
    degrees = {n: round(float(np.rad2deg(v)), 2) for n, v in shot.readings.items() if kinds[n] == "rotary"}
    millimetres = {n: round(v, 2) for n, v in shot.readings.items() if kinds[n] == "linear"}
    return PlannedCapture(
        scanner=shot.scanner or None,
        sphere=shot.sphere,
        base_from_tool0=shot.pose.to_rows(),
        numbers=to_pose(known.cell.pose_convention, shot.pose),
        by_robot=shot.by_robot,
        axes_deg=degrees or None,
        axes_mm=millimetres or None,
        uncertainty_mm=COVERAGE * shot.after_mm if shot.after_mm < _OPEN_MM else None,
    )


def _edges(known: CellThoughtOf, covariance: FloatArray) -> Iterator[PlannedEdge]:
    """Give every scanner, where each is to the first one on the same carrier, and every axis."""
    layout, firsts = known.layout, dict[str, int]()
    alone = len(layout.mounts) == 1  # a result names it by what carries it
    for n, (told, on) in enumerate(layout.mounts):
        name = "" if alone else told
        own = covariance[layout.mount(n), layout.mount(n)]
        frame = f"{on}_from_laser" + (f":{name}" if name else "")
        yield _edge(frame, scanner_title(on, "laser", name), own[3:, 3:], own[:3, :3], own)
        if (first := firsts.setdefault(on, n)) != n:
            into, outof = f"laser:{layout.mounts[first][0]}", f"laser:{name}"
            apart = _apart(known, covariance, first, n)
            yield _edge(f"{into}_from_{outof}", scanner_title(into, outof, None), *apart)
    for a, axis in enumerate(layout.axes):
        own = covariance[layout.axis(a), layout.axis(a)]
        place = None if axis.slides else own[2:4, 2:4]
        yield _edge(axis.name, axis_title(axis.name, axis.kind), place, own[:2, :2])


def _apart(known: CellThoughtOf, covariance: FloatArray, one: int, other: int) -> tuple[FloatArray, FloatArray]:
    """Return the covariances of where a scanner is to another, (3, 3) of its position and of its rotation."""
    at, both = known.position, np.r_[known.layout.mount(one), known.layout.mount(other)]
    mounts = [
        RigidTransform.of(at.mount_rotations[n], at.mount_translations[n], "tool0", "laser") for n in (one, other)
    ]
    moves = apart_moves(*mounts)
    own = moves @ covariance[np.ix_(both, both)] @ moves.T
    return own[3:, 3:], own[:3, :3]


def _edge(
    name: str, title: str, place: FloatArray | None, turn: FloatArray, scanner: FloatArray | None = None
) -> PlannedEdge:
    position = None if place is None else float(worst_sigma(place))
    rotation = float(worst_sigma(turn))
    told = [] if scanner is None else [str(one.description) for one in open_directions(scanner)]
    if scanner is None and position is not None and position > _OPEN_MM:
        told.append(message("the place of '{edge}'", edge=name))
    if scanner is None and rotation > _OPEN_RAD:
        told.append(message("the direction of '{edge}'", edge=name))
    return PlannedEdge(
        name=name,
        title=title,
        position_mm=None if position is None or position > _OPEN_MM else COVERAGE * position,
        orientation_deg=None if rotation > _OPEN_RAD else float(np.rad2deg(COVERAGE * rotation)),
        open=told,
    )


def _sentence(
    known: CellThoughtOf, shots: list[Shot], reached: float | None, wanted_mm: float | None, reachable: bool | None
) -> Message:
    counted = Counter((shot.scanner, shot.sphere) for shot in shots)
    several = len(known.layout.mounts) > 1
    each: list[Message] = [
        message("{count} of '{sphere}' by '{scanner}'", count=count, sphere=sphere, scanner=scanner)
        if several
        else message("{count} of '{sphere}'", count=count, sphere=sphere)
        for (scanner, sphere), count in counted.items()
    ]
    if reached is None:
        return message(
            "{count} captures leave open where a sphere is seen: {each:,}.", count=len(shots), each=each
        )
    if reachable is False:
        return message(
            "± {wanted_mm:g} mm is out of reach: {count} captures leave ± {reached_mm:.2g} mm of where a sphere "
            "is seen: {each:,}.",
            wanted_mm=wanted_mm or 0.0, count=len(shots), reached_mm=reached, each=each,
        )  # fmt: skip
    return message(
        "± {reached_mm:.2g} mm of where a sphere is seen takes {count} captures: {each:,}.",
        reached_mm=reached, count=len(shots), each=each,
    )  # fmt: skip
