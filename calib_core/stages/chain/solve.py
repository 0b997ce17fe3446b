"""The whole chain: tool and turntable from all captures of both together."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from calib_core.captures.content import sphere_of
from calib_core.captures.lost_rays import lost_rays_of
from calib_core.cell.found import own_base
from calib_core.errors import InputError
from calib_core.findings import Finding, judged
from calib_core.graph.stage import SOFTWARE
from calib_core.graph.stage_input import Kept, SolvedTable, SolvedTcp, StageInput
from calib_core.records.results import ArmModelFound, FoundFrame
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.tcp.solve import of_several_balls, with_all_rows
from calib_core.stages.turntable.solve import (
    by_axes,
    findings_of_table,
    part_of,
    table_of,
    table_options,
    tcp_of,
    tool_of,
)

if TYPE_CHECKING:
    from calib_core.chain.whole import ChainSolution

_TABLE_SHARE = 0.7


def solve(given: StageInput) -> ChainResult:
    """Return tool and turntable from all captures of both; raises as the two stages do."""
    from calib_core.chain.whole import solve_chain
    from calib_core.stages.chain.result import chain_result
    from calib_core.stages.tcp.balls import spheres_found
    from calib_core.stages.turntable.play import play_findings
    from calib_core.stages.turntable.result import balls_on_axes, frames_of_axes
    from calib_core.stages.undetermined_places import without_open_places

    turning = [capture for capture in given.captures if capture.step == "turntable"]
    if not turning:
        raise InputError(
            "captures with step 'turntable'",
            "none",
            "Capture the sphere on the table, too; or solve the stage 'tcp' alone.",
            "captures",
        )
    if own_base(given.session.cell, given.session.captures) is not None:
        raise InputError(
            "captures by which a scanner sees both the robot's sphere and the table's",
            "none: the scanner before the table has no captures with step 'tcp'",
            "Capture a sphere on the flange with it; or solve the stages 'tcp' and 'turntable' alone.",
            "captures",
        )
    solved = tcp_of(given)
    tool, sphere = (tool_of(solved), solved.sphere) if solved else (None, sphere_of(given.session.cell, turning))
    table = table_of(replace(given, captures=turning), sphere, tool, part_of(given.progress, 0.4, _TABLE_SHARE))
    late = [*by_axes(table.solution), *table.late] if solved and table.sought else [*table.late]
    if solved is None:  # no ball stood still: those on axes told of scanners
        assert table.sought is not None
        solved = SolvedTcp(table.sought, [], sphere, [])
    solution = solve_chain(
        solved.observations,
        table.observations,
        solved.sphere,
        solved.solution,
        table.solution,
        replace(table_options(given.session.cell), distances=table.solution.options.distances),
        part_of(given.progress, _TABLE_SHARE, 1.0),
        late,
    )
    table = replace(table, observations=[*table.observations, *(o for one in late for o in one.observations)])
    if any(capture.kind in ("frame", "sweep") for capture in given.captures):
        from calib_core.captures.frame_uncertainty import chain_with_calibration_uncertainty

        solution = chain_with_calibration_uncertainty(given.session, given.read, solution)
    found = _findings(given, solved, table, solution)
    result = chain_result(solution, table.observations, SOFTWARE, given.inputs_sha256, found)
    if result.arm_model is not None and result.arm_model.applied:
        result = result.model_copy(update={"arm_model": _with_controller(given, result.arm_model)})
    on_axes = balls_on_axes(table.observations, solution.turntable)
    told = {
        "spheres": spheres_found(given.session.cell, solution.tcp) + on_axes,
        "frames": [*result.frames, *frames_of_axes(solution.turntable)],
    }
    result = result.model_copy(update=told)
    if given.session.cell.turntable.angles != "unknown":
        result = judged(result, play_findings(result))
    result = without_open_places(result, solved.solution.left_open.shifts)
    return with_all_rows(result, given.captures, [*solved.unused, *table.unused])


def _with_controller(given: StageInput, found: ArmModelFound) -> ArmModelFound:
    """Return the arm's errors with the frames that are best with the controller's own poses."""
    session = given.session
    robot = session.cell.robot.model_copy(update={"errors": None})
    cell = session.cell.model_copy(update={"robot": robot})
    told = solve(replace(given, session=session.model_copy(update={"cell": cell}), kept=Kept()))
    tool = told.mount_from_laser
    frames = [
        FoundFrame(into=tool.into, outof="laser", matrix=tool.to_rows(), covariance=told.covariance),
        FoundFrame(
            into="base", outof="turntable", matrix=told.base_from_turntable, covariance=told.turntable_covariance
        ),
    ]
    return found.model_copy(update={"controller": frames})


def _findings(
    given: StageInput, solved: SolvedTcp, table: SolvedTable, solution: "ChainSolution"
) -> list[Finding]:
    """Return all that is noticed: of tool, table and captures, and where both kinds of these disagree."""
    from calib_core.stages.chain.result import disagreements
    from calib_core.stages.tcp.arm_found import arm_findings
    from calib_core.stages.tcp.result import solution_findings
    from calib_core.stages.tcp.verdict import lag_findings

    used = [c for c in given.captures if not c.excluded and c.id not in solved.left_out]
    both = [*solved.observations, *(one.sphere for one in table.observations)]
    return [
        *disagreements(solution),
        *_of_table(given, solved, table, solution),
        *of_several_balls(given, solved, solution_findings(solution.tcp, given.captures, with_table=True)),
        *arm_findings(given.session.cell, solution.tcp.arm, used),
        *lag_findings(solved.observations, solution.tcp.noise.sigmas),
        *lost_rays_of(both),
        *solved.unused,
        *table.unused,
    ]


def _of_table(
    given: StageInput, solved: SolvedTcp, table: SolvedTable, solution: "ChainSolution"
) -> list[Finding]:
    """Return what is noticed of the table in the chain.

    The chain can bend tool and poses until wrong angles lie within its limit: what the still sphere's tool, which
    owes the table nothing, says of the angles stays said.
    """
    from calib_core.stages.turntable.verdict import angles_that_do_not_fit

    found = findings_of_table(given, replace(table, solution=solution.turntable), solved.sphere)
    known = solved.solution.in_view.at_workpiece
    sigma_mm = float(np.sqrt(np.linalg.eigvalsh(known)[-1])) if np.isfinite(known).all() else np.inf
    alone = angles_that_do_not_fit(table.solution, sigma_mm)
    told = {finding.code for finding in found}
    return [*(finding for finding in alone if finding.code not in told), *found]
