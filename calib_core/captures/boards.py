"""The board in a capture's frame, found once: as the frame comes in, for the camera and for the plane of light."""

from collections import Counter
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from calib_core.captures.contradictions import not_measured
from calib_core.captures.observation_cache import seen_once
from calib_core.errors import InputError, MeasurementError
from calib_core.findings import Finding
from calib_core.findings.codes import camera as codes
from calib_core.formats.shared.images import decode_image
from calib_core.messages import plural
from calib_core.optics.board import BoardView, find_board
from calib_core.optics.board_refusal import CELL_BOARD
from calib_core.optics.stripe import StripeCenters, find_stripe
from calib_core.optics.stripe_looks import StripeLooks, look_again
from calib_core.records import Board, Capture, Cell, ReadFile

Image = NDArray[np.uint8] | NDArray[np.uint16]

_CONTRADICTED_SHARE = 0.25  # of the frames: fewer may show a board that was in the way
_DARK_SHARE = 0.15  # of the brightest pixel: a frame whose median is below shows no lit board


def board_of(cell: Cell) -> Board:
    """Return the cell's board; raises InputError where it names none."""
    if cell.board is None:
        to_do = 'Add it, for example {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 25}.'
        raise InputError("the calibration board", "nothing", to_do, "cell.board")
    return cell.board


def read_frame(capture: Capture, read: ReadFile, place: int = 0) -> Image:
    """Return one of a capture's frames; raises InputError or TooLargeError where its file is of no use."""
    name = capture.files[place]
    return decode_image(read(name), name)


def relative_pitch_sigma(board: Board) -> float | None:
    """Return the relative standard deviation of a board's pitch; None where none is told."""
    return None if board.pitch_sigma_mm is None else board.pitch_sigma_mm / board.pitch_mm


def board_in(capture: Capture, board: Board, read: ReadFile) -> BoardView:
    """Return the board in a capture's first frame, searched for once.

    Raises
    ------
    InputError
        If the file is of no use.
    TooLargeError
        If the image has too many pixels.
    MeasurementError
        If the frame does not show the board.
    """
    name = capture.files[0]
    told = board.model_dump(mode="json")
    try:
        return seen_once(BoardView, [name], read, told, lambda: find_board(decode_image(read(name), name), board))
    except MeasurementError as error:
        if error.where != CELL_BOARD and _shows_stripe_alone(capture, read):
            raise error.adding("Dark boards do not count any more: take a frame of the lit board, too.") from None
        raise


def frames_not_used(failed: Mapping[str, MeasurementError], used: int) -> list[Finding]:
    """Return why frames are not used, first what they contradict in what is told of the board.

    Parameters
    ----------
    failed : mapping
        Why each capture shows no board, or nothing on it.
    used : int
        How many captures do.
    """
    other = {name: error for name, error in failed.items() if error.where == CELL_BOARD}
    if len(other) < _CONTRADICTED_SHARE * (len(other) + used):
        other = {}
    rest = {name: error for name, error in failed.items() if name not in other}
    return [*not_measured(other, codes.BOARD_NOT_AS_TOLD), *not_measured(rest, codes.FRAME_NOT_USED)]


def board_first(found: Iterable[Finding]) -> list[Finding]:
    """Return findings in their order, but that the board is not as told first: others may follow from it."""
    return sorted(found, key=lambda one: one.code != codes.BOARD_NOT_AS_TOLD.name)


def likeliest_failure(failed: Mapping[str, MeasurementError]) -> tuple[str, MeasurementError]:
    """Return a capture with the usual reason of those that fail: what they contradict in cell.board, if any."""
    other = {name: error for name, error in failed.items() if error.where == CELL_BOARD} or failed
    usual = Counter(str(error.got) for error in other.values()).most_common(1)[0][0]
    return next((name, error) for name, error in other.items() if str(error.got) == usual)


def _shows_stripe_alone(capture: Capture, read: ReadFile) -> bool:
    """Return whether a capture shows the stripe on a dark board, as it once was enough."""
    if capture.step != "laser-plane" or len(capture.files) != 1:
        return False
    frame = read_frame(capture, read)
    return float(np.median(frame[::4, ::4])) < _DARK_SHARE * float(frame.max())


def stripe_of(capture: Capture, read: ReadFile) -> StripeCenters:
    """Return the stripe in a laser-plane capture: in its second frame where it has two, the lit board first.

    Where the stripe's frame is as bright as the board's own, the board's is taken off.

    Raises
    ------
    InputError
        If there are more than two files or one is of no use.
    MeasurementError
        If there is no stripe.
    """
    if len(capture.files) > 2:
        need = "one or two frames in a laser-plane capture, the board lit and the stripe on it"
        to_do = "Give each pose of the board its own capture."
        raise InputError(
            need, plural("{count} file", "{count} files", by="count", count=len(capture.files)), to_do, capture.id
        )
    return seen_once(StripeCenters, capture.files, read, None, lambda: _stripe(capture, read))


def stripe_looks(capture: Capture, read: ReadFile) -> StripeLooks:
    """Return the stripe of a laser-plane capture as it is met in several ways; raises as `stripe_of`."""
    return seen_once(StripeLooks, capture.files, read, None, lambda: look_again(*stripe_frames(capture, read)))


def _stripe(capture: Capture, read: ReadFile) -> StripeCenters:
    frame, dark = stripe_frames(capture, read)
    return find_stripe(frame, dark=dark)


def stripe_frames(capture: Capture, read: ReadFile) -> tuple[Image, Image | None]:
    """Return the frame with the stripe, and the one without it that is to be taken off."""
    frame = read_frame(capture, read, -1)
    if len(capture.files) == 1:
        return frame, None
    lit = read_frame(capture, read, 0)
    alike = lit.shape == frame.shape
    if alike and float(np.median(frame[::4, ::4])) > 0.5 * float(np.median(lit[::4, ::4])) > 5:
        return frame, lit
    return frame, None
