"""ChArUco boards: a chessboard whose white squares hold markers, so that a part of it is enough."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError, MeasurementError
from calib_core.frames import FloatArray
from calib_core.optics.adjust import Corners
from calib_core.optics.board_corners import (
    CLEARANCE_PX,
    LARGEST_RADIUS_PX,
    SMALLEST_RADIUS_PX,
    FittedCorners,
    fitted_at,
)
from calib_core.optics.camera_start import homographies
from calib_core.records import Board

_FEWEST_CORNERS = 6


def find_charuco(grey: NDArray[np.uint8], board: Board) -> tuple[FloatArray, NDArray[np.int64], FloatArray]:
    """Return corners (N, 2), px, their ids (N,) and their places on the board (N, 3), mm.

    Raises
    ------
    MeasurementError
        If fewer than six corners are seen, or the image is mirrored.
    InputError
        If the marker's size or the dictionary is not given.
    """
    markers, best = 0, None
    for legacy in (False, True):
        corners, ids, count = _detect(grey, board, legacy)
        markers = max(markers, count)
        if best is None or len(ids) > len(best[1]):
            best = corners, ids
        if len(ids) >= _FEWEST_CORNERS:
            break
    assert best is not None
    points, ids = best
    if len(ids) < _FEWEST_CORNERS:
        raise _why_not(grey, board, len(ids), markers)
    columns = board.columns - 1
    places = np.zeros((len(ids), 3))
    pitch_x_mm, pitch_y_mm = board.pitches_mm
    places[:, 0], places[:, 1] = (ids % columns + 1) * pitch_x_mm, (ids // columns + 1) * pitch_y_mm
    if np.linalg.matrix_rank(places[:, :2] - places[0, :2], tol=0.1 * board.pitch_mm) < 2:
        raise MeasurementError(
            "corners in at least two rows and columns", "corners in one line", "Show more of the board."
        )
    clean = np.ones(len(ids), dtype=bool)
    fitted = _fitted(grey, board, points, places)
    if fitted is not None and fitted.clean.sum() >= _FEWEST_CORNERS:
        points, clean = fitted.points_px, fitted.clean
    return points[clean], ids[clean], places[clean]


def _fitted(grey: NDArray[np.uint8], board: Board, points: FloatArray, places: FloatArray) -> FittedCorners | None:
    """Return the corners fitted to the grey values, between the markers; None where these stand too near."""
    assert board.marker_mm is not None
    onto_image = homographies(Corners.of([points], [places]))[0]

    def seen(shift: FloatArray) -> FloatArray:
        flat = (places + shift)[:, :2]
        homogeneous = np.column_stack([flat, np.ones(len(flat))]) @ onto_image.T
        return homogeneous[:, :2] / homogeneous[:, 2:]

    here = seen(np.zeros(3))
    along_row, along_column = (seen(board.pitch_mm * axis) - here for axis in np.eye(3)[:2])
    nearest = float(min(np.hypot(*along_row.T).min(), np.hypot(*along_column.T).min()))
    to_marker = np.sqrt(0.5) * (1 - board.marker_mm / board.pitch_mm) * nearest
    if to_marker - CLEARANCE_PX < SMALLEST_RADIUS_PX:
        return None
    return fitted_at(grey, points, along_row, along_column, min(LARGEST_RADIUS_PX, to_marker - CLEARANCE_PX))


def _detect(grey: NDArray[np.uint8], board: Board, legacy: bool) -> tuple[FloatArray, NDArray[np.int64], int]:
    import cv2

    if board.marker_mm is None or board.dictionary is None:
        raise InputError(
            "marker_mm and dictionary of a ChArUco board",
            "a board without them",
            "Add both to cell.board, as printed on the board (dictionary: for example DICT_5X5_100).",
            "cell.board",
        )
    pattern = cv2.aruco.CharucoBoard(
        (board.columns, board.rows), board.pitch_mm, board.marker_mm, _dictionary(board.dictionary)
    )
    pattern.setLegacyPattern(legacy)
    # OpenCV gives None where it finds none, which its types do not say.
    found: Any = cv2.aruco.CharucoDetector(pattern).detectBoard(grey)
    corners, ids, _, marker_ids = found
    count = 0 if marker_ids is None else len(marker_ids)
    if ids is None or corners is None:
        return np.zeros((0, 2)), np.zeros(0, np.int64), count
    return np.asarray(corners, dtype=float).reshape(-1, 2), np.asarray(ids, dtype=np.int64).ravel(), count


def _dictionary(name: str):
    import cv2

    full = name.upper() if name.upper().startswith("DICT_") else f"DICT_{name.upper()}"
    code = getattr(cv2.aruco, full, None)
    if code is None:
        known = sorted(n for n in dir(cv2.aruco) if n.startswith("DICT_"))
        raise InputError(
            "a marker dictionary among {known}",
            repr(name),
            "Name the one printed.",
            "cell.board",
            known=", ".join(known),
        )
    return cv2.aruco.getPredefinedDictionary(code)


def _why_not(grey: NDArray[np.uint8], board: Board, corners: int, markers: int) -> MeasurementError:
    from calib_core.optics.board_refusal import why_not_found

    if corners == 0:
        mirrored = _detect(np.ascontiguousarray(grey[:, ::-1]), board, False)
        if len(mirrored[1]) >= _FEWEST_CORNERS:
            return MeasurementError(
                "the board as it is",
                "its mirror image",
                "Turn off mirroring in the camera's driver, or take the mirror out of the optics' path.",
            )
    if corners or markers:
        return MeasurementError(
            "at least {fewest_corners} corners of the ChArUco board",
            "{corners} corners and {markers} markers",
            "Show more of the board, and check its columns, rows and dictionary.",
            fewest_corners=_FEWEST_CORNERS,
            corners=corners,
            markers=markers,
        )
    return why_not_found(grey, board)
