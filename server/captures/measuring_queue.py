"""Captures whose senders did not wait are measured after they were acknowledged, in the order of their arrival."""

import logging
import threading
import time
from collections.abc import Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from itertools import groupby
from typing import Literal

from calib_core.captures.measured import not_seen
from calib_core.errors import CalibrationError, NotFoundError
from calib_core.findings import measured_judgement
from calib_core.findings.codes.quality import WAITS_FOR_MEASURING
from calib_core.records import Capture, Measured, Session, parse_capture
from server.background import BackgroundThread
from server.captures.cluster_measuring import FAR_AT_ONCE, ClusterMeasuring, StoredFiles
from server.captures.measurer import Measurer
from server.jobs.measuring_processes import Measuring
from server.store.backlog import Waiting, first_waiting, note_measured
from server.store.calibrations import Calibrated, calibrated_session
from server.store.database import Store
from server.store.sessions import empty_session

log = logging.getLogger("scancell")
_AT_ONCE = 20
_PAUSE_S = 5.0
_LOOK_S = 60.0  # a capture may begin to wait in the moment in which the plane of light is solved


class MeasuringQueue(BackgroundThread):
    """A thread that measures what waits; a restarted server goes on with it."""

    def __init__(self, store: Store, measuring: Measuring) -> None:
        super().__init__("measuring queue")
        self._store = store
        self._measure = measuring.measure
        self._at_once, self._threads = _AT_ONCE, ThreadPoolExecutor(1, "measuring queue")
        self._lock = threading.Lock()
        self._batches = 0

    def measure_far(self, cluster: ClusterMeasuring) -> None:
        """Measure many captures at once, on a cluster."""
        self._measure = cluster.measure
        self._at_once, self._threads = FAR_AT_ONCE, ThreadPoolExecutor(FAR_AT_ONCE, "measuring queue")

    def start(self) -> None:
        """Begin with what an earlier server left."""
        self._woken.set()
        super().start()

    @contextmanager
    def arriving(self) -> Generator[None]:
        """Make way while a batch arrives; what it brought is measured afterwards."""
        with self._lock:
            self._batches += 1
        try:
            yield
        finally:
            with self._lock:
                self._batches -= 1
            self._woken.set()

    def stop(self) -> None:
        """End after the capture that is being measured."""
        super().stop()
        self._threads.shutdown()

    def _work(self) -> None:
        while not self._stopping.is_set():
            self._woken.wait(_LOOK_S)
            self._woken.clear()
            try:
                while not self._stopping.is_set() and self._measure_some():
                    self._make_way()
            except Exception:  # a full disk, a locked database: what waits is still there
                log.exception("captures that wait could not be measured")
                self._stopping.wait(_PAUSE_S)
                self._woken.set()

    def _make_way(self) -> None:
        """Wait while batches arrive, but not for ever: there may always be one."""
        end_s = time.monotonic() + _PAUSE_S
        while self._batches and time.monotonic() < end_s and not self._stopping.wait(0.05):
            pass

    def _measure_some(self) -> bool:
        """Measure the first that wait; return whether there were any."""
        with self._store.read() as db:
            waiting = first_waiting(db, self._at_once)
        for session_id, group in groupby(waiting, key=lambda w: w.session_id):
            self._measure_of_session(session_id, list(group))
        return bool(waiting)

    def _measure_of_session(self, session_id: str, waiting: Sequence[Waiting]) -> None:
        session = empty_session(waiting[0].session_record, session_id)
        measurer = Measurer(self._measure, session, lambda: self._calibrated(session_id, session))

        def measure(one: Waiting) -> Measured | None:
            if self._stopping.is_set():
                return None
            capture = parse_capture(one.record, "record")
            try:
                return measurer.measure(capture, StoredFiles(self._store.blobs, one.digests))
            except CalibrationError as error:
                return not_seen(capture, error)

        found = list(zip(waiting, self._threads.map(measure, waiting), strict=True))
        done = [(one, measured) for one, measured in found if measured is not None]
        with self._store.write() as db:
            note_measured(db, session_id, [one for one, _ in done], [measured for _, measured in done])

    def _calibrated(self, session_id: str, session: Session) -> Calibrated:
        try:
            with self._store.read() as db:
                return calibrated_session(db, self._store.blobs, session_id)
        except NotFoundError:
            return Calibrated(session, ())  # it was removed meanwhile


def to_wait(capture: Capture, since: Literal["batch", "cell", "record"] = "batch") -> Measured:
    """Return what is noted of a capture until it is measured: of thousands the same but for the name."""
    return _waiting(since).model_copy(update={"capture": capture.id, "kind": capture.kind})


@cache
def _waiting(since: str) -> Measured:
    found = measured_judgement([WAITS_FOR_MEASURING(since=since)])
    return Measured(capture="waits", kind="profile", **found)
