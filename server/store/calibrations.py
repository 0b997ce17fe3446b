"""Camera and plane of light as a session's stages found them, for the raw frames that come after."""

from collections.abc import Mapping
from dataclasses import dataclass

from sqlalchemy import func, select
from sqlalchemy.orm import Session as Transaction

from calib_core.captures.content import shows_board
from calib_core.captures.raw_frames import of_frames
from calib_core.captures.stripe_frames import with_solved_calibration
from calib_core.findings import measured_with
from calib_core.findings.codes.quality import LIGHT_PLANE_OUTDATED
from calib_core.graph.keys import Graph
from calib_core.records import Capture, Measured, Session, parse_capture
from calib_core.steps import optics_stages, steps_that_show
from server.store.backlog import measure_anew
from server.store.blobs import Blobs
from server.store.models import CaptureRow, Data, ResultRow
from server.store.sessions import StoredSession, load_session


@dataclass(frozen=True)
class Calibrated:
    """A session in which a frame can be measured, and how fresh its camera and plane of light are.

    Attributes
    ----------
    session : Session
        Without captures; camera and plane of light stand in its cell where they are known.
    results : tuple of int
        The numbers of the results that they may come from; others are there once something was solved again.
    outdated : bool
        Whether the boards that they come from have changed since.
    """

    session: Session
    results: tuple[int, ...]
    outdated: bool = False

    def told(self, measured: Measured) -> Measured:
        """Return what was measured, with a doubt where the plane of light is not up to date."""
        doubtful = self.outdated and measured.verdict == "pass"
        return measured_with(measured, [LIGHT_PLANE_OUTDATED()]) if doubtful else measured


def needs_calibration(capture: Capture) -> bool:
    """Return whether a capture is raw frames that camera and plane of light turn into points."""
    return of_frames(capture) and not shows_board(capture)


def calibrated_session(db: Transaction, blobs: Blobs, session_id: str) -> Calibrated:
    """Return a stored session as its frames are measured in it; raises NotFoundError."""
    return calibrated(load_session(db, blobs, session_id), board_results(db, session_id))


def calibrated(stored: StoredSession, results: tuple[int, ...] = ()) -> Calibrated:
    """Return a session that was loaded as its frames are measured in it."""
    known = stored.session.cell.known
    stage = optics_stages()[0 if known.laser_plane is not None else -1]
    graph = Graph(stored.session, stored.digests.__getitem__)
    outdated = stage in stored.results and not graph.is_fresh(stage, stored.results[stage]["inputs_sha256"])
    brought = known.camera is not None and known.laser_plane is not None
    return Calibrated(without_captures(stored.session, stored.results), results, outdated and not brought)


def without_captures(session: Session, results: Mapping[str, Data]) -> Session:
    """Return a session without captures, with camera and plane of light in its cell where they are known."""
    return with_solved_calibration(session.model_copy(update={"captures": []}), results)


def board_results(db: Transaction, session_id: str) -> tuple[int, ...]:
    """Return the numbers of the latest results of camera and plane of light."""
    query = select(func.max(ResultRow.number)).where(
        ResultRow.session_id == session_id, ResultRow.stage.in_(optics_stages())
    )
    return tuple(sorted(db.scalars(query.group_by(ResultRow.stage))))


def measure_frames_anew(db: Transaction, session_id: str, stage: str) -> bool:
    """Let raw frames wait to be measured with what was just solved; returns whether there are any."""
    if stage not in optics_stages():
        return False
    rows = db.execute(
        select(CaptureRow.record, CaptureRow.measured).where(
            CaptureRow.session_id == session_id,
            CaptureRow.record["step"].as_string().not_in(steps_that_show("board")),
        )
    )
    until_then: dict[str, Measured] = {}
    for record, measured in rows:
        capture = parse_capture(record, "record")
        if needs_calibration(capture):
            until_then[capture.id] = Measured.model_validate(measured)
    measure_anew(db, session_id, until_then)
    return bool(until_then)
