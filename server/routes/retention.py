"""Sessions that need not be kept any longer, told and not removed: by age, and beyond a cell's quota."""

from dataclasses import asdict
from typing import Annotated, Literal

from fastapi import Query, Response
from fastapi.responses import JSONResponse
from pydantic import BaseModel

from server.http.api_router import api_router
from server.routes.dependencies import StoreDep
from server.store.retention import require_limits, sessions_beyond

router = api_router("cells")

_MEGABYTE = 1_000_000


class OldSession(BaseModel):
    """A session that may go: how many bytes its files take, when it was changed last, and why it may."""

    id: str
    name: str
    cell: str
    updated: str
    revision: int
    size: int
    why: Literal["age", "quota"]


class OldSessions(BaseModel):
    """What may go, the oldest first."""

    items: list[OldSession]


Days = Annotated[float | None, Query(description="Sessions that nobody has changed for so long.", examples=[365])]
QuotaMb = Annotated[
    float | None,
    Query(
        description="The oldest of each cell, until the files of the others need no more than this.",
        examples=[20000],
    ),
]
OfCell = Annotated[str | None, Query(description="Of this cell alone.", max_length=64, examples=["cell-4"])]


@router.get("/retention", response_model=OldSessions)
def list_old(store: StoreDep, days: Days = None, quota_mb: QuotaMb = None, cell: OfCell = None) -> Response:
    """List the sessions that a rule lets go; nothing is removed, and the answers in force stay.

    Remove one with DELETE and its revision in `If-Match`: it stays where it was changed meanwhile.
    """
    require_limits({"days": days, "quota_mb": quota_mb})
    with store.read() as db:
        found = sessions_beyond(db, days, cell, None if quota_mb is None else round(quota_mb * _MEGABYTE))
    return JSONResponse({"items": [asdict(one) for one in found]})
