"""Camera and plane of light as they were solved, remembered by what they were solved from.

So fourteen frames of a sphere calibrate once.
"""

import threading
from typing import TypeVar

import numpy as np

from calib_core.errors import InputError
from calib_core.graph.keys import inputs_sha256, stage_captures
from calib_core.graph.registry import STAGES
from calib_core.graph.stage_input import StageInput
from calib_core.optics.camera_model import CameraModel, Segment, name_distortion
from calib_core.records import CameraSegment, ReadFile, Session, StageName
from calib_core.records.camera_result import CameraResult
from calib_core.records.laser_plane_result import LaserPlaneResult, RefinedCamera

_Solved = TypeVar("_Solved", bound=CameraResult | LaserPlaneResult)

_REMEMBERED = 8

_lock = threading.Lock()

_solved: dict[tuple[StageName, str], CameraResult | LaserPlaneResult] = {}


def solve_once(session: Session, read: ReadFile, kind: type[_Solved]) -> _Solved:
    """Return the result of the stage with this record, from memory where cell, captures and files are the same."""
    stage = kind.model_fields["stage"].default
    inputs = inputs_sha256(session, stage, read)
    with _lock:
        found = _solved.get((stage, inputs))
    if isinstance(found, kind):
        return found
    given = StageInput(session, stage_captures(session, stage), read, inputs, lambda _fraction, _what: None)
    solved = STAGES.get(stage).solve(given)
    assert isinstance(solved, kind)
    return solved


def remembered(stage: StageName, inputs_sha256: str, result: _Solved) -> _Solved:
    """Return a stage's result, kept in memory for the later stages that rest on it."""
    with _lock:
        while len(_solved) >= _REMEMBERED:
            _solved.pop(next(iter(_solved)))
        _solved[stage, inputs_sha256] = result
    return result


def camera_from_result(result: CameraResult | RefinedCamera) -> CameraModel:
    """Return the camera that a result holds."""
    plain = CameraModel.from_names(result.camera_matrix, result.distortion, result.image_size)
    segments = tuple(
        Segment(s.near_mm, s.far_mm, CameraModel.from_names(np.eye(3), s.distortion).distortion)
        for s in result.segments
    )
    return CameraModel(plain.camera_matrix, plain.distortion, result.model, result.image_size, segments)


def camera_segments(camera: CameraModel) -> list[CameraSegment]:
    """Return the bands of a segmental camera as a result holds them."""
    return [
        CameraSegment(near_mm=s.near_mm, far_mm=s.far_mm, distortion=name_distortion(s.distortion))
        for s in camera.segments
    ]


def camera_of(session: Session, read: ReadFile) -> tuple[CameraModel, CameraResult | None]:
    """Return the session's camera, and the result it comes from if it was solved; raises as `calibration_of`."""
    known = session.cell.known.camera
    if known is not None:
        return CameraModel.from_known(known), None
    require_captures_of(session, "camera", "the camera", "cell.known.camera")
    result = solve_once(session, read, CameraResult)
    return camera_from_result(result), result


def require_captures_of(session: Session, stage: StageName, what: str, known: str) -> None:
    """Raise InputError where a session has no captures that a stage takes, of which frames need the result."""
    if not any(not capture.excluded for capture in stage_captures(session, stage)):
        got = "neither {known} nor captures with step '{stage}'"
        to_do = "Capture the board for '{stage}', or bring {known}."
        need = "{what} to turn frames into points"
        raise InputError(need, got, to_do, "session.json", what=what, known=known, stage=stage)
