"""Whether the server is well, and its figures."""

from typing import Any

from fastapi import Response
from fastapi.responses import JSONResponse, PlainTextResponse
from prometheus_client import CONTENT_TYPE_PLAIN_0_0_4

from calib_core import __version__
from server.health import HealthWatch
from server.http.api_router import api_router
from server.http.events import Hub
from server.http.schemas import Health
from server.jobs.jobs import Jobs
from server.jobs.kernels import KernelCompiler
from server.routes.dependencies import HealthDep, HubDep, JobsDep, KernelsDep, MetricsDep

router = api_router("server")
probes = api_router("server", prefix="")

_EXAMPLE: dict[int | str, dict[str, Any]] = {
    200: {"content": {"text/plain": {"example": "scancell_sessions 3.0\n"}}}
}


@router.get("/health", response_model=Health)
def health(health: HealthDep, jobs: JobsDep, hub: HubDep, kernels: KernelsDep) -> Response:
    """Return `ready` once the workers are warm, `starting` before, `stopping` at the end.

    `degraded` where something is away that the server rests on; `reasons` says what and how.
    """
    return JSONResponse(_state(health, jobs, hub, kernels))


@probes.get("/health", response_model=Health, responses={503: {"model": Health, "description": "Not ready."}})
def ready(health: HealthDep, jobs: JobsDep, hub: HubDep, kernels: KernelsDep) -> Response:
    """Answer with 200 where work may be sent here, with 503 while the server starts, stops or cannot store."""
    state = _state(health, jobs, hub, kernels)
    good = state["status"] == "ready" or (state["status"] == "degraded" and health.can_store)
    return JSONResponse(state, 200 if good else 503)


@probes.get("/health/alive", response_class=PlainTextResponse)
async def alive() -> str:
    """Answer as long as the server runs; where this fails, start it anew."""
    return "alive"


@probes.get("/metrics", response_class=PlainTextResponse, responses=_EXAMPLE)
def metrics(figures: MetricsDep) -> Response:
    """Return the server's figures for Prometheus."""
    return Response(figures.text(), media_type=CONTENT_TYPE_PLAIN_0_0_4)


def _state(health: HealthWatch, jobs: Jobs, hub: Hub, kernels: KernelCompiler) -> dict[str, Any]:
    reasons = health.troubles()
    status = "stopping" if hub.closed else "degraded" if reasons else "ready" if jobs.ready else "starting"
    return {"status": status, "version": __version__, "kernels": kernels.state, "reasons": reasons}
