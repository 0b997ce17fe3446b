"""`scancell export` of the merged cloud and its mesh."""

import argparse
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from calib_core.archive.archive import opened
from calib_core.archive.folder import load_results, load_session
from calib_core.archive.stored_clouds import CLOUD_FILE, MESH_FILE, StoredFile, cloud_formats, in_format
from calib_core.disk import temporary_folder
from calib_core.errors import InputError
from calib_core.formats.shared.writing import write_pieces
from calib_core.graph.keys import Graph
from calib_core.messages import message
from calib_core.records import Result, Session
from calib_core.records.callbacks import ReadFile
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.pipeline import solve_stage
from server.console.command import OK
from server.console.output import STANDARD_OUTPUT, write_out
from server.console.progress import progress_bar


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
