"""ChArUco boards: a chessboard whose white squares hold markers, so that a part of it is enough."""

from typing import Any, NamedTuple

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
from calib_core.optics.board_refusal import CELL_BOARD, MIRRORED, shrunk, why_not_found
from calib_core.optics.camera_start import homographies
from calib_core.optics.charuco_count import refuse_other_count
from calib_core.records import Board

_FEWEST_CORNERS, _FEWEST_MARKERS = 6, 4
_THRESHOLD_PX = 23  # the largest window of OpenCV's three: the reason need not be looked for in all


def find_charuco(grey: NDArray[np.uint8], board: Board) -> tuple[FloatArray, NDArray[np.int64], FloatArray]:
    """Return corners (N, 2), px, their ids (N,) and their places on the board (N, 3), mm.

    Raises
    ------
    MeasurementError
        If fewer than six corners are seen, or the image is mirrored.
    InputError
        If the marker's size or the dictionary is not given.
    """
    tries: list[_Detected] = []
    for legacy in (False, True):
        tries.append(_detect(grey, board, legacy))
        if len(tries[-1].ids) >= _FEWEST_CORNERS:
            break
    best = max(tries, key=lambda one: len(one.ids))
    refuse_other_count(best.marker_ids, best.marker_corners_px, board, grey)
    points, ids = best.corners_px, best.ids
    if len(ids) < _FEWEST_CORNERS:
        raise _why_not(grey, board, len(ids), max(len(one.marker_ids) for one in tries))
    columns = board.columns - 1
    places = np.zeros((len(ids), 3))
    pitch_x_mm, pitch_y_mm = board.pitches_mm
    places[:, 0], places[:, 1] = (ids % columns + 1) * pitch_x_mm, (ids // columns + 1) * pitch_y_mm
    if np.linalg.matrix_rank(places[:, :2] - places[0, :2], tol=0.1 * board.pitch_mm) < 2:
        to_do = "Show more of the board."
        raise MeasurementError("corners in at least two rows and columns", "corners in one line", to_do)
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


class _Detected(NamedTuple):
    """Corners (N, 2) between squares with their ids, and markers with their corners (M, 4, 2), px."""

    corners_px: FloatArray
    ids: NDArray[np.int64]
    marker_ids: NDArray[np.int64]
    marker_corners_px: FloatArray


def _detect(grey: NDArray[np.uint8], board: Board, legacy: bool) -> _Detected:
    import cv2

    pattern = cv2.aruco.CharucoBoard((board.columns, board.rows), board.pitch_mm, *markers_of(board))
    pattern.setLegacyPattern(legacy)
    # OpenCV gives None where it finds none, which its types do not say.
    found: Any = cv2.aruco.CharucoDetector(pattern).detectBoard(grey)
    corners, ids, quads, marker_ids = found
    return _Detected(
        np.asarray([] if ids is None else corners, dtype=float).reshape(-1, 2),
        np.asarray([] if ids is None else ids, dtype=np.int64).ravel(),
        np.asarray([] if marker_ids is None else marker_ids, dtype=np.int64).ravel(),
        np.asarray([] if marker_ids is None else quads, dtype=float).reshape(-1, 4, 2),
    )


def markers_of(board: Board) -> tuple[float, Any]:
    """Return the side of a ChArUco board's markers, mm, and their dictionary; raises InputError without them."""
    if board.marker_mm is None or board.dictionary is None:
        need = "marker_mm and dictionary of a ChArUco board"
        to_do = "Add both to cell.board, as printed on the board (dictionary: for example DICT_5X5_100)."
        raise InputError(need, "a board without them", to_do, "cell.board")
    if board.marker_mm >= board.pitch_mm:
        raise InputError(
            "markers that are smaller than their squares of {pitch_mm:g} mm",
            "markers of {marker_mm:g} mm",
            "Measure both on the board and correct marker_mm or pitch_mm in cell.board.",
            "cell.board",
            pitch_mm=board.pitch_mm,
            marker_mm=board.marker_mm,
        )
    return board.marker_mm, _dictionary_named(board.dictionary)


def _dictionary_named(name: str):
    """Return OpenCV's dictionary of markers by its name; raises InputError where there is none of it."""
    import cv2

    full = name.upper() if name.upper().startswith("DICT_") else f"DICT_{name.upper()}"
    code = getattr(cv2.aruco, full, None)
    if code is None:
        known = sorted(n for n in dir(cv2.aruco) if n.startswith("DICT_"))
        raise InputError.unknown(name, known, "cell.board.dictionary")
    return cv2.aruco.getPredefinedDictionary(code)


def dictionary_in(grey: NDArray[np.uint8]) -> str | None:
    """Return the smallest dictionary that holds the markers of a frame, None where too few are any's."""
    import cv2

    families = [name for name in dir(cv2.aruco) if name.startswith("DICT_") and name.upper() == name]
    families = [name for name in families if not name.endswith(("_50", "_100", "_250"))]
    once = cv2.aruco.DetectorParameters()
    once.adaptiveThreshWinSizeMin = once.adaptiveThreshWinSizeMax = _THRESHOLD_PX
    detector = cv2.aruco.ArucoDetector([_dictionary_named(name) for name in families], once)
    found: Any = detector.detectMarkersMultiDict(shrunk(grey)[0])
    if found[1] is None:
        return None
    ids, family = np.ravel(found[1]), np.ravel(found[3])
    counts = np.bincount(family, minlength=len(families))
    if counts.max() < _FEWEST_MARKERS:
        return None
    best, most = families[int(counts.argmax())], int(ids[family == counts.argmax()].max())
    smaller = [best.replace("_1000", f"_{size}") for size in (50, 100, 250) if most < size]
    return smaller[0] if smaller else best


def _why_not(grey: NDArray[np.uint8], board: Board, corners: int, markers: int) -> MeasurementError:
    if corners == 0:
        mirrored = _detect(np.ascontiguousarray(grey[:, ::-1]), board, False)
        if len(mirrored.marker_ids) > max(markers, _FEWEST_MARKERS):
            return MeasurementError(*MIRRORED)
        assert board.dictionary is not None
        if markers < _FEWEST_MARKERS and (other := dictionary_in(grey)):
            need = "markers of {dictionary}, as cell.board says"
            to_do = "Correct the dictionary in cell.board."
            return MeasurementError(
                need, "markers of {other}", to_do, CELL_BOARD, dictionary=board.dictionary, other=other
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
