"""Whether the server is well, and its figures."""

from typing import Any, Literal

from fastapi import APIRouter, Response
from fastapi.responses import JSONResponse, PlainTextResponse
from prometheus_client import CONTENT_TYPE_PLAIN_0_0_4
from sqlalchemy import select

from calib_core import __version__
from server.http.dependencies import HubDep, JobsDep, MetricsDep, StoreDep
from server.http.events import Hub
from server.http.schemas import Health
from server.http.strict_json import StrictRoute
from server.jobs.jobs import Jobs
from server.store.database import Store

router = APIRouter(tags=["server"], route_class=StrictRoute)
probes = APIRouter(tags=["server"], route_class=StrictRoute)

_EXAMPLE: dict[int | str, dict[str, Any]] = {
    200: {"content": {"text/plain": {"example": "scancell_sessions 3.0\n"}}}
}


@router.get("/health", response_model=Health)
def health(store: StoreDep, jobs: JobsDep, hub: HubDep) -> Response:
    """Return `ready` once the store answers and the workers are warm, `starting` before, `stopping` at the end."""
    return JSONResponse({"status": _status(store, jobs, hub), "version": __version__})


@probes.get("/health", response_model=Health, responses={503: {"model": Health, "description": "Not ready."}})
def ready(store: StoreDep, jobs: JobsDep, hub: HubDep) -> Response:
    """Answer with 200 where work may be sent here, with 503 while the server starts or stops."""
    status = _status(store, jobs, hub)
    return JSONResponse({"status": status, "version": __version__}, 200 if status == "ready" else 503)


@probes.get("/health/alive", response_class=PlainTextResponse)
async def alive() -> str:
    """Answer as long as the server runs; where this fails, start it anew."""
    return "alive"


@probes.get("/metrics", response_class=PlainTextResponse, responses=_EXAMPLE)
def metrics(figures: MetricsDep) -> Response:
    """Return the server's figures for Prometheus."""
    return Response(figures.text(), media_type=CONTENT_TYPE_PLAIN_0_0_4)


def _status(store: Store, jobs: Jobs, hub: Hub) -> Literal["ready", "starting", "stopping"]:
    if hub.closed:
        return "stopping"
    with store.read() as db:
        db.execute(select(1))
    return "ready" if jobs.ready else "starting"
