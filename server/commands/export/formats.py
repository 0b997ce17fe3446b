"""`scancell export` of tool and table."""

import argparse
import sys
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from calib_core.archive.archive import is_archive, opened
from calib_core.archive.dates import solved_when
from calib_core.archive.folder import load_results, load_session, past_of
from calib_core.archive.stored_clouds import media_types
from calib_core.cell.found import answering, known_scanner, own_base
from calib_core.errors import InputError
from calib_core.exports.answer import answer_of
from calib_core.exports.backups import write_into
from calib_core.exports.export import write_export
from calib_core.exports.registry import export_named
from calib_core.graph.keys import Graph
from calib_core.library.machines import files_of
from calib_core.messages import message
from calib_core.moment import now
from calib_core.proof import WORDS, is_experimental
from calib_core.records import Record, Session
from calib_core.records.faults import NotUsableError, allowed_faults
from calib_core.review.decided_before import decided_before_in
from calib_core.review.provenance import replayed
from calib_core.stages.pipeline import run as run_stages
from calib_core.stages.pipeline import stages_to_solve
from calib_core.steps import tool_stages
from server.console.command import NOT_ACCEPTED, OK
from server.console.output import remark, write_out
from server.console.progress import progress_bar


def export(options: argparse.Namespace) -> int:
    """Write tool and table, or the merged cloud, in a format; what is not stored is solved first."""
    if options.format in media_types():
        from server.commands.export.clouds import export_cloud

        return export_cloud(options)
    proof = export_named(options.format, tuple(media_types())).proof
    allow = allowed_faults(options.allow, "--allow")
    backup = None if options.into is None else files_of(options.into)
    with opened(options.session) as folder:
        session, read = load_session(folder)
        stored = load_results(folder)
        stale, earlier = Graph.stale_of(session, read, stored), decided_before_in(past_of(folder), session, stored)
        if "not-replayed" not in allow:
            with progress_bar(options) as progress:
                stored = replayed(session, read, stored, progress)
        results: dict[str, Record | Mapping[str, Any]] = {**stored}
        if answering(stored) is None:
            with progress_bar(options) as progress:
                results |= run_stages(session, read, _answering_stage(session), progress)
            date = now()
        else:
            date = solved_when(folder, stored, unpacked=is_archive(options.session))
    if is_experimental(proof):
        remark(options, message("{format} is {proof}", format=options.format, proof=WORDS["manual only"]))
    for before in earlier:
        remark(options, str(before.said()))
    try:
        answer = replace(answer_of(session, results, stale, date), of_moment=options.of_moment)
        if backup is None:
            content, _ = write_export(answer, options.format, allow, _settings(options))
        else:
            file, content = write_into(backup, answer, options.format, allow, _settings(options))
            if len(backup) > 1:
                print(f"scancell: {file} changed", file=sys.stderr)
    except NotUsableError as error:
        print(f"scancell: error: {' '.join(str(error).split())}", file=sys.stderr)
        return NOT_ACCEPTED
    write_out(options, options.out, [content])
    return OK


def _answering_stage(session: Session) -> str:
    """Return the stage whose result is the answer: the whole chain where there are captures for it."""
    known = session.cell.known
    if own_base(session.cell, session.captures) is not None:
        return "turntable"
    if known_scanner(session.cell) or known.base_from_turntable:
        return "tcp"
    solvable = stages_to_solve(session)
    by_board = "hand-eye" if "hand-eye" in solvable else "tcp"
    return next((name for name in tool_stages() if name in solvable), by_board)


def _settings(options: argparse.Namespace) -> dict[str, str]:
    """Return the export's settings that the options name."""
    told = {name: getattr(options, name) for name in ("tool", "frame", "part", "poses")}
    settings = {name: value for name, value in told.items() if value is not None}
    for pair in options.set:
        name, equals, value = pair.partition("=")
        if not equals:
            raise InputError("NAME=VALUE", f"'{pair}'", "Say it as NAME=VALUE.", "--set")
        settings[name] = value
    return settings
