"""Which stages turn raw frames into points."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from calib_core.records import Session


def rests_on_optics(session: "Session", steps: Iterable[str]) -> tuple[str, ...]:
    """Return the stages that turn the raw frames of these steps into points; none where there are no frames."""
    from calib_core.captures.raw_frames import of_frames
    from calib_core.steps import optics_stages

    captures = [capture for capture in session.captures if capture.step in steps]
    if not any(of_frames(capture) and not capture.excluded for capture in captures):
        return ()
    needed = optics_stages()
    return needed[-1:] if session.cell.known.laser_plane is None else needed
