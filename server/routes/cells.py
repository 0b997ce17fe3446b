"""Cells: their sessions, and the answer that was released for each, by whom, when and why."""

import json
from collections.abc import Sequence
from typing import Annotated, Literal
from urllib.parse import quote

from fastapi import Path, Request, Response
from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, Field
from sqlalchemy.orm import Session as Transaction

from calib_core.records import Record, Verdict
from calib_core.records.faults import MOST_TEXT, allowed_faults, refuse_faults
from calib_core.records.policy import Policy
from calib_core.records.strict_fields import require_known_fields
from calib_core.review.answer import SessionAnswer
from calib_core.review.drift import CellDrift
from server.http.api_router import api_router
from server.http.created import created
from server.http.strict_json import plain_json
from server.routes.dependencies import IdempotencyDep, SessionId, StoreDep
from server.store.database import Store
from server.store.models import Data
from server.store.releases import (
    add_release,
    cell_history,
    cell_sessions,
    earlier_release,
    list_cells,
    release_data,
    released,
    roll_back,
)
from server.store.session_answer import headers_of, session_answer
from server.store.sessions import load_session
from server.store.standing import (
    acknowledge,
    acknowledgements,
    policy_of,
    released_faults,
    require_four_eyes,
    set_policy,
    with_moment,
)

router = api_router("cells")

CellId = Annotated[str, Path(description="A cell's `id`.", max_length=64, examples=["cell-4"])]


class Release(BaseModel):
    """An answer that was put in force for a cell: which, by whom, when and why; `why` is empty where nobody said.

    `solved` and `inputs_sha256` tell it from others of the session; `workpiece_sigma_mm` is null of those
    released before it was kept. `in_spite_of` are the faults that were allowed. `signed` is false where it is not
    as it was stored here.
    """

    number: int
    cell: str
    session: str
    action: Literal["release", "rollback"]
    who: str
    why: str
    created: str
    verdict: Verdict
    solved: str | None
    inputs_sha256: dict[str, str]
    workpiece_sigma_mm: float | None
    in_spite_of: list[str]
    signed: bool


class CellSummary(BaseModel):
    """A cell in the list; `released` is what is in force."""

    id: str
    sessions: int
    newest_session: str | None
    newest_created: str | None
    released: Release | None


class Cells(BaseModel):
    """All cells, by id."""

    items: list[CellSummary]


class CellSession(BaseModel):
    """A session of a cell."""

    id: str
    name: str
    created: str


class ReleaseRequest(Record):
    """Why an answer is released; `allow` names the faults in spite of which, with commas between."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"why": "after the crash of Monday"}]})

    why: str = Field(default="", max_length=1000)
    allow: str = Field(default="", max_length=MOST_TEXT)


class Acknowledgement(Record):
    """A fault of the moment, `drift` or `equipment-changed`, and why it needs nothing more."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"fault": "drift", "why": "the scanner was remounted on Monday"}]}
    )

    fault: str = Field(max_length=40)
    why: str = Field(default="", max_length=1000)


class Acknowledged(BaseModel):
    """What was acknowledged: `of` are the sessions with which the cell changed, or the changes of equipment."""

    number: int
    cell: str
    fault: str
    of: list[str]
    who: str
    why: str
    created: str


class CellHistory(BaseModel):
    """A cell's sessions and releases, and who acknowledged what, the newest first."""

    id: str
    sessions: list[CellSession]
    releases: list[Release]
    acknowledged: list[Acknowledged]


class Rollback(Record):
    """Why an earlier release is put in force again, and its number; left out, the one before."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"why": "the new tool scans off"}]})

    why: str = Field(default="", max_length=1000)
    number: int | None = Field(default=None, ge=1, lt=2**31)
    allow: str = Field(default="", max_length=MOST_TEXT)


@router.get("/cells", response_model=Cells)
def get_cells(store: StoreDep) -> Response:
    """List the cells: by `cell.id`, or an id made from the session's name where it has none."""
    with store.read() as db:
        return JSONResponse({"items": list_cells(db)})


@router.get("/cells/{cell_id}/history", response_model=CellHistory)
def get_history(cell_id: CellId, store: StoreDep) -> Response:
    """Return a cell's sessions and releases, and who acknowledged what, the newest first."""
    with store.read() as db:
        return JSONResponse({**cell_history(db, cell_id), "acknowledged": acknowledgements(db, cell_id)})


@router.get("/cells/{cell_id}/drift", response_model=CellDrift)
def get_drift(cell_id: CellId, store: StoreDep) -> CellDrift:
    """Return how tool, axis and verification moved over the cell's newest 100 sessions, and what changed."""
    from calib_core.review.drift import cell_drift

    with store.read() as db:
        sessions = cell_sessions(db, cell_id)
    return cell_drift(sessions)


@router.get("/cells/{cell_id}/answer", response_model=SessionAnswer)
def get_released(cell_id: CellId, store: StoreDep) -> Response:
    """Return the answer that was released last for a cell, as it was then, with what speaks against it now."""
    from calib_core.findings import judgement
    from calib_core.findings.codes.faults import FAULT_CODES

    with store.read() as db:
        row = released(db, cell_id)
        answer, number = row.answer, row.number
        faults = released_faults(db, row)
    headers = {**headers_of(answer["verdict"], answer["stale"], faults), "ETag": _tag(number, faults, answer)}
    told = {name: value for name, value in answer.items() if name != "seal"}
    since = judgement(FAULT_CODES[name]() for name in faults if name not in answer["faults"])["findings"]
    findings = [*(one.to_json() for one in since), *answer.get("findings", [])]
    return JSONResponse({**told, "faults": list(faults), "findings": findings}, headers=headers)


@router.get("/cells/{cell_id}/policy", response_model=Policy, response_model_exclude_unset=True)
def get_policy(cell_id: CellId, store: StoreDep) -> Policy:
    """Return what the cell asks for before an answer is released."""
    with store.read() as db:
        return policy_of(db, cell_id)


@router.put("/cells/{cell_id}/policy", response_model=Policy, response_model_exclude_unset=True)
def put_policy(cell_id: CellId, body: Policy, store: StoreDep) -> Policy:
    """Set what the cell asks for before an answer is released; the audit log keeps what it was before."""
    require_known_fields(body, "request")
    with store.write() as db:
        set_policy(db, cell_id, body)
    return body


@router.post("/cells/{cell_id}/acknowledge", response_model=Acknowledged)
def acknowledge_fault(
    cell_id: CellId, body: Acknowledgement, request: Request, idempotency: IdempotencyDep, store: StoreDep
) -> Response:
    """End `drift` or `equipment-changed` of a cell as it stands now, by name and with a reason."""
    require_known_fields(body, "request")

    def act(db: Transaction) -> Data:
        return acknowledge(db, cell_id, body.fault, _who(request), body.why.strip())

    return idempotency.run(store, body.to_json(), 200, act)[0]


@router.post("/sessions/{session_id}/release", status_code=201, response_model=Release)
def release(
    session_id: SessionId, body: ReleaseRequest, request: Request, idempotency: IdempotencyDep, store: StoreDep
) -> Response:
    """Put the session's answer in force for its cell; one with faults is refused unless they are allowed."""
    from calib_core.review.answer import answer_record

    require_known_fields(body, "request")
    allowed = allowed_faults(body.allow)

    def act(db: Transaction) -> Data:
        answer = session_answer(db, load_session(db, store.blobs, session_id))
        record = plain_json(answer_record(answer).to_json())
        faults = with_moment(db, answer, session_id).all_faults
        refuse_faults(faults, allowed, answer.stage)
        require_four_eyes(db, record["cell"], session_id, _who(request))
        return release_data(add_release(db, session_id, record, _who(request), body.why.strip(), faults))

    return _in_force(store, idempotency.run(store, body.to_json(), 201, act)[0])


@router.post("/cells/{cell_id}/rollback", status_code=201, response_model=Release)
def rollback(
    cell_id: CellId, body: Rollback, request: Request, idempotency: IdempotencyDep, store: StoreDep
) -> Response:
    """Put an earlier release of a cell in force again; one with faults is refused unless they are allowed."""
    require_known_fields(body, "request")
    allowed = allowed_faults(body.allow)

    def act(db: Transaction) -> Data:
        earlier = earlier_release(db, cell_id, body.number)
        faults = released_faults(db, earlier, earlier.session_id)
        refuse_faults(faults, allowed, cell_id)
        require_four_eyes(db, cell_id, earlier.session_id, _who(request))
        return release_data(roll_back(db, earlier, _who(request), body.why.strip(), faults))

    return _in_force(store, idempotency.run(store, body.to_json(), 201, act)[0])


def _in_force(store: Store, answer: Response) -> Response:
    """Return the answer with the place and the tag of what it put in force."""
    release = json.loads(bytes(answer.body))
    cell = release["cell"]
    with store.read() as db:
        row = released(db, cell)
        tag = _tag(row.number, released_faults(db, row), row.answer)
    return created(answer, f"/api/v1/cells/{quote(cell, safe='')}/answer", tag)


def _tag(number: int, faults: Sequence[str], answer: Data) -> str:
    """Return the entity tag of what is in force: its number, and the faults of the moment."""
    return f'"{".".join([str(number), *(name for name in faults if name not in answer["faults"])])}"'


def _who(request: Request) -> str:
    return request.state.identity.name
