"""Captures measured by the workers of a cluster, which read the files where they lie."""

import logging
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import Final

from calib_core.errors import CalibrationError
from calib_core.records import Capture, Measured, Session
from server.jobs import worker
from server.jobs.measuring_processes import Measuring
from server.settings import Settings
from server.store.blobs import Blobs

log = logging.getLogger("scancell")

FAR_AT_ONCE: Final = 64
"""How many captures are with a cluster at once."""


@dataclass(frozen=True)
class StoredFiles:
    """Reads a capture's stored files by name; a worker elsewhere is told their digests instead."""

    blobs: Blobs
    digests: Mapping[str, str]

    def __call__(self, name: str) -> bytes:
        """Return the bytes of a file; raises NotFoundError, DamagedError."""
        return self.blobs.read(self.digests[name])


class ClusterMeasuring:
    """Has captures measured on a cluster; what it does not do, soon or at all, is done here.

    Parameters
    ----------
    submit : callable
        Hands work to the cluster, or returns None where that takes none (`Jobs.submit_measuring`).
    here : Measuring
    settings : Settings
    """

    def __init__(
        self, submit: Callable[[Callable[[], str]], "Future[str] | None"], here: Measuring, settings: Settings
    ) -> None:
        self._submit, self._here, self._timeout_s = submit, here, settings.measuring_timeout_s

    def measure(self, session: Session, capture: Capture, read: Callable[[str], bytes]) -> Measured:
        """Return what `Measuring.measure` does; raises InputError, TooLargeError."""
        assert isinstance(read, StoredFiles)
        cell = session.model_copy(update={"captures": []}).to_json()
        future = self._submit(partial(worker.measure, cell, capture.to_json(), read.digests))
        if future is not None:
            try:
                return Measured.model_validate_json(future.result(self._timeout_s))
            except CalibrationError:
                raise
            except Exception as error:  # its worker was killed, or all are busy: a merge may take them for long
                log.warning("capture %s is measured here, not on the cluster: %r", capture.id, error)
                future.cancel()
        return self._here.measure(session, capture, read)
