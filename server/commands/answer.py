"""`scancell answer`: the calibrated frames with uncertainty, verdict and date, for programs that act on them."""

import argparse
from typing import TYPE_CHECKING

from server.console.command import NOT_ACCEPTED, OK, Command, session_argument
from server.console.output import print_result

if TYPE_CHECKING:
    from calib_core.review.answer import AnsweredFrame, SessionAnswer


def _run(options: argparse.Namespace) -> int:
    """Print the answer; return 1 where it is stale or failed."""
    from datetime import UTC, datetime

    from calib_core.archive.archive import opened
    from calib_core.archive.folder import load_session
    from calib_core.archive.stored_results import stored_results
    from calib_core.errors import ConflictError
    from calib_core.review.answer import answer_of_folder

    with opened(options.session) as folder:
        session, read = load_session(folder)
        results = stored_results(folder)
        files = [folder / "results" / f"{stage}.json" for stage in results]
        newest_s = max((file.stat().st_mtime for file in files), default=0.0)
        answer = answer_of_folder(session, results, read, datetime.fromtimestamp(newest_s, UTC).isoformat())
    if answer is None:
        raise ConflictError("a solved session", "no answer yet", "Run `scancell run` on it.", str(options.session))
    print_result(options, _text(answer), answer.to_json())
    return NOT_ACCEPTED if answer.faults else OK


def _text(answer: "SessionAnswer") -> str:
    state = ", ".join([answer.verdict, *(["stale: its inputs have changed since"] if answer.stale else [])])
    lines = [
        f"{answer.cell}: {answer.stage}, {state}",
        *_frame("tool0_from_laser", answer, answer.tool0_from_laser),
    ]
    if answer.base_from_turntable is not None:
        lines += _frame("base_from_turntable", answer, answer.base_from_turntable)
    lines += [f"  {warning}" for warning in answer.warnings]
    return "\n".join(lines)


def _frame(name: str, answer: "SessionAnswer", frame: "AnsweredFrame") -> list[str]:
    """Return a frame's numbers with their standard deviations, as the cell's controller writes them."""
    numbers = zip(answer.names, frame.numbers, frame.number_sigmas, strict=True)
    return [f"  {name} ({answer.pose_convention}, {answer.units})"] + [
        f"    {number:>4} {value:12.4f} ± {sigma:.4f}" for number, value, sigma in numbers
    ]


COMMAND = Command(
    "answer", "print the calibrated frames with uncertainty, verdict and date", "session", session_argument, _run
)
