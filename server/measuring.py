"""What is measured in a capture when it arrives."""

import logging
from collections.abc import Callable

from calib_core.errors import CalibrationError, MeasurementError
from calib_core.records import Capture, Measured, Session

log = logging.getLogger("scancell")


def measure(session: Session, capture: Capture, read: Callable[[str], bytes]) -> Measured:
    """Return what was measured; where nothing could be, the verdict `fail` and why: the capture is kept.

    Raises
    ------
    InputError, TooLargeError
        If the record or a file is of no use at all.
    """
    from calib_core.session.measure import measure_capture

    try:
        return measure_capture(session, capture, read)
    except MeasurementError as error:
        reason, to_do = str(error), error.to_do
    except CalibrationError:
        raise
    except Exception as error:  # a fault of the program must not lose a capture that may be unrepeatable
        log.exception("measuring capture %s failed unexpectedly", capture.id)
        reason = f"measuring it failed by an error of the program itself ({type(error).__name__})"
        to_do = "The capture is kept; report this with its file."
    return Measured(capture=capture.id, kind=capture.kind, verdict="fail", reason=reason, to_do=to_do)
