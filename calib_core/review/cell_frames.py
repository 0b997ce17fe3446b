"""The frames of a session: which transforms its captures measure, which are known, solved or still sought."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, cast

import numpy as np
from pydantic import Field

from calib_core.captures.content import pose_of
from calib_core.cell.axes import axes_of, carrier_of_axis, names_axes
from calib_core.cell.carriers import other_end, scanner_mount, scanner_names
from calib_core.cell.found import answering, as_used, scanner_answered, table_seen, turntable_name
from calib_core.errors import ConflictError, InputError, NotFoundError
from calib_core.frame_graph import EdgeState, FoundTransform, FrameEdge, FrameGraph
from calib_core.frames import FloatArray, Frame, RigidTransform
from calib_core.graph.registry import STAGES, stages
from calib_core.records import Capture, FoundAxis, Matrix4, Record, Session
from calib_core.records.base import Rows
from calib_core.review.asked_frames import AskedFrame, told_by_result
from calib_core.steps import optics_stages, steps_that_show, table_stages, tool_stages


class ListedFrame(Record):
    """An edge of the graph: 4×4 rows in mm, covariance 6×6 of rx ry rz tx ty tz in rad and mm, where it has them.

    `state` is `measured` (with a capture), `known` (brought by the user), `solved` or `sought`; `source` the
    capture, field or stage that it is of.
    """

    name: str
    state: EdgeState
    source: str
    scanner: str | None = None
    stale: bool = False
    matrix: Matrix4 | None = None
    covariance: Rows | None = None


class ListedAxis(Record):
    """An axis that the cell names: as a result has it (`axes` there), null while it is sought.

    `on` is what it stands on; `state`, `source` and `stale` are as of an edge.
    """

    name: str
    kind: Literal["rotary", "linear"]
    carries: Literal["object", "robot"]
    on: str
    state: EdgeState
    source: str
    stale: bool = False
    found: FoundAxis | None = None


class SessionFrames(Record):
    """The frames of a session, for one of its captures where that was named, and the transform asked for."""

    session: str
    capture: str | None = None
    scanner: str | None = None
    edges: list[ListedFrame]
    axes: list[ListedAxis] = Field(default_factory=list[ListedAxis])
    asked: AskedFrame | None = None


def session_frames(
    session: Session,
    results: Mapping[str, Mapping[str, Any]],
    stale: Collection[str] = (),
    asked: tuple[str, str] | None = None,
    capture: str | None = None,
) -> SessionFrames:
    """Return a session's frames, and the transform ``into_from_outof`` that is `asked` for.

    Raises
    ------
    NotFoundError
        If there is no such capture.
    InputError
        If a frame is unknown.
    ConflictError
        If what is asked for does not follow from what is known.
    """
    graph = frame_graph(session, results, stale, capture)
    told = None
    if asked is not None:
        table = turntable_name(session.cell, results)
        told = told_by_result(results, stale, *asked, table)
        if told is None:
            plain = ["turntable" if name == table else name for name in asked]
            into, outof, scanner = _of_one_scanner(session, *plain)
            way = (frame_graph(session, results, stale, capture, scanner) if scanner else graph).find(into, outof)
            told = _asked(f"{asked[0]}_from_{asked[1]}", _determined(way, results))
    return SessionFrames(
        session=session.name,
        capture=capture,
        scanner=_scanner(session, _named(session, capture)),
        edges=[_listed(edge, results) for edge in graph.edges],
        axes=[*_axes(session, _Solved(results, stale))],
        asked=told,
    )


def frame_graph(
    session: Session,
    results: Mapping[str, Mapping[str, Any]],
    stale: Collection[str] = (),
    capture: str | None = None,
    scanner: str | None = None,
) -> FrameGraph:
    """Return the frames of a session, with the robot's pose of one capture where that is named.

    A cell with several scanners has an edge for each; `scanner`, or the one that `capture` (or most captures) saw,
    comes first.

    Raises
    ------
    NotFoundError
        If there is no such capture.
    """
    chosen = _named(session, capture)
    solved = _Solved(results, stale)
    edges = [_robot(session, chosen, solved), *_tools(session, solved, scanner or _scanner(session, chosen))]
    if _has_table(session):
        edges += _table(session, solved)
    sphere = (*tool_stages(), *table_stages())
    for stage in [one for one in stages() if one.name not in sphere]:
        names = [name for name in stage.frames if _fits(session, name)]
        edges += [edge for name in names for edge in _optics(session, solved, stage.name, name)]
    return FrameGraph(edges, _shared(session, solved))


@dataclass(frozen=True, eq=False)
class _Solved:
    """The results of a session's stages, as JSON data, and which of them are stale."""

    results: Mapping[str, Mapping[str, Any]]
    stale: Collection[str]

    def first(self, stages: Sequence[str]) -> str | None:
        """Return the first of some stages that is solved."""
        return next((stage for stage in stages if stage in self.results), None)

    def of_scanner(self, scanner: str | None) -> FrameEdge | None:
        """Return where one of several scanners was found to be on what carries it."""
        stage = self.first(tool_stages())
        for frame in [] if stage is None or scanner is None else as_used(self.results[stage]).get("frames") or []:
            if (frame["outof"], frame.get("scanner")) == ("laser", scanner):
                frames = (cast(Frame, frame["into"]), cast(Frame, "laser"))
                transform = RigidTransform.from_rounded(frame["matrix"], *frames)
                known = np.array(frame["covariance"], dtype=float)
                return FrameEdge(*frames, "solved", str(stage), transform, known, scanner, stage in self.stale)
        return None

    def edge(self, stage: str, name: str, scanner: str | None = None) -> FrameEdge:
        """Return the transform that a stage's result has under a name."""
        into, _, outof = name.partition("_from_")
        frames = (cast(Frame, into), cast(Frame, outof))
        used = as_used(self.results[stage])
        transform = RigidTransform.from_rounded(used[name], *frames)
        known = np.array(used[STAGES.get(stage).frames[name]], dtype=float)[:6, :6]
        return FrameEdge(*frames, "solved", stage, transform, known, scanner, stage in self.stale)


def _of_one_scanner(session: Session, into: str, outof: str) -> tuple[str, str, str | None]:
    """Return two frames, `laser:NAME` as `laser`, and the scanner; raises InputError where two are named."""
    known = {f"laser:{name}": name for name in scanner_names(session.cell)}
    named = [known[name] for name in (into, outof) if name in known]
    if len(named) > 1:
        raise InputError(
            "scanners that one thing carries, and that saw one sphere",
            "{other} and {name}",
            "Ask for each of them in base.",
            other=into,
            name=outof,
        )
    plain = ["laser" if name in known else name for name in (into, outof)]
    return plain[0], plain[1], next(iter(named), None)


def _named(session: Session, capture: str | None) -> Capture | None:
    if capture is None:
        return None
    found = next((one for one in session.captures if one.id == capture), None)
    if found is None:
        raise NotFoundError("a capture of the session", repr(capture)[:80], "Name one of its captures.")
    return found


def _scanner(session: Session, capture: Capture | None) -> str | None:
    """Return the name of the scanner that saw the capture, or most captures; None where they name none."""
    if capture is not None:
        return capture.scanner
    seen = Counter(one.scanner for one in session.captures if one.scanner is not None)
    return seen.most_common(1)[0][0] if seen else None


def _robot(session: Session, capture: Capture | None, solved: _Solved) -> FrameEdge:
    if capture is None or capture.pose is None:
        return FrameEdge("base", "tool0", "measured", "captures" if capture is None else capture.id)
    pose = pose_of(session.cell, capture)
    return FrameEdge("base", "tool0", "measured", capture.id, pose, _pose_covariance(solved))


def _pose_covariance(solved: _Solved) -> FloatArray | None:
    """Return the covariance of one pose by the robot's sigmas that the tool's stage found or was told."""
    stage = solved.first(tool_stages())
    found = {} if stage is None else solved.results[stage].get("variance_components") or {}
    if "position_sigma_mm" not in found:
        return None
    turned = found["orientation_sigma_rad"] ** 2 + found.get("alike_orientation_sigma_rad", 0.0) ** 2
    moved = found["position_sigma_mm"] ** 2 + found.get("alike_position_sigma_mm", 0.0) ** 2
    return np.diag([turned] * 3 + [moved] * 3)


def _tools(session: Session, solved: _Solved, seen: str | None) -> list[FrameEdge]:
    """Return the scanner's edge on its mount; of several scanners one edge each, the one that saw first."""
    named: list[str | None] = sorted(scanner_names(session.cell), key=lambda name: name != seen)
    if seen not in named:
        named.insert(0, seen)
    solved_of = _scanner(session, None)
    return [_tool(session, solved, name, name == solved_of) for name in named]


def _tool(session: Session, solved: _Solved, scanner: str | None, is_it: bool) -> FrameEdge:
    """Return one scanner's edge; known and solved is that of the scanner that most captures saw."""
    mount = scanner_mount(session.cell, scanner)
    name = f"{mount}_from_laser"
    found = solved.of_scanner(scanner)
    if found is not None:
        return found
    known = getattr(session.cell.known, name)
    if known is not None and is_it:
        transform = RigidTransform.from_rounded(known, mount, "laser")
        return FrameEdge(mount, "laser", "known", f"cell.known.{name}", transform, scanner=scanner)
    stage = answering(solved.results) if is_it else None
    result = {} if stage is None else solved.results[stage]
    if stage in tool_stages() and result.get(name) is not None:
        return solved.edge(stage, name, scanner)
    if stage is None or stage in tool_stages() or table_seen(result):
        return FrameEdge(mount, "laser", "sought", tool_stages()[-1], scanner=scanner)
    return FrameEdge(mount, "laser", "solved", stage, *scanner_answered(result), scanner, stage in solved.stale)


def _has_table(session: Session) -> bool:
    """Return whether the cell has a turntable: captures of it, or a frame of it that the user brought."""
    on_table = steps_that_show("sphere-on-table")
    return session.cell.known.base_from_turntable is not None or any(
        one.step in on_table or one.table_deg is not None for one in session.captures
    )


def _table(session: Session, solved: _Solved) -> list[FrameEdge]:
    """Return the table's edge in base, or in the scanner's frame where it is known to that alone."""
    known = session.cell.known.base_from_turntable
    if known is not None:
        transform = RigidTransform.from_rounded(known, "base", "turntable")
        return [FrameEdge("base", "turntable", "known", "cell.known.base_from_turntable", transform)]
    stage = solved.first(table_stages())
    if stage is None:
        return [FrameEdge("base", "turntable", "sought", table_stages()[-1])]
    if (seen := table_seen(solved.results[stage])) is None:
        return [solved.edge(stage, "base_from_turntable")]
    there = RigidTransform.from_rounded(seen.matrix, "laser", "turntable")
    covariance, scanner = np.array(seen.covariance, dtype=float), seen.into.partition(":")[2] or None
    return [FrameEdge("laser", "turntable", "solved", stage, there, covariance, scanner, stage in solved.stale)]


def _axes(session: Session, solved: _Solved) -> Iterator[ListedAxis]:
    """Give the axes that a cell names, as the best of its results has them."""
    named = axes_of(session.cell) if names_axes(session.cell) else ()
    stages = [stage for stage in (*tool_stages(), *table_stages()) if stage in solved.results]
    for axis in named:
        found = {
            stage: one
            for stage in stages
            for one in solved.results[stage].get("axes") or ()
            if one["name"] == axis.name
        }
        stage = next(iter(found), None)
        yield ListedAxis(
            name=axis.name,
            kind=axis.kind,
            carries=axis.carries,
            on=carrier_of_axis(axis, named),
            state="sought" if stage is None else "solved",
            source=stage or table_stages()[-1],
            stale=stage in solved.stale,
            found=None if stage is None else FoundAxis.model_validate(found[stage]),
        )


def _fits(session: Session, name: str) -> bool:
    """Return whether what a frame is of, camera or board, is on what carries it in this cell."""
    into, _, outof = name.partition("_from_")
    mount = scanner_mount(session.cell)
    carried = {"camera": mount, "board": other_end(mount)}
    return carried.get(outof, into) == into


def _optics(session: Session, solved: _Solved, stage: str, name: str) -> list[FrameEdge]:
    """Return the edge that a stage of the camera gives; one that is sought only where boards were captured."""
    if solved.results.get(stage, {}).get(name) is not None:
        return [solved.edge(stage, name)]
    into, _, outof = name.partition("_from_")
    boards = any(one.step in optics_stages() for one in session.captures)
    return [FrameEdge(cast(Frame, into), cast(Frame, outof), "sought", stage)] if boards else []


def _shared(session: Session, solved: _Solved) -> dict[tuple[str, str], FloatArray]:
    """Return what tool and table share where one stage gives both."""
    stage = solved.first(tool_stages())
    shared = None if stage is None else as_used(solved.results[stage]).get("cross_covariance")
    if shared is None:
        return {}
    return {(f"{scanner_mount(session.cell)}_from_laser", "base_from_turntable"): np.array(shared, dtype=float)}


def _is_open(edge: FrameEdge, results: Mapping[str, Mapping[str, Any]]) -> bool:
    """Return whether the motions leave open where a scanner or table is."""
    return (
        edge.into != "laser"
        and edge.outof in ("laser", "turntable")
        and bool(results.get(edge.source, {}).get("up_to_shift"))
    )


def _determined(found: FoundTransform, results: Mapping[str, Mapping[str, Any]]) -> FoundTransform:
    """Return what was found; raises ConflictError where it needs scanner or table alone and that is open."""
    if sum(_is_open(edge, results) for edge in found.through) == 1:
        raise ConflictError(
            "a transform that the motions determine",
            "one that the captures leave open",
            "Tilt the flange by 10 to 30° about two axes and capture again, or measure the position.",
        )
    return found


def _listed(edge: FrameEdge, results: Mapping[str, Mapping[str, Any]]) -> ListedFrame:
    if _is_open(edge, results):
        edge = replace(edge, state="sought", transform=None, covariance=None)
    return ListedFrame(
        name=edge.name,
        state=edge.state,
        source=edge.source,
        scanner=edge.scanner,
        stale=edge.stale,
        matrix=None if edge.transform is None else edge.transform.to_rows(),
        covariance=None if edge.covariance is None else edge.covariance.tolist(),
    )


def _asked(name: str, found: FoundTransform) -> AskedFrame:
    return AskedFrame(
        name=name,
        matrix=found.transform.to_rows(),
        covariance=found.covariance.tolist(),
        through=[edge.name for edge in found.through],
        stale=any(edge.stale for edge in found.through),
        without_covariance=list(found.without_covariance),
    )
