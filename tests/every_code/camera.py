"""Rows of the camera: a calibrated one with a figure at either side of its limit."""

from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from calib_core.captures.boards import frames_not_used
from calib_core.errors import MeasurementError
from calib_core.findings import Finding
from calib_core.optics.board import BoardView
from calib_core.optics.board_refusal import CELL_BOARD, board_words
from calib_core.optics.board_shape import BoardShape
from calib_core.optics.camera_choice import Candidate
from calib_core.optics.camera_evidence import camera_findings, coverage_findings
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.camera_solution import CameraSolution, RobotLengths
from calib_core.records import Board
from calib_core.stages.camera.solve import by_robot_findings, unverifiable, views_not_used
from tests.core.test_camera_coverage import CORNERS, MATRIX, SIZE, calibrated
from tests.every_code.made import Case, sides
from tests.every_code.quality import BOARD, frame

CHESSBOARD = Board.model_validate(BOARD)
CHARUCO = Board.model_validate({**BOARD, "kind": "charuco", "marker_mm": 6.0, "dictionary": "DICT_4X4_50"})


@cache
def right(stretched: float = 1.0) -> CameraSolution:
    """Return a camera of good views, of a board whose pitch along the columns is told so many times too large."""
    return calibrated(CORNERS, 1, stretched)


def bent(bend_gain: float) -> Case:
    """Return what is said of a board whose shape, were it free, would leave so much less."""
    return lambda: camera_findings(replace(right(), bend_gain=bend_gain, bend_mm=0.3))


def shape(solved: BoardShape | None) -> Case:
    """Return what is said of a board whose shape was solved, or not."""
    return lambda: camera_findings(replace(right(), board_shape=solved, bend_mm=0.3))


def views(count: int) -> Case:
    """Return what is said of so many views."""
    return lambda: camera_findings(replace(right(), camera_from_board=right().camera_from_board[:count]))


def tilted(angle_rad: float) -> Case:
    """Return what is said where no board is tilted by more."""
    return lambda: camera_findings(
        replace(right(), coverage=replace(right().coverage, largest_tilt_rad=angle_rad))
    )


def focal(share: float) -> Case:
    """Return what is said of a focal length that is known to such a share."""

    def case() -> list[Finding]:
        covariance = right().covariance.copy()
        covariance[0, 0] = (share * right().camera.camera_matrix[0, 0]) ** 2
        return camera_findings(replace(right(), covariance=covariance))

    return case


def lens(k1: float) -> CameraModel:
    """Return a camera of one term of distortion."""
    return CameraModel.from_names(MATRIX, {"k1": k1}, SIZE)


def by_robot(pitch_factor: float = 1.0, chance: float = 0.5) -> Case:
    """Return what the robot's moves say of the pitch, and of the camera."""
    none = np.zeros(4)
    told = RobotLengths(12, pitch_factor, 1e-4, none, none, chance, np.zeros((4, 4)), 0.05, 1e-4)
    return lambda: by_robot_findings(told, CHESSBOARD)


def cannot_tell(board: Board = CHESSBOARD, *, lengths: bool = False, colour: bool = False) -> Case:
    """Return what frames of a board cannot tell, with the robot's lengths or without."""
    view = BoardView(np.zeros((54, 2)), np.zeros((54, 3)), np.arange(54), SIZE, 0.05, in_colour=colour)
    told: Any = object() if lengths else None
    return lambda: unverifiable(board, {"b01": view}, told)


def not_used(views: int = 15, rejected: int = 0, expected: int = 15, failed: int = 0) -> Case:
    """Return which of so many frames and views are not used."""
    seen: Any = {f"b{k}": None for k in range(views)}
    off: Any = {k: {"off": "place"} for k in range(rejected)}
    errors = {f"f{k}": MeasurementError("a board", "none", "Show it.") for k in range(failed)}
    return lambda: views_not_used(replace(right(), rejected=off), seen, errors, expected)


def other_boards(used: int) -> Case:
    """Return what is said of a frame that shows another board, beside others that are used."""
    need, got = board_words("chessboard", 9, 6), board_words("chessboard", 8, 6)
    failed = {"b01": MeasurementError(need, got, "Correct cell.board.", CELL_BOARD)}
    return lambda: frames_not_used(failed, used)


of_camera = partial(sides, camera_findings, right)
CASES: dict[str, tuple[Case, Case]] = {
    "frame-not-used": (not_used(failed=1), not_used()),
    "board-not-as-told": (other_boards(3), other_boards(4)),
    "view-not-used": (not_used(rejected=1), not_used()),
    "most-frames-not-used": (not_used(7), not_used(8)),
    "camera-not-converged": of_camera("converged", False, True),
    "few-views": (views(9), views(10)),
    "image-not-covered": (lambda: coverage_findings(0.5, 3.1, 0.2), lambda: coverage_findings(0.5, 3.1, 0.1)),
    "image-covered-in-part": (lambda: coverage_findings(0.5, 2.9, 0.2), lambda: coverage_findings(0.61, 2.9, 0.2)),
    "boards-not-tilted": (tilted(0.25), tilted(0.27)),
    "distortion-folds": of_camera("camera", lens(-0.42), lens(-0.36)),
    "focal-length-unsure": (focal(0.0051), focal(0.0049)),
    "board-bent": (bent(0.16), bent(0.14)),
    "board-shape-solved": (shape(BoardShape(np.zeros(7), np.zeros((2, 2)))), shape(None)),
    "board-pitches-differ": (lambda: camera_findings(right(1.006)), lambda: camera_findings(right(1.003))),
    "corners-off-prediction": of_camera("reprojection_rms_px", 1.1, 0.9),
    "corners-far-off": of_camera("reprojection_rms_px", 3.1, 2.9),
    "board-pitch-by-robot": (by_robot(pitch_factor=1.0011), by_robot(pitch_factor=1.0009)),
    "camera-by-robot-differs": (by_robot(chance=0.0009), by_robot(chance=0.0011)),
    "camera-model-chosen": of_camera("candidates", (Candidate("plain", 7, 0.05, ()),), ()),
    "distortion-terms-at-zero": of_camera("parameters", ("fx", "fy", "k1", "k2"), ("fx", "fy", "k1", "k2", "k3")),
    "tilt-and-centre-correlated": of_camera("tilt_correlation", 0.91, 0.89),
    "corners-left-out": of_camera("rejected_corners", 1, 0),
    "board-pitch-not-checked": (cannot_tell(), cannot_tell(lengths=True)),
    "board-looks-the-same-turned": (frame(rows=7), frame(rows=6)),
    "frames-in-colour": (cannot_tell(colour=True), cannot_tell()),
    "board-mirroring-not-seen": (cannot_tell(), cannot_tell(CHARUCO)),
}
