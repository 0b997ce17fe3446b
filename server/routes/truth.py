"""What a simulated cell knows of itself: how far its results lie from the truth."""

from fastapi import Response
from fastapi.responses import JSONResponse

from calib_core.errors import ConflictError
from calib_core.messages import message
from calib_core.records import Record
from calib_core.review.compare import FrameDifference
from server.http.api_router import API, api_router
from server.routes.dependencies import SessionId, StageName, StoreDep
from server.store.sessions import load_session

router = api_router("results", f"{API}/sessions/{{session_id}}/truth")


class OffTheTruth(Record):
    """How far a result's frames lie from the simulated cell's true ones, beside the uncertainty that it states."""

    frames: list[FrameDifference]


@router.get("/{stage}", response_model=OffTheTruth)
def off_the_truth(session_id: SessionId, stage: StageName, store: StoreDep) -> Response:
    """Return how far the result of a simulated cell lies from the truth."""
    from calib_core.review.compare import Compared, differences_from_truth
    from server.sources.simulated import truth_of

    with store.read() as db:
        stored = load_session(db, store.blobs, session_id)
    device = stored.simulated
    result = stored.results_with_stale().get(stage)
    if device is None or result is None:
        raise ConflictError(
            "a result of the simulated cell",
            "a real cell, whose truth nobody knows"
            if device is None
            else message("no result of {stage} yet", stage=stage),
            "Ask for the truth of a simulated session that is solved.",
            session_id,
        )
    frames = differences_from_truth(Compared(session_id, dict(result), stored.session), truth_of(device))
    return JSONResponse(OffTheTruth(frames=frames).model_dump(mode="json"))
