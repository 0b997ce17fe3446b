"""What a live cell needs of its session, asked of the store a few times a second however fast exposures come."""

from calib_core.captures.stripe_frames import calibration_of
from calib_core.errors import InputError
from calib_core.optics.triangulate import ProfileCalibration
from calib_core.records import Cell, Session
from server.live.exposures import Optics
from server.sources.device import host_now_s
from server.store.calibrations import calibrated_session
from server.store.captures import capture_ids
from server.store.database import Store
from server.store.sessions import empty_session, session_row

_GOOD_FOR_S = 0.5


class SessionNow:
    """Returns a session's cell, its captures' ids and its optics, half a second old at most."""

    def __init__(self, store: Store, session_id: str) -> None:
        self._store, self._session_id = store, session_id
        self._asked_s = -_GOOD_FOR_S
        self._known: tuple[Cell, set[str], Optics] | None = None
        self._session: Session | None = None
        self._calibration: tuple[str, ProfileCalibration] | None = None

    def __call__(self) -> tuple[Cell, set[str], Optics]:
        """Return what is known; raises NotFoundError if the session is gone."""
        now_s = host_now_s()
        if self._known is None or now_s - self._asked_s > _GOOD_FOR_S:
            with self._store.read() as db:
                cell = empty_session(session_row(db, self._session_id).record, self._session_id).cell
                self._known = cell, capture_ids(db, self._session_id), self._optics
            self._asked_s, self._session = now_s, None
        return self._known

    def forget(self) -> None:
        """Ask anew next time: a capture was stored."""
        self._known = None

    def _optics(self) -> ProfileCalibration:
        if self._session is None:
            with self._store.read() as db:
                self._session = calibrated_session(db, self._store.blobs, self._session_id).session
        known = self._session.cell.known
        parts = known.model_dump_json(include={"camera", "laser_plane"})
        if self._calibration is None or self._calibration[0] != parts:
            if known.laser_plane is None:
                raise InputError(
                    "the plane of light, to make points of the stripe",
                    "none yet",
                    "Calibrate camera and laser plane first, or give them in the cell.",
                )
            self._calibration = parts, calibration_of(self._session, _no_file)
        return self._calibration[1]


def _no_file(name: str) -> bytes:
    raise InputError(
        "camera and plane of light in the cell", "the file {name} to solve them from", "Solve them.", name=name
    )
