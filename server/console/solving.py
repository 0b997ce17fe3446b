"""Solving for a command that needs results where none are stored."""

import argparse
from typing import Any

from calib_core.archive.folder import result_data
from calib_core.errors import CalibrationError
from calib_core.messages import message
from calib_core.records import ReadFile, Session
from calib_core.stages.pipeline import run as run_stages
from server.console.output import remark
from server.console.progress import progress_bar


def solved_if_possible(options: argparse.Namespace, session: Session, read: ReadFile) -> dict[str, dict[str, Any]]:
    """Return a session's results as JSON data, stored nowhere; where it cannot be solved yet, say so and go on."""
    try:
        with progress_bar(options) as progress:
            results = run_stages(session, read, "all", progress)
    except CalibrationError as error:
        remark(options, message("Warning: nothing is solved: {error}", error=error))
        return {}
    return {stage: result_data(result) for stage, result in results.items()}
