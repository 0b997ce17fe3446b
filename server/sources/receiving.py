"""A capture on its way in, whatever it came from: checked, measured, its files stored."""

from collections.abc import Mapping

from calib_core.records import Capture
from server.http.uploads import digests_of
from server.jobs.measuring_processes import Measuring
from server.store.arrivals import Arrival, require_free, session_record
from server.store.calibrations import calibrated_session, needs_calibration
from server.store.database import Store
from server.store.models import Data
from server.store.sessions import empty_session


def receive(
    store: Store, measuring: Measuring, session_id: str, capture: Capture, contents: Mapping[str, bytes]
) -> tuple[Arrival, Data]:
    """Return a measured capture, its files being blobs, and the session's record that it was measured for.

    It is not in the session yet: `add_captures` puts it there.

    Raises
    ------
    CalibrationError
        If it cannot be used at all, or its id or a file's name is taken.
    """
    digests = digests_of(contents)
    with store.read() as db:
        record = session_record(db, session_id)
        require_free(db, session_id, capture, digests)
    session = empty_session(record, session_id)
    sizes = {name: len(part) for name, part in contents.items()}
    if needs_calibration(capture):
        with store.read() as db:
            frames = calibrated_session(db, store.blobs, session_id)
        measured = frames.told(measuring.measure(frames.session, capture, contents.__getitem__))
        arrival = Arrival(capture, measured, digests, sizes, calibration=frames.results)
    else:
        measured = measuring.measure(session, capture, contents.__getitem__)
        arrival = Arrival(capture, measured, digests, sizes)
    for part in contents.values():
        store.blobs.put(part)
    return arrival, record
