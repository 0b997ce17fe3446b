"""Camera and plane of light as they were solved, remembered by what they were solved from.

So fourteen frames of a sphere calibrate once.
"""

import threading
from collections.abc import Callable
from typing import TypeVar

from calib_core.records import Session, StageName
from calib_core.stages.camera.record import CameraResult
from calib_core.stages.given import StageInput
from calib_core.stages.graph import inputs_sha256, stage_captures
from calib_core.stages.laser_plane.record import LaserPlaneResult
from calib_core.stages.stage import ReadFile

_Solved = TypeVar("_Solved", bound=CameraResult | LaserPlaneResult)

_REMEMBERED = 8

_lock = threading.Lock()

_solved: dict[tuple[StageName, str], CameraResult | LaserPlaneResult] = {}


def solve_once(
    session: Session, read: ReadFile, stage: StageName, kind: type[_Solved], solve: Callable[..., _Solved]
) -> _Solved:
    """Return a stage's result, from memory where cell, captures and files are the same."""
    inputs = inputs_sha256(session, stage, read)
    with _lock:
        found = _solved.get((stage, inputs))
    if isinstance(found, kind):
        return found
    return solve(StageInput(session, stage_captures(session, stage), read, inputs, lambda _fraction, _what: None))


def remembered(stage: StageName, inputs_sha256: str, result: _Solved) -> _Solved:
    """Return a stage's result, kept in memory for the later stages that rest on it."""
    with _lock:
        while len(_solved) >= _REMEMBERED:
            _solved.pop(next(iter(_solved)))
        _solved[stage, inputs_sha256] = result
    return result
