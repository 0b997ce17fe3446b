"""`scancell next`: what to do now, the pose that helps most, or a planned set of poses."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from server.console.command import OK, Command, session_argument
from server.console.output import print_result, remark, where_axes, write_out

if TYPE_CHECKING:
    from calib_core.guidance.pose_list import PoseList
    from calib_core.records import GuideNow, Session


def _arguments(parser: argparse.ArgumentParser) -> None:
    session_argument(parser)
    parser.add_argument("--count", type=int, metavar="N", help="a planned set of so many poses for the sphere")
    parser.add_argument(
        "--step",
        default="tcp",
        metavar="STEP",
        help="whose captures the set is for: tcp, turntable, or verify, which keep away from the calibration's",
    )

    parser.add_argument(
        "--program", metavar="BRAND", help="the set as a robot's program: slow, approached from outside"
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("-"),
        metavar="FILE",
        help="where the program is written (standard output)",
    )


def _run(options: argparse.Namespace) -> int:
    from calib_core.archive.archive import opened
    from calib_core.archive.folder import load_session
    from calib_core.archive.stored_results import stored_results
    from calib_core.captures.content import shows_board
    from calib_core.captures.measure import measure_capture
    from calib_core.captures.raw_frames import of_frames
    from calib_core.captures.stripe_frames import with_solved_calibration
    from calib_core.errors import InputError
    from calib_core.graph.keys import Graph
    from calib_core.guidance.pose_list import planned_poses
    from calib_core.stages.guide import guide
    from calib_core.steps import planned_steps

    if options.program is not None and options.count is None:
        raise InputError("--count beside --program", "none", "Say how many poses.", "--program")
    if options.count is not None and not 1 <= options.count <= 30:
        raise InputError("1 to 30 poses", str(options.count), "Ask for so many.", "--count")
    with opened(options.session) as folder:
        session, read = load_session(folder)
        results = stored_results(folder)
        stale = Graph.of_files(session, read).stale(results)
        seen = with_solved_calibration(session, results)  # raw frames of the ball as camera and plane show them
        known = seen.cell.known.camera is not None and seen.cell.known.laser_plane is not None
        shown = [
            c for c in session.captures if (known or not of_frames(c)) and not c.excluded and not shows_board(c)
        ]
        measured = [measure_capture(seen, capture, read) for capture in shown]
    if options.step not in planned_steps():
        raise InputError.unknown(options.step, planned_steps(), "--step")
    if options.count is None:
        now = guide(session, measured, results, stale).current
        print_result(options, _text(now), now.to_json())
    else:
        told = {stage: {**dict(result), "stale": stage in stale} for stage, result in results.items()}
        plan = planned_poses(session, measured, told, options.count, options.step)
        if options.program is not None:
            return _program(options, session, plan)
        print_result(options, _listed(plan), plan.to_json())
    return OK


def _program(options: argparse.Namespace, session: "Session", plan: "PoseList") -> int:
    """Write the planned set as a robot's program."""
    from calib_core.exports.planned_program import planned_program
    from calib_core.messages import message
    from calib_core.proof import WORDS, is_experimental

    program = planned_program(session, plan, options.program)
    if is_experimental(program.proof):
        remark(options, message("{format} is {proof}", format=program.name, proof=WORDS["manual only"]))
    write_out(options, options.out, [program.content])
    print(plan.note, file=sys.stderr)
    return OK


def _text(now: "GuideNow") -> str:
    from calib_core.messages import message

    lines = [now.instruction, f"  {now.why}"]
    if now.progress:
        lines.append(f"  {now.progress}")
    if now.suggested_pose_numbers:
        numbers = " ".join(f"{value:.4f}" for value in now.suggested_pose_numbers)
        lines.append("  " + message("pose: {numbers}", numbers=numbers))
    if now.suggested_note:
        lines.append(f"  {now.suggested_note}")
    return "\n".join(lines)


def _listed(plan: "PoseList") -> str:
    from calib_core.messages import message

    head = message(
        "Poses of the flange in base ({convention}), then the ± after each:", convention=plan.pose_convention
    )
    lines = [plan.note, f"  {head}"]
    for number, pose in enumerate(plan.poses, start=1):
        known = f"± {pose.uncertainty_mm or 0.0:.3f} mm"
        after = message("not determined yet") if pose.uncertainty_mm is None else known
        table = "" if pose.table_deg is None else message("table {table_deg:.0f}°", table_deg=pose.table_deg)
        higher = pose.higher_mm and message(
            "first fix the sphere {higher_mm:+.0f} mm higher ({mount})", higher_mm=pose.higher_mm, mount=pose.mount
        )
        mount = f"({pose.mount})" if pose.mount and not pose.higher_mm else ""
        numbers = " ".join(f"{value:10.4f}" for value in pose.numbers)
        said = [part for part in (after, table, where_axes(pose).strip(), higher, mount) if part]
        lines.append("  " + message("{place}  {told:,}", place=f"{number:>2}  {numbers}", told=said))
    return "\n".join(lines)


COMMAND = Command("next", "what to do now, and the pose that helps most", "session", _arguments, _run)
