"""What a live cell needs of its session, asked of the store a few times a second however fast exposures come."""

from sqlalchemy import func, select
from sqlalchemy.orm import Session as Transaction

from calib_core.captures.stripe_frames import calibration_of
from calib_core.cell.found import known_scanner, placed_scanner, told_by
from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.optics.triangulate import ProfileCalibration
from calib_core.records import Cell, Session
from calib_core.steps import tool_stages
from server.live.exposures import Optics
from server.sources.device import host_now_s
from server.store.calibrations import calibrated_session
from server.store.captures import capture_ids
from server.store.database import Store
from server.store.models import ResultRow
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
        self._tool: tuple[int, RigidTransform | None] = 0, None

    def __call__(self) -> tuple[Cell, set[str], Optics]:
        """Return what is known, a solved tool in the cell; raises NotFoundError if the session is gone."""
        now_s = host_now_s()
        if self._known is None or now_s - self._asked_s > _GOOD_FOR_S:
            with self._store.read() as db:
                cell = empty_session(session_row(db, self._session_id).record, self._session_id).cell
                self._known = self._with_tool(db, cell), capture_ids(db, self._session_id), self._optics
            self._asked_s, self._session = now_s, None
        return self._known

    def forget(self) -> None:
        """Ask anew next time: a capture was stored."""
        self._known = None

    def _with_tool(self, db: Transaction, cell: Cell) -> Cell:
        """Return a cell with the tool as it was solved last, unless that failed or the user brought one."""
        if known_scanner(cell) is not None:
            return cell
        of_tool = ResultRow.session_id == self._session_id, ResultRow.stage.in_(tool_stages())
        number = db.scalar(select(func.max(ResultRow.number)).where(*of_tool)) or 0
        if number != self._tool[0]:
            row = db.scalars(select(ResultRow).where(ResultRow.number == number)).one()
            self._tool = number, None if row.verdict == "fail" else placed_scanner(row.record)
        if self._tool[1] is None:
            return cell
        return cell.model_copy(update={"known": cell.known.model_copy(update=told_by(self._tool[1]))})

    def _optics(self) -> ProfileCalibration:
        if self._session is None:
            with self._store.read() as db:
                self._session = calibrated_session(db, self._store.blobs, self._session_id).session
        known = self._session.cell.known
        parts = known.model_dump_json(include={"camera", "laser_plane"})
        if self._calibration is None or self._calibration[0] != parts:
            if known.laser_plane is None:
                to_do = "Calibrate camera and laser plane first, or give them in the cell."
                raise InputError("the plane of light, to make points of the stripe", "none", to_do)
            self._calibration = parts, calibration_of(self._session, _no_file)
        return self._calibration[1]


def _no_file(name: str) -> bytes:
    need = "camera and plane of light in the cell"
    raise InputError(need, "the file {name} to solve them from", "Solve them.", name=name)
