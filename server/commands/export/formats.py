"""`scancell export` of tool and table."""

import argparse
from collections.abc import Mapping
from typing import Any

from calib_core.archive.archive import opened
from calib_core.archive.folder import load_results, load_session
from calib_core.archive.stored_clouds import media_types
from calib_core.exports.export import export as export_results
from calib_core.exports.registry import export_named
from calib_core.records import Record, Session
from calib_core.stages.graph import inputs_sha256
from calib_core.stages.pipeline import run as run_stages
from calib_core.stages.stage import ReadFile
from server.console.command import OK
from server.console.output import write_out
from server.console.progress import progress_bar


def export(options: argparse.Namespace) -> int:
    """Write tool and table, or the merged cloud, in a format; what is not stored or stale is solved first."""
    if options.format in media_types():
        from server.commands.export.clouds import export_cloud

        return export_cloud(options)
    with opened(options.session) as folder:
        session, read = load_session(folder)
        results: dict[str, Record | Mapping[str, Any]] = {**load_results(folder)}
        export_named(options.format, tuple(media_types()))
        if _is_stale(session, read, results.get("tcp")):
            with progress_bar(options) as progress:
                results |= run_stages(session, read, "tcp", progress)
    content, _ = export_results(session, results, options.format)
    write_out(options, options.out, [content])
    return OK


def _is_stale(session: Session, read: ReadFile, stored: Any) -> bool:
    """Return whether there is no result of the session's captures as they are now."""
    return not isinstance(stored, dict) or stored.get("inputs_sha256") != inputs_sha256(session, "tcp", read)
