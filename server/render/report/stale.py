"""Which results are older than the captures they were computed from."""

from collections.abc import Mapping
from typing import Any

from calib_core.errors import CalibrationError
from calib_core.records import Session
from calib_core.stages.graph import inputs_sha256
from calib_core.stages.stage import ReadFile


def stale_stages(session: Session, read: ReadFile, results: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the stages whose inputs have changed since, or can no longer be read."""
    return [stage for stage, result in results.items() if _is_stale(session, read, stage, result)]


def _is_stale(session: Session, read: ReadFile, stage: str, result: Mapping[str, Any]) -> bool:
    try:
        return result.get("inputs_sha256") != inputs_sha256(session, stage, read)
    except CalibrationError:
        return True
