"""What the routes are given: the store, the jobs, paging and Idempotency-Key."""

from typing import Annotated

from fastapi import Depends, Header, Path, Query, Request
from pydantic import AfterValidator

from server.captures.intake import Intake
from server.captures.measuring_queue import MeasuringQueue
from server.guides import Guides
from server.health import HealthWatch
from server.http.api_router import of_app
from server.http.events import Hub
from server.http.idempotency import NO_KEY, Idempotency
from server.http.preferences import tags_without_language
from server.http.uploads import UploadMemory
from server.jobs.jobs import Jobs
from server.jobs.kernels import KernelCompiler
from server.jobs.measuring_processes import Measuring
from server.jobs.page_process import PageProcess
from server.metrics import Metrics
from server.settings import Settings
from server.store.database import Store
from server.store.sessions import StoredSession, load_session, session_row
from server.webhooks.sender import WebhookSender

SettingsDep = Annotated[Settings, of_app("settings")]
StoreDep = Annotated[Store, of_app("store")]
GuidesDep = Annotated[Guides, of_app("guides")]
PageProcessDep = Annotated[PageProcess, of_app("page_process")]
HubDep = Annotated[Hub, of_app("hub")]
JobsDep = Annotated[Jobs, of_app("jobs")]
MeasuringDep = Annotated[Measuring, of_app("measuring")]
MetricsDep = Annotated[Metrics, of_app("metrics")]
UploadMemoryDep = Annotated[UploadMemory, of_app("upload_memory")]
MeasuringQueueDep = Annotated[MeasuringQueue, of_app("measuring_queue")]
HealthDep = Annotated[HealthWatch, of_app("health")]
KernelsDep = Annotated[KernelCompiler, of_app("kernels")]
WebhooksDep = Annotated[WebhookSender, of_app("webhooks")]
IntakeDep = Annotated[Intake, of_app("intake")]

SessionId = Annotated[str, Path(description="A session's `id`.", max_length=64, examples=["4c1f0a92e6b37d58"])]
CaptureId = Annotated[str, Path(description="A capture's `id`.", max_length=64, examples=["p01"])]
JobId = Annotated[str, Path(description="A job's `id`.", max_length=64, examples=["a07be1d35c29f846"])]
StageName = Annotated[
    str, Path(description="A stage's `name`, as `GET /stages` lists them.", max_length=64, examples=["tcp"])
]


def existing_session(session_id: SessionId, store: StoreDep) -> str:
    """Return the id of a session that is there; raises NotFoundError."""
    with store.read() as db:
        return session_row(db, session_id).id


def _loaded_session(session_id: SessionId, store: StoreDep) -> StoredSession:
    with store.read() as db:
        return load_session(db, store.blobs, session_id)


ExistingSession = Annotated[str, Depends(existing_session)]
"""The id of a session that is there: also before a stream about it begins."""
LoadedSession = Annotated[StoredSession, Depends(_loaded_session)]
IfMatch = Annotated[
    str | None,
    AfterValidator(tags_without_language),
    Header(max_length=200, description="The ETag that the change was made against; else 412."),
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
