"""`scancell export` of tool and table."""

import argparse
import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from calib_core.archive.archive import is_archive, opened
from calib_core.archive.dates import solved_when
from calib_core.archive.folder import load_results, load_session, past_of
from calib_core.archive.stored_clouds import (
    CLOUD_FILE,
    MESH_FILE,
    StoredFile,
    cloud_formats,
    in_format,
    media_types,
)
from calib_core.cell.found import answering, known_scanner, own_base
from calib_core.disk import temporary_folder
from calib_core.errors import InputError
from calib_core.exports.answer import answer_of
from calib_core.exports.backups import write_into
from calib_core.exports.export import write_export
from calib_core.exports.registry import export_named
from calib_core.formats.shared.writing import write_pieces
from calib_core.graph.keys import Graph
from calib_core.library.machines import files_of
from calib_core.messages import message
from calib_core.moment import now
from calib_core.proof import WORDS, is_experimental
from calib_core.records import ReadFile, Record, Result, Session
from calib_core.records.faults import NotUsableError, allowed_faults
from calib_core.review.decided_before import decided_before_in
from calib_core.review.provenance import replayed
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.pipeline import run as run_stages
from calib_core.stages.pipeline import solve_stage, stages_to_solve
from calib_core.steps import tool_stages
from server.console.command import NOT_ACCEPTED, OK
from server.console.output import STANDARD_OUTPUT, remark, write_out
from server.console.progress import progress_bar


def export(options: argparse.Namespace) -> int:
    """Write tool and table, or the merged cloud, in a format; what is not stored is solved first."""
    if options.format in media_types():
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


def export_cloud(options: argparse.Namespace) -> int:
    """Write the merged cloud, or its mesh in a format of meshes; merges first where none is fresh."""
    if options.out == STANDARD_OUTPUT and sys.stdout.isatty():
        raise InputError("a file to write to", "a terminal", "Add --out FILE, or redirect the output.", "--out")
    name = CLOUD_FILE if options.format in cloud_formats() else MESH_FILE
    with opened(options.session) as folder, temporary_folder() as fresh:
        session, read = load_session(folder)
        file, merge = folder / name, load_results(folder).get("merge")
        if not file.is_file() or merge is None or _is_stale(merge, session, read):
            file, merge = fresh / name, _merged_anew(options, session, read, fresh).model_dump()
        if not file.is_file():
            to_do = message("Set cell.merge.mesh to poisson or grid, and look at the merge's warnings.")
            raise InputError("a mesh of the merged cloud", "none", to_do, str(options.session))
        scans = MergeResult.model_validate(merge).scan_places
        with file.open("rb") as content:
            stored = StoredFile(content, str(file))
            write_out(options, options.out, in_format(stored, options.format, str(file), scans))
    return OK


def _is_stale(merge: Mapping[str, Any], session: Session, read: ReadFile) -> bool:
    return not Graph.of_files(session, read).is_fresh("merge", merge.get("inputs_sha256"))


def _merged_anew(options: argparse.Namespace, session: Session, read: ReadFile, folder: Path) -> Result:
    def store(name: str, pieces: Iterable[bytes | memoryview]) -> None:
        write_pieces(folder / name, pieces)

    with progress_bar(options) as progress:
        return solve_stage(session, "merge", read, progress, store)
