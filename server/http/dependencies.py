"""What the routes are given: the store, the jobs, paging and Idempotency-Key."""

from typing import Annotated

from fastapi import Depends, Header, Path, Query, Request

from server.captures.intake import Intake
from server.captures.measuring_queue import MeasuringQueue
from server.guides import Guides
from server.health import HealthWatch
from server.http.events import Hub
from server.http.idempotency import NO_KEY, Idempotency
from server.http.uploads import UploadMemory
from server.jobs.jobs import Jobs
from server.jobs.measuring_processes import Measuring
from server.jobs.page_process import PageProcess
from server.metrics import Metrics
from server.settings import Settings
from server.store.database import Store
from server.webhooks.sender import WebhookSender

# These are coroutines because FastAPI hands every plain function to another thread first.


async def _settings(request: Request) -> Settings:
    return request.app.state.settings


async def _store(request: Request) -> Store:
    return request.app.state.store


async def _hub(request: Request) -> Hub:
    return request.app.state.hub


async def _jobs(request: Request) -> Jobs:
    return request.app.state.jobs


async def _measuring(request: Request) -> Measuring:
    return request.app.state.measuring


async def _metrics(request: Request) -> Metrics:
    return request.app.state.metrics


async def _upload_memory(request: Request) -> UploadMemory:
    return request.app.state.upload_memory


async def _measuring_queue(request: Request) -> MeasuringQueue:
    return request.app.state.measuring_queue


async def _webhooks(request: Request) -> WebhookSender:
    return request.app.state.webhooks


async def _intake(request: Request) -> Intake:
    return request.app.state.intake


SettingsDep = Annotated[Settings, Depends(_settings)]


async def _guides(request: Request) -> Guides:
    return request.app.state.guides


async def _page_process(request: Request) -> PageProcess:
    return request.app.state.page_process


StoreDep = Annotated[Store, Depends(_store)]
GuidesDep = Annotated[Guides, Depends(_guides)]
PageProcessDep = Annotated[PageProcess, Depends(_page_process)]
HubDep = Annotated[Hub, Depends(_hub)]
JobsDep = Annotated[Jobs, Depends(_jobs)]
MeasuringDep = Annotated[Measuring, Depends(_measuring)]
MetricsDep = Annotated[Metrics, Depends(_metrics)]
UploadMemoryDep = Annotated[UploadMemory, Depends(_upload_memory)]
MeasuringQueueDep = Annotated[MeasuringQueue, Depends(_measuring_queue)]


async def _health(request: Request) -> HealthWatch:
    return request.app.state.health


HealthDep = Annotated[HealthWatch, Depends(_health)]
WebhooksDep = Annotated[WebhookSender, Depends(_webhooks)]
IntakeDep = Annotated[Intake, Depends(_intake)]

SessionId = Annotated[str, Path(description="A session's `id`.", max_length=64, examples=["4c1f0a92e6b37d58"])]
CaptureId = Annotated[str, Path(description="A capture's `id`.", max_length=64, examples=["p01"])]
JobId = Annotated[str, Path(description="A job's `id`.", max_length=64, examples=["a07be1d35c29f846"])]
StageName = Annotated[
    str, Path(description="`tcp`, and the other stages as they come.", max_length=64, examples=["tcp"])
]
IfMatch = Annotated[
    str | None, Header(max_length=200, description="The ETag that the change was made against; else 412.")
]
LastEventId = Annotated[
    str | None, Header(pattern=r"^\d{1,15}$", description="The last event's id: the stream goes on after it.")
]
Cursor = Annotated[str | None, Query(max_length=500, description="The `next` of the page before.")]
Again = Annotated[str | None, Query(max_length=64, description="The `id` of a capture to be taken again.")]
Limit = Annotated[int, Query(ge=1, le=1000, description="How many at most.")]


async def _idempotency(
    request: Request,
    idempotency_key: Annotated[
        str | None,
        Header(
            min_length=1,
            max_length=255,
            description="Any text, fresh for each new request: a repeated request with it does nothing twice.",
        ),
    ] = None,
) -> Idempotency:
    if idempotency_key is None:
        return NO_KEY
    return Idempotency(f"{request.method} {request.url.path}", idempotency_key)


IdempotencyDep = Annotated[Idempotency, Depends(_idempotency)]
