"""The whole chain: tool and turntable from all captures of both together."""

from dataclasses import replace

from calib_core.captures.lost_rays import with_lost_rays
from calib_core.errors import InputError
from calib_core.graph.stage import SOFTWARE
from calib_core.graph.stage_input import StageInput
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.tcp.solve import with_unused
from calib_core.stages.turntable.solve import part_of, table_of, table_options, tcp_of, tool_of, with_table_causes

_TABLE_SHARE = 0.7


def solve(given: StageInput) -> ChainResult:
    """Return tool and turntable from all captures of both; raises as the two stages do."""
    from calib_core.chain.whole import solve_chain
    from calib_core.stages.chain.result import chain_result
    from calib_core.stages.tcp.verdict import with_repeats
    from calib_core.stages.turntable.play import with_play

    turning = [capture for capture in given.captures if capture.step == "turntable"]
    for step, some in (("tcp", len(turning) < len(given.captures)), ("turntable", bool(turning))):
        if not some:
            raise InputError(
                "captures with step 'tcp' and with step 'turntable'",
                f"none with step '{step}'",
                "Capture the sphere beside the table and on it; or solve the other stage alone.",
                "captures",
            )
    solved = tcp_of(given)
    tool = tool_of(solved)
    table = table_of(
        replace(given, captures=turning), solved.sphere, tool, part_of(given.progress, 0.4, _TABLE_SHARE)
    )
    solution = solve_chain(
        solved.observations,
        table.observations,
        solved.sphere,
        solved.solution,
        table.solution,
        table_options(given.session.cell),
        part_of(given.progress, _TABLE_SHARE, 1.0),
    )
    if any(capture.kind in ("frame", "sweep") for capture in given.captures):
        from calib_core.captures.frame_uncertainty import chain_with_calibration_uncertainty

        solution = chain_with_calibration_uncertainty(given.session, given.read, solution)
    result = chain_result(solution, table.observations, SOFTWARE, given.inputs_sha256)
    result = with_repeats(result, solved.observations, solution.tcp.sigmas)
    if given.session.cell.turntable.angles != "unknown":
        result = with_play(result)
    result = with_lost_rays(result, [*solved.observations, *(one.sphere for one in table.observations)])
    result = with_table_causes(result, given, table, solved.sphere, tool.tool0_from_laser)
    return with_unused(result, given.captures, solved.unused | table.unused)
