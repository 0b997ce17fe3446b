"""What is measured in a capture, and what is noted where nothing can be."""

import json
import logging
from collections.abc import Callable
from functools import cache

from calib_core.captures.measured import measured_of, not_seen
from calib_core.errors import CalibrationError, MeasurementError
from calib_core.findings.codes.quality import MEASURING_FAILED, NOT_FINITE
from calib_core.records import Capture, Measured, Session

log = logging.getLogger("scancell")

Measure = Callable[[Session, Capture, Callable[[str], bytes]], Measured]
"""What `measure` does, here or in a process of its own (`Measuring.measure`)."""


@cache
def warm_up() -> None:
    """Measure a simulated capture, so that the first real one does not wait for imports and compiling."""
    from calib_core.captures.measure import measure_capture
    from calib_core.simulation import simulate

    simulated = simulate("tcp", 1)
    measure_capture(simulated.session, simulated.session.captures[0], simulated.files.__getitem__)


def check_poses(session: Session, capture: Capture) -> None:
    """Refuse a capture whose poses the robot's convention does not understand.

    Raises
    ------
    InputError
    """
    from calib_core.robots import parse_pose

    track = [timed.pose for timed in capture.pose_track or []]
    for pose in [*([capture.pose] if capture.pose is not None else []), *(capture.poses or []), *track]:
        parse_pose(session.cell.pose_convention, pose, f"{capture.id}: pose")


def measure(session: Session, capture: Capture, read: Callable[[str], bytes]) -> Measured:
    """Return what was measured; where nothing could be, the verdict `fail` and why: the capture is kept.

    Raises
    ------
    InputError, TooLargeError
        If the record or a file is of no use at all.
    """
    return measured_with_text(session, capture, read)[0]


def measured_with_text(session: Session, capture: Capture, read: Callable[[str], bytes]) -> tuple[Measured, str]:
    """Return what `measure` does, also as JSON text."""
    from calib_core.captures.measure import measure_capture

    try:
        measured = measure_capture(session, capture, read)
        text = finite_text(measured)
        if text is not None:
            return measured, text
        nothing = measured_of(capture, [NOT_FINITE()])
    except MeasurementError as error:
        nothing = not_seen(capture, error)
    except CalibrationError:
        raise
    except Exception as error:  # a fault of the program must not lose a capture that may be unrepeatable
        log.exception("measuring capture %s failed unexpectedly", capture.id)
        nothing = measured_of(capture, [MEASURING_FAILED(how="program", error=type(error).__name__)])
    return nothing, nothing.model_dump_json(exclude_unset=True)


def finite_text(measured: Measured) -> str | None:
    """Return what was measured as JSON text, None where it holds NaN or infinities.

    Those become null in the text: where it has no more of them than fields that are empty, and findings without a
    remedy, all numbers are finite.
    """
    text = measured.model_dump_json(exclude_unset=True)
    empty = sum(getattr(measured, name) is None for name in measured.model_fields_set) + len(measured.findings)
    if text.count("null") == empty:
        return text
    try:
        return json.dumps(measured.to_json(), allow_nan=False)
    except ValueError:
        return None
