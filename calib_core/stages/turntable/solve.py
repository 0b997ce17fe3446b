"""The turntable stage: the tool first, then the captures of the sphere on the table."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from calib_core.captures.content import sphere_of
from calib_core.captures.lost_rays import lost_rays_of
from calib_core.cell.axes import (
    axis_of_mounts,
    moved_axes,
    names_axes,
    reading_sigmas,
    scales_asked,
    without_directions,
)
from calib_core.cell.carriers import scanner_names, told_distances
from calib_core.cell.found import known_scanner, no_scanner, own_base
from calib_core.chain.observations import SphereObservation, SphereSize, TableObservation
from calib_core.chain.without_turns import open_shifts
from calib_core.errors import InputError, MotionError
from calib_core.findings import Finding, causes_of, judged, sentence_of, verdict_of
from calib_core.findings.codes import placed_scanners
from calib_core.findings.codes import turntable as codes
from calib_core.graph.stage import SOFTWARE
from calib_core.graph.stage_input import SolvedTable, SolvedTcp, StageInput
from calib_core.messages import Names, message
from calib_core.records import Capture, Cell, Progress
from calib_core.stages.tcp.solve import observe_stage, require_told_apart, solve_tcp_captures, with_all_rows
from calib_core.stages.turntable.play import play_findings
from calib_core.stages.turntable.record import TurntableResult

if TYPE_CHECKING:
    from calib_core.chain.late_scanner import LateScanner
    from calib_core.chain.table_given import KnownTool, TurntableOptions
    from calib_core.chain.tcp_solution import TcpSolution
    from calib_core.chain.turntable import TurntableSolution

_TCP_SHARE = 0.4


def solve(given: StageInput) -> TurntableResult:
    """Return the turntable from all its captures that are not excluded, by the tool that is known or solved first.

    Raises
    ------
    InputError
        If a file, a pose or a table angle is missing or of no use, or the angles are in radians.
    MeasurementError
        If most captures do not show the sphere.
    MotionError
        If the motions or the angles do not determine the answer.
    """
    from calib_core.chain.table_given import KnownTool
    from calib_core.stages.tcp.verdict import beyond_told_sigma
    from calib_core.stages.turntable.result import mounts_by_table, turntable_result
    from calib_core.stages.undetermined_places import without_base, without_open_places

    cell = given.session.cell
    own = own_base(cell, given.session.captures)
    known, found, tool = known_scanner(cell) or own, list[Finding](), None
    if own is not None:
        given = replace(given, session=given.session.model_copy(update={"cell": without_directions(cell)}))
        found.append(placed_scanners.TABLE_WITHOUT_BASE())
    if known is not None:
        tool, sphere = KnownTool(known), sphere_of(cell, given.captures)
    elif (solved := tcp_of(given)) is None:
        sphere = sphere_of(cell, given.captures)
    else:
        tool, sphere = tool_of(solved), solved.sphere
        found = about_tool(solved.solution, given.session.captures)
    try:
        table = table_of(given, sphere, tool, part_of(given.progress, _TCP_SHARE, 1.0))
    except MotionError as error:  # the table is not to blame where the tool is wrong
        raise (error.adding(sentence_of(found[0])) if found else error) from None
    found += findings_of_table(given, table, sphere)
    found += beyond_told_sigma(table.solution.sigmas, table.solution.options.position_sigma_mm)
    unused = [*table.unused, *_left_to_chain(table)]
    found += [*lost_rays_of([one.sphere for one in table.observations]), *unused]
    result = turntable_result(table.solution, table.observations, SOFTWARE, given.inputs_sha256, found)
    if cell.turntable.angles != "unknown":
        result = judged(result, play_findings(result))
    if table.sought is not None:
        result = without_open_places(result, table.sought.left_open.shifts)
    elif tool is not None and tool.held is not None:
        result = without_open_places(result, open_shifts(tool.held.data))
    if known is not None:
        late = mounts_by_table(table.solution)
        result = result.model_copy(update={"frames": [*result.frames, *late]})
    if own is not None:
        result = without_base(result, table.observations[0].sphere.scanner)
    return with_all_rows(result, given.captures, unused)


def _left_to_chain(table: SolvedTable) -> list[Finding]:
    """Return that captures of scanners that the table places count in the whole chain alone."""
    return [
        placed_scanners.SCANNER_LEFT_TO_CHAIN(
            [o.sphere.capture for o in one.observations], scanner=one.observations[0].sphere.scanner
        )
        for one in table.late
    ]


def findings_of_table(given: StageInput, table: SolvedTable, sphere: SphereSize) -> list[Finding]:
    """Return what is noticed of a table, with what would explain doubts about its angles."""
    from calib_core.causes.table import table_causes
    from calib_core.stages.turntable.verdict import (
        angles_that_do_not_fit,
        scanner_move_not_checked,
        table_findings,
    )

    alone = own_base(given.session.cell, given.session.captures) is not None
    known_in = "scanner" if alone else "axis" if names_axes(given.session.cell) else "base"
    found = table_findings(table.solution, table.observations, given.session.cell, known_in)
    still = {o.sphere.scanner for o in table.observations if o.placed.carriers.over_robot == 0}
    found += scanner_move_not_checked(given.session.captures, still)
    if (
        verdict_of(found) == "pass"
        or given.session.cell.turntable.angles == "unknown"
        or names_axes(given.session.cell)
    ):
        return found
    given.progress(0.99, "Trying other angles of the table")
    captures = [capture for capture in given.captures if capture.step == "turntable"]
    state = table.solution.state
    mounts = {name: state.mount(n) for n, (name, _) in enumerate(state.walk.layout.mounts)}
    causes = table_causes(captures, table.observations, sphere, mounts)
    if causes and not any(finding.code == codes.ANGLES_DO_NOT_FIT.name for finding in found):
        (otherwise,) = causes_of(causes)[0].evidence
        found = [*angles_that_do_not_fit(table.solution, otherwise_mm=otherwise.after), *found]
    return [*causes, *found]


def tcp_of(given: StageInput) -> SolvedTcp | None:
    """Return the tcp captures' solution, None where there are none; raises as the tcp stage does.

    Arcs that were not told apart are refused, too: by their tool axes are sought for long, and none are found.
    """
    captures = [capture for capture in given.session.captures if capture.step == "tcp"]
    if not captures:
        return None
    own = replace(given, captures=captures, progress=part_of(given.progress, 0.0, _TCP_SHARE))
    solved = solve_tcp_captures(own)
    require_told_apart(own, solved)
    return solved


def tool_of(solved: SolvedTcp) -> "KnownTool":
    """Return the tool as the table's solver takes it."""
    from calib_core.chain.table_given import KnownTool

    solution = solved.solution
    two_step = solution.by_two_steps.answer.mount_from_laser if solution.by_two_steps.answer else None
    arm = solution.arm if solution.arm is not None and solution.arm.applied else None
    bends = tuple(bend for bend in solution.beside.bends if bend.solved)
    return KnownTool(solution.joint.mount_from_laser, solution.held, two_step, arm, bends)


def about_tool(tool: "TcpSolution", captures: Sequence[Capture]) -> list[Finding]:
    """Return what is to be said of the tool that a table is solved by."""
    from calib_core.stages.tcp.verdict import tcp_findings

    verdict = verdict_of(tcp_findings(tool, captures, with_table=True))
    found = [codes.TCP_FAILED()] if verdict == "fail" else [codes.TCP_DOUBTFUL()] if verdict == "warn" else []
    return [*found, codes.BY_TOOL_ALONE()] if tool.beside.optics else found


def table_of(given: StageInput, sphere: SphereSize, tool: "KnownTool | None", progress: Progress) -> SolvedTable:
    """Return the table captures' solution, which the stages of one run share.

    Without a tool, or where none of its scanners saw the table, those on the flange are sought with it.
    """
    if given.kept.table is None:
        given.kept.table = _solve_table(given, sphere, tool, progress)
    return given.kept.table


def _solve_table(
    given: StageInput, sphere: SphereSize, tool: "KnownTool | None", progress: Progress
) -> SolvedTable:
    from calib_core.chain.arm_open import corrected
    from calib_core.chain.table_angles import with_found_angles
    from calib_core.chain.table_captures import require_captures
    from calib_core.chain.table_start import AnotherPlaceError
    from calib_core.chain.turntable import solve_turntable
    from calib_core.stages.tcp.balls import all_arcs
    from calib_core.stages.turntable.balls import balls_in_turn, balls_of_mountings, named_by_distances

    captures = [capture for capture in given.captures if not capture.excluded]
    cell = given.session.cell
    turning = cell.turntable
    if turning.angles != "unknown" and not names_axes(cell):
        _require_angles(captures)
    observed = observe_stage(replace(given, progress=part_of(progress, 0.0, 0.3)))
    every = observed.observations
    every = corrected(every, tool.arm) if tool is not None and tool.arm is not None else every
    by_id = {capture.id: capture for capture in captures}
    carriers = axis_of_mounts(cell, captures)
    options = table_options(cell)

    def placed(some: Sequence[SphereObservation]) -> list[TableObservation]:
        return [_on_axis(o, by_id[o.capture], carriers) for o in some]

    if not every:
        try:
            require_captures([])
        except MotionError as error:
            raise observed.explaining(error) from None
    ready = _placed_scanners(every, tool, cell)
    sought = None if ready else _sought(placed(every), sphere, cell, alone=tool is None)
    if sought is not None:
        tool, ready = sought
    assert tool is not None
    seen, waiting = [o for o in every if o.scanner in ready], [o for o in every if o.scanner not in ready]
    observed = replace(observed, observations=seen)
    observations, unused, named = placed(seen), observed.unused, None
    try:
        if turning.angles == "unknown":
            observations = with_found_angles(observations, sphere, tool.mounts, turning.direction or 1)
        elif arcs := all_arcs(given, seen, {o.axis for o in observations}):
            named = balls_of_mountings(placed(arcs), sphere, tool, options)
        try:
            observations, unused = _of_balls(named, observations, unused)
            solution = solve_turntable(observations, sphere, tool, options, part_of(progress, 0.3, 1.0))
        except (AnotherPlaceError, MotionError):
            named = None if named else balls_in_turn(cell, observations, sphere, tool, options)
            if named is None:
                raise
            observations, unused = _of_balls(named, observations, unused)
            solution = solve_turntable(observations, sphere, tool, options, part_of(progress, 0.3, 1.0))
        if (named := named_by_distances(cell, observations, solution)) is not None:
            observations, options = named, replace(options, distances=told_distances(cell))
            solution = solve_turntable(observations, sphere, tool, options)
    except MotionError as error:
        raise observed.explaining(error) from None
    late, told = _late(placed(waiting), sphere, solution)
    if late and tool.state is None:  # no whole chain will take them in
        observations = [*observations, *(o for one in late for o in one.observations)]
        own = {"": tool.mount_from_laser} | {one.observations[0].sphere.scanner: one.mount for one in late}
        tool = replace(tool, late={observations[0].sphere.scanner: own.pop(""), **own})
        solution, late = solve_turntable(observations, sphere, tool, options), []
    return SolvedTable(solution, observations, [*unused, *told], late, tool.sought)


def _placed_scanners(seen: Sequence[SphereObservation], tool: "KnownTool | None", cell: Cell) -> set[str]:
    """Return which scanners that took captures on axes those of step tcp, or the cell, place."""
    if tool is None:
        placed: set[str] = set()
    elif tool.held:
        placed = {name for name, _ in tool.held.state.walk.layout.mounts}
    else:  # the one that is brought, or that base is of
        some = scanner_names(cell) if known_scanner(cell) is not None else tuple(o.scanner for o in seen)
        placed = {"", *some[:1]}
    return placed & {o.scanner for o in seen}


def _sought(
    seen: Sequence[TableObservation], sphere: SphereSize, cell: Cell, *, alone: bool
) -> "tuple[KnownTool, set[str]]":
    """Return scanners on the flange as the balls on axes alone tell of them, and their names.

    `alone`: none has captures of step tcp.

    Raises
    ------
    InputError
        If none is on the flange, or these captures do not tell it.
    """
    from calib_core.chain.riding import by_riding
    from calib_core.chain.table_given import KnownTool

    if alone:
        error = no_scanner("the scanner's pose on the flange before the turntable's")
    else:
        error = InputError(
            "captures with step 'tcp' by a scanner that sees the sphere on an axis",
            "none by '{scanner}'",
            "Capture the sphere on the axis with it while the axis rests; for a scanner that stands still put a "
            "sphere on the flange. Or exclude what it saw.",
            seen[0].sphere.capture,
            scanner=seen[0].sphere.scanner,
        )
    some = [o for o in seen if o.sphere.carriers.scanner_moves]
    if not some or cell.turntable.angles == "unknown":
        raise error
    try:
        found = by_riding(some, sphere, table_options(cell))
    except MotionError as why:
        told = message("Captures on axes alone tell it where the flange is turned, too. {lack}", lack=why.lack)
        raise error.adding(told) from None
    names = {name for name, _ in found.held.state.walk.layout.mounts}
    return KnownTool(found.joint.mount_from_laser, sought=found), names


def by_axes(table: "TurntableSolution") -> "list[LateScanner]":
    """Return the scanners of a table's own captures, as those that it places for the whole chain."""
    from calib_core.chain.late_scanner import LateScanner

    at, nothing = table.state.position, np.zeros((0, 3))
    each = zip(at.mount_rotations, at.mount_translations, strict=True)
    return [LateScanner(*mount, [], np.zeros(0, dtype=bool), nothing) for mount in each]


def _late(
    waiting: Sequence[TableObservation], sphere: SphereSize, solution: "TurntableSolution"
) -> "tuple[list[LateScanner], list[Finding]]":
    """Return the scanners that the table places, and what is said of those that it does not."""
    from calib_core.chain.late_scanner import LateScanner, late_scanner

    found, told = list[LateScanner](), list[Finding]()
    for name in dict.fromkeys(o.sphere.scanner for o in waiting):
        own = [o for o in waiting if o.sphere.scanner == name]
        one = late_scanner(own, sphere, solution)
        if isinstance(one, LateScanner):
            found.append(one)
        else:
            told.append(placed_scanners.SCANNER_NOT_PLACED([o.sphere.capture for o in own], scanner=name, why=one))
    return found, told


def _of_balls(
    named: list[TableObservation] | None, observations: list[TableObservation], unused: list[Finding]
) -> tuple[list[TableObservation], list[Finding]]:
    """Return the captures of balls that were told apart, and those of no use; as they are where none were."""
    from calib_core.stages.tcp.balls import of_no_ball

    if named is None:
        return observations, unused
    kept = [o for o in named if o.sphere.ball]
    return kept, [*unused, *of_no_ball([o.sphere.capture for o in observations], [o.sphere for o in kept])]


def _on_axis(seen: SphereObservation, capture: Capture, carriers: Mapping[str, str]) -> TableObservation:
    """Return a capture of the sphere on the axis that carries its mounting, or on the turntable."""
    mount = capture.mount or ""
    if mount in carriers:
        return TableObservation(seen, seen.readings.get(carriers[mount], 0.0), mount, carriers[mount])
    return TableObservation(seen, float(np.deg2rad(capture.table_deg or 0.0)), mount)


def _require_angles(captures: Sequence[Capture]) -> None:
    missing = [capture.id for capture in captures if capture.table_deg is None]
    if missing:
        raise InputError(
            "the table's angle in each turntable capture (table_deg, degrees)",
            "none in {missing}",
            "Read it from the table's controller and add it; exclude captures whose angle is lost, or set "
            "cell.turntable.angles to 'unknown' where all are.",
            f"captures[{missing[0]}].table_deg",
            missing=Names(missing),
        )


def table_options(cell: Cell) -> "TurntableOptions":
    """Return what the cell says of the table, as its solver takes it."""
    from calib_core.chain.table_angles import UNKNOWN_ANGLE_SIGMA_RAD
    from calib_core.chain.table_given import TurntableOptions

    unknown = cell.turntable.angles == "unknown"
    encoder = "exact" if unknown else cell.turntable.encoder
    return TurntableOptions(
        position_sigma_mm=cell.robot.position_sigma_mm,
        orientation_sigma_rad=cell.robot.orientation_sigma_rad,
        point_sigma_mm=cell.scanner.point_sigma_mm,
        angle_sigma_rad=UNKNOWN_ANGLE_SIGMA_RAD if unknown else _radians(cell.turntable.angle_sigma_deg),
        direction=cell.turntable.direction,
        encoder_scale=None if encoder is None else encoder == "scale",
        angles_unknown=unknown,
        axes=moved_axes(cell),
        axis_sigmas=reading_sigmas(cell),
        axis_scales=scales_asked(cell),
    )


def _radians(degrees: float | None) -> float | None:
    return None if degrees is None else float(np.deg2rad(degrees))


def part_of(progress: Progress, low: float, high: float) -> Progress:
    """Return a progress that counts from 0 to 1 while the whole goes from `low` to `high`."""
    return lambda fraction, message: progress(low + (high - low) * fraction, message)
