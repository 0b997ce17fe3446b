"""Which captures are raw frames of the camera, that a calibrated camera and plane of light turn into points."""

from calib_core.records import Capture, Session
from calib_core.steps import steps_that_show

IMAGES = frozenset({".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg"})
_ENDINGS = tuple(IMAGES)


def of_frames(capture: Capture) -> bool:
    """Return whether a capture is raw frames, which camera and plane of light turn into points."""
    if capture.kind != "sweep":
        return capture.kind == "frame"
    return any(name.lower().endswith(_ENDINGS) for name in capture.files)


def uses_frames(session: Session) -> bool:
    """Return whether the scanner delivers camera frames, which camera and laser plane turn into points."""
    kind = session.cell.scanner.kind
    if kind is not None:
        return kind == "frame"
    boards = steps_that_show("board")
    return any(capture.kind == "frame" or capture.step in boards for capture in session.captures)
