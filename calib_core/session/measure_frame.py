"""What is seen in a raw frame of the board, or of the board with the stripe on it, as soon as it comes in."""

import numpy as np

from calib_core.errors import MeasurementError
from calib_core.optics.board import BoardView
from calib_core.records import Capture, Measured, Session
from calib_core.session.boards import board_in, board_of
from calib_core.session.frames import stripe_of
from calib_core.session.measure import ReadFile

_PREVIEW_POINTS = 200
_SOFT_EDGE_PX = 6.0


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
    try:
        view = board_in(capture, board, read)
        pixels = view.points_px
        if capture.step == "laser-plane":
            pixels = stripe_of(capture, read).pixels
    except MeasurementError as error:
        return Measured(
            capture=capture.id,
            kind=capture.kind,
            verdict="fail",
            reason=f"Need {error.need}, got {error.got}.",
            to_do=error.to_do,
        )
    doubt = _doubt(view)
    chosen = np.unique(np.linspace(0, len(pixels) - 1, min(len(pixels), _PREVIEW_POINTS)).astype(int))
    return Measured(
        capture=capture.id,
        kind=capture.kind,
        verdict="warn" if doubt else "pass",
        reason=doubt[0] if doubt else None,
        to_do=doubt[1] if doubt else None,
        points=len(pixels),
        preview=np.round(pixels[chosen], 2).tolist(),
        image_size=view.image_size,
    )


def _doubt(view: BoardView) -> tuple[str, str] | None:
    """Return what is wrong with a board that was found, and what to do; None where it is fine."""
    if np.isfinite(view.edge_width_px) and view.edge_width_px > _SOFT_EDGE_PX:
        return (
            f"The board's edges are {view.edge_width_px:.0f} pixels wide.",
            "Focus the camera or hold it still.",
        )
    if view.saturated > 0.25:
        return (f"{view.saturated:.0%} of the board is saturated.", "Shorten the exposure or dim the lamps.")
    return None
