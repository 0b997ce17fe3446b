"""Whether the server is well."""

from fastapi import APIRouter, Response
from fastapi.responses import JSONResponse
from sqlalchemy import select

from calib_core import __version__
from server.deps import JobsDep, StoreDep
from server.schemas import Health
from server.strict_json import StrictRoute

router = APIRouter(tags=["server"], route_class=StrictRoute)


@router.get("/health", response_model=Health)
def health(store: StoreDep, jobs: JobsDep) -> Response:
    """Return `ready` once the store answers and the workers are warm, `starting` before."""
    with store.read() as db:
        db.execute(select(1))
    return JSONResponse({"status": "ready" if jobs.ready else "starting", "version": __version__})
