"""`scancell answer`: the calibrated frames with uncertainty, verdict and date, for programs that act on them."""

import argparse
from typing import TYPE_CHECKING

from server.console.command import NOT_ACCEPTED, OK, Command, session_argument
from server.console.output import print_result

if TYPE_CHECKING:
    from calib_core.messages import Catalogue
    from calib_core.records.evidence import AnyBlock
    from calib_core.review.answer import AnsweredFrame, SessionAnswer


def _run(options: argparse.Namespace) -> int:
    """Print the answer; return 1 where it is stale or failed."""
    from calib_core.archive.archive import is_archive, opened
    from calib_core.archive.dates import solved_when
    from calib_core.archive.folder import load_session, past_of
    from calib_core.archive.stored_results import stored_results
    from calib_core.errors import ConflictError
    from calib_core.review.answer import answer_as_read, answer_of_folder
    from calib_core.review.decided_before import decided_before_in
    from calib_core.review.provenance import replayed
    from calib_core.stages.evidence import title_of
    from calib_core.stages.topology_found import table_title
    from server.console.language import spoken
    from server.console.progress import progress_bar

    with opened(options.session) as folder:
        session, read = load_session(folder)
        with progress_bar(options) as progress:
            results = replayed(session, read, stored_results(folder), progress)
        date = solved_when(folder, results, unpacked=is_archive(options.session))
        answer = answer_of_folder(
            session,
            results,
            read,
            date,
            of_moment=options.of_moment,
            decided_before=decided_before_in(past_of(folder), session, results),
        )
    said = spoken(options)
    if answer is None:
        raise ConflictError("a solved session", "no answer yet", "Run `scancell run` on it.", str(options.session))
    answer = answer_as_read(answer, said.language, session.cell.findings)
    table = table_title(dict(results.get(answer.stage if answer.stage == "chain" else "turntable", {})))
    print_result(options, _text(answer, said, table, title_of(answer.stage, session.cell)), answer.to_json())
    return NOT_ACCEPTED if answer.faults else OK


def _text(answer: "SessionAnswer", said: "Catalogue", table: str, title: str) -> str:
    """Return the answer as its result reads: verdict, uncertainty (k = 2), the frames for the controller.

    `table` is what the frame of what carries the object is called, `title` the whole.
    """
    from calib_core.evidence.numbers import plus_minus
    from calib_core.evidence.text import result_text
    from calib_core.findings.judgement import judgement
    from calib_core.findings.telling import block_in
    from calib_core.frames import Frame, RigidTransform
    from calib_core.messages import message
    from calib_core.records.decided_before import DECISIONS
    from calib_core.records.evidence import AnyBlock, Figure, Note
    from calib_core.stages.frame_blocks import frame_block

    seen = answer.laser_from_turntable
    known = (
        ("At the workpiece", answer.workpiece_sigma_mm, "mm"),
        ("Scanner's position" if seen is None else message("Table's position"), answer.position_sigma_mm, "mm"),
        (
            "Scanner's orientation" if seen is None else message("Table's orientation"),
            answer.rotation_sigma_deg,
            "°",
        ),
    )
    believed = answer.verdict != "fail"
    blocks: list[AnyBlock] = [
        Figure(label=label, quantity=plus_minus(sigma, unit), remark="worst direction")
        for label, sigma, unit in known
        if sigma is not None and believed
    ]
    blocks += [
        Figure(label="Cell", text=answer.cell),
        *([Figure(label="Solved", text=f"{answer.solved[:16].replace('T', ' ')} UTC")] if answer.solved else []),
        *([Figure(label="Verification", text=DECISIONS[answer.decision])] if answer.decision else []),
        *(Note(text=str(one.said())) for one in answer.decided_before),
    ]
    several = {one.scanner: one for one in answer.frames if one.outof == "laser" and one.scanner}
    frames: tuple[tuple[AnsweredFrame | None, Frame, Frame, str], ...] = (
        (None if several else answer.tool, "tool0", "laser", "Scanner on the flange"),
        (None if several else answer.base_from_laser, "base", "laser", "Scanner in the robot's base"),
        (answer.base_from_turntable, "base", "turntable", table),
        (seen, "laser", "turntable", "Turntable seen from the scanner"),
    )
    for found, into, outof, named in frames:
        if found is not None:
            frame = RigidTransform.from_rounded(found.matrix, into, outof)
            covariance = found.covariance if believed else None
            blocks.append(frame_block(answer.pose_convention, frame, covariance, title=named))
    blocks += _scanners(answer, believed=believed)
    told = {**answer.to_json(), "warnings": judgement(answer.findings, said)["warnings"]}  # its faults, too
    return result_text(said.say(title), told, [block_in(block, said) for block in blocks], said)


def _scanners(answer: "SessionAnswer", *, believed: bool) -> "list[AnyBlock]":
    """Return each scanner of a cell of several."""
    import numpy as np

    from calib_core.cell.titles import scanner_title
    from calib_core.frames import RigidTransform
    from calib_core.stages.frame_blocks import frame_block

    found: list[AnyBlock] = []
    for one in answer.frames:
        known = bool(np.isfinite(np.array(one.matrix, dtype=float)).all())
        if one.outof == "laser" and one.scanner and known:
            frame = RigidTransform.from_rounded(one.matrix, "tool0" if one.into == "tool0" else "base", "laser")
            covariance = one.covariance if believed else None
            found.append(
                frame_block(
                    answer.pose_convention,
                    frame,
                    covariance,
                    title=scanner_title(one.into, one.outof, one.scanner),
                )
            )
    return found


COMMAND = Command(
    "answer", "print the calibrated frames with uncertainty, verdict and date", "session", session_argument, _run
)
