"""`scancell recheck`: whether the last calibration still holds, by three of its poses captured again."""

import argparse
from typing import TYPE_CHECKING

from server.console.command import NOT_ACCEPTED, OK, Command, session_argument
from server.console.output import print_result, where_axes

if TYPE_CHECKING:
    from calib_core.stages.recheck.guide import RecheckPlan


def _run(options: argparse.Namespace) -> int:
    """Print the poses to repeat, or what their captures say; return 1 where the calibration no longer holds."""
    from calib_core.archive.archive import opened
    from calib_core.archive.folder import load_session
    from calib_core.archive.stored_results import stored_results
    from calib_core.graph.keys import Graph
    from calib_core.graph.stage_input import Kept
    from calib_core.stages.evidence import text_of
    from calib_core.stages.pipeline import solve_stage
    from calib_core.stages.recheck.guide import recheck_plan
    from calib_core.stages.recheck.solve import require_still_sphere
    from calib_core.steps import tool_stages
    from server.console.language import result_as_read, spoken

    with opened(options.session) as folder:
        session, read = load_session(folder)
        stored = stored_results(folder)
        kept = Kept.of_stored(Graph.of_files(session, read), stored, "recheck")
        if not any(c.step == "recheck" and not c.excluded for c in session.captures):
            answers = {name: kept.results[name].to_json() for name in tool_stages() if name in kept.results}
            require_still_sphere(session)
            if not answers:
                answers = {"tcp": solve_stage(session, "tcp", read, kept=kept).to_json()}
            plan = recheck_plan(session, answers)
            print_result(options, _text(plan), plan.to_json())
            return OK
        result = solve_stage(session, "recheck", read, kept=kept)
    said = spoken(options)
    print_result(options, text_of(result_as_read(result, said, session.cell.findings), said), result.to_json())
    return NOT_ACCEPTED if result.verdict == "fail" else OK


def _text(plan: "RecheckPlan") -> str:
    from calib_core.messages import message

    lines = [
        message("Leave the sphere in its place, drive to these poses and capture it with step 'recheck':"),
        *(
            f"  {p.capture:>8}  " + " ".join(f"{value:10.4f}" for value in p.pose) + where_axes(p)
            for p in plan.poses
        ),
        message(
            "These are poses of the flange in base ({convention}). Then run this command again.",
            convention=plan.pose_convention,
        ),
    ]
    return "\n".join(lines)


COMMAND = Command("recheck", "say whether the calibration still holds", "session", session_argument, _run)
