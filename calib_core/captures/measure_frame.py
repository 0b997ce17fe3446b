"""What is seen in a raw frame of the board, or of the board with the stripe on it, as soon as it comes in."""

from typing import Any

import numpy as np

from calib_core.captures.boards import board_in, board_of, read_frame, stripe_of
from calib_core.captures.content import pose_of, shows_sphere
from calib_core.captures.measured import measured_of, not_seen
from calib_core.captures.sweep import sweep_poses
from calib_core.errors import MeasurementError
from calib_core.findings import Finding
from calib_core.findings.codes import quality as codes
from calib_core.findings.codes.camera import BOARD_TURN_AMBIGUOUS
from calib_core.frames import FloatArray
from calib_core.optics.adjust import Corners
from calib_core.optics.board import BoardView
from calib_core.optics.camera_start import homographies
from calib_core.optics.stripe import find_stripe
from calib_core.records import Capture, Measured, ReadFile, Session

_PREVIEW_POINTS = 200
_SOFT_EDGE_PX, _MOST_SATURATED = 6.0, 0.25


def measure_frame(session: Session, capture: Capture, read: ReadFile) -> Measured:
    """Return what a camera or laser-plane capture shows; `preview` holds the stripe's centres or the corners, px.

    Raises
    ------
    InputError
        If the cell names no board, or a file is of no use.
    TooLargeError
        If an image has too many pixels.
    """
    board = board_of(session.cell)
    view = None
    try:
        view = board_in(capture, board, read)
        pixels = view.points_px
        if capture.step == "laser-plane":
            pixels = stripe_of(capture, read).pixels
    except MeasurementError as error:
        return not_seen(capture, error, image_size=_size(capture, read), **_board_figures(view))
    return measured_of(
        capture,
        board_findings(view),
        points=len(pixels),
        preview=_thinned(pixels),
        image_size=view.image_size,
        **_board_figures(view),
    )


def measure_stripe(session: Session, capture: Capture, read: ReadFile) -> Measured:
    """Return the stripe, in pixels, of a frame that cannot become points yet; of a sweep, in its middle frame.

    Raises
    ------
    InputError
        If a file or the pose is of no use.
    TooLargeError
        If an image has too many pixels.
    """
    if capture.kind == "sweep":
        sweep_poses(session.cell, capture)
    elif capture.pose is not None or shows_sphere(capture):
        pose_of(session.cell, capture)
    shown = len(capture.files) // 2
    for place in range(len(capture.files)):
        if place != shown:
            read_frame(capture, read, place)  # refuses what is no image
    frame = read_frame(capture, read, shown)
    height, width = frame.shape[:2]
    try:
        pixels = find_stripe(frame).pixels
    except MeasurementError as error:
        return not_seen(capture, error, image_size=(width, height))
    found = [codes.WAITS_FOR_CAMERA()]
    return measured_of(capture, found, points=len(pixels), preview=_thinned(pixels), image_size=(width, height))


def _thinned(pixels: FloatArray) -> list[list[float]]:
    chosen = np.unique(np.linspace(0, len(pixels) - 1, min(len(pixels), _PREVIEW_POINTS)).astype(int))
    return np.round(pixels[chosen], 2).tolist()


def _size(capture: Capture, read: ReadFile) -> tuple[int, int]:
    """Return width and height of the frame that is shown, the last one."""
    frame = read_frame(capture, read, -1)
    return frame.shape[1], frame.shape[0]


def _board_figures(view: BoardView | None) -> dict[str, Any]:
    """Return what the frame says of the board, for coverage and sharpness; nothing where it is not found."""
    if view is None:
        return {}
    return {
        "board_px": np.round(view.points_px, 1).tolist(),
        "pitch_px": float(np.median(np.hypot(*np.diff(view.points_px, axis=0).T))),
        "pixel_from_board": homographies(Corners.of([view.points_px], [view.points_in_board_mm]))[0].tolist(),
        "edge_width_px": view.edge_width_px if np.isfinite(view.edge_width_px) else None,
    }


def board_findings(view: BoardView) -> list[Finding]:
    """Return what is noticed of a board that was found."""
    found: list[Finding] = []
    if np.isfinite(view.edge_width_px) and view.edge_width_px > _SOFT_EDGE_PX:
        found.append(codes.EDGES_SOFT(width_px=view.edge_width_px))
    if view.saturated > _MOST_SATURATED:
        found.append(codes.BOARD_SATURATED(share=view.saturated))
    if view.in_colour:
        found.append(codes.IN_COLOUR())
    if view.left_out:
        found.append(codes.CORNERS_COVERED(count=view.left_out))
    if view.unseen:
        seen, place = len(view.ids), "known" if view.is_numbered else "open"
        found.append(codes.BOARD_IN_PART(seen=seen, count=seen + view.unseen, place=place))
    return [*found, *([BOARD_TURN_AMBIGUOUS()] if view.turn_is_ambiguous else [])]
