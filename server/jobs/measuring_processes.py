"""Processes in which captures are measured as they arrive.

The service itself stays free to answer meanwhile, and a file that makes a library crash, hang or take all memory
costs one process, not the service.
"""

import logging
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from calib_core.archive.observation_store import KeptObservations
from calib_core.captures.measured import measured_of
from calib_core.captures.observation_cache import Keeper, keeping
from calib_core.findings.codes.quality import MEASURING_FAILED
from calib_core.records import Capture, Measured, Session, parse_capture, parse_session
from server.jobs.child_processes import WorkerContext
from server.jobs.processes import ProcessEndedError, Processes
from server.measuring import check_poses, measured_with_text, warm_up
from server.store.json_text import JsonText

log = logging.getLogger("scancell")


class Measuring:
    """Measures captures in processes of its own, which start when they are needed first.

    Parameters
    ----------
    processes : int
        How many captures at once.
    timeout_s : float
        What takes longer is given up; the capture is kept all the same.
    warm : bool
        Whether what solves need is loaded along.
    observations : Path, optional
        The folder that keeps what was seen.
    """

    def __init__(
        self, processes: int, timeout_s: float, warm: bool = False, observations: Path | None = None
    ) -> None:
        self._timeout_s = timeout_s
        self._processes = Processes(processes, WorkerContext(warm), _begin, observations)
        self._threads = ThreadPoolExecutor(processes, "measuring")
        self.warm_up = self._processes.warm_up

    def measure(self, session: Session, capture: Capture, read: Callable[[str], bytes]) -> Measured:
        """Return what was measured; where nothing could be, the verdict `fail` and why: the capture is kept.

        Raises
        ------
        InputError, TooLargeError
            If the record or a file is of no use at all.
        """
        cell = session.model_copy(update={"captures": []}).to_json()
        contents = {name: read(name) for name in capture.files}
        return Measured.model_validate_json(self.measured_text(cell, capture, contents))

    def submit(self, cell: dict[str, Any], capture: Capture, contents: Mapping[str, bytes]) -> Future[JsonText]:
        """Return what `measure` will have returned, as JSON text.

        Parameters
        ----------
        cell : dict
            The session's record without captures.
        capture : Capture
        contents : mapping of str to bytes
            Its files, by name.
        """
        return self._threads.submit(self.measured_text, cell, capture, contents)

    def measured_text(self, cell: dict[str, Any], capture: Capture, contents: Mapping[str, bytes]) -> JsonText:
        """Return what `submit` promises, in this thread."""
        work = cell, capture.to_json(), contents
        try:
            return JsonText(self._processes.ask(_measure, *work, timeout_s=self._timeout_s))
        except TimeoutError:
            found = MEASURING_FAILED(how="time", limit_s=self._timeout_s)
        except ProcessEndedError:
            found = MEASURING_FAILED(how="process")
        return JsonText(measured_of(capture, [found]).model_dump_json(exclude_unset=True))

    def stop(self) -> None:
        """End all processes."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        self._processes.stop()


_keeper: Keeper | None = None


def _begin(_: object, observations: Path | None) -> None:
    global _keeper
    _keeper = None if observations is None else KeptObservations(observations)
    try:
        warm_up()
    except Exception:  # the capture itself will meet the fault again and say so
        log.exception("a measuring process could not be warmed up")


def _measure(cell: dict[str, Any], record: dict[str, Any], contents: Mapping[str, bytes]) -> str:
    session = parse_session(cell, "session")
    capture = parse_capture(record, "record")
    check_poses(session, capture)
    return measured_with_text(session, capture, keeping(contents.__getitem__, _keeper))[1]
