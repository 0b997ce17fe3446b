"""Measuring the captures of one session as the session stands: raw frames need its camera and plane of light."""

from collections.abc import Callable
from functools import cached_property

from calib_core.records import Capture, Measured, Session
from server.measuring import Measure
from server.store.calibrations import Calibrated, needs_calibration


class Measurer:
    """Measures captures of one session, whatever way they came.

    Parameters
    ----------
    measure : callable
        Does it (`Measuring.measure`).
    session : Session
        Its cell is what measuring depends on.
    load_calibration : callable
        Returns the session with its solved camera and plane of light; asked once, by the first raw frame.
    """

    def __init__(self, measure: Measure, session: Session, load_calibration: Callable[[], Calibrated]) -> None:
        self._measure, self._session, self._load_calibration = measure, session, load_calibration

    def measure(self, capture: Capture, read: Callable[[str], bytes]) -> Measured:
        """Return what was measured in a capture whose files `read` gives; raises CalibrationError."""
        if not needs_calibration(capture):
            return self._measure(self._session, capture, read)
        frames = self.calibration
        return frames.told(self._measure(frames.session, capture, read))

    @cached_property
    def calibration(self) -> Calibrated:
        """Camera and plane of light as the session has them."""
        return self._load_calibration()
