"""Robot programs: the port that listens for them, and the same dialogue over HTTP."""

from typing import Annotated, Any

from fastapi import Depends, Request, Response
from pydantic import BaseModel
from starlette.concurrency import run_in_threadpool

from calib_core.errors import TooLargeError
from calib_core.records.known_fields import require_known_fields
from server.http.api_router import API, api_router
from server.http.dependencies import SessionId, StoreDep
from server.live.dialogue import LONGEST_MESSAGE
from server.live.robot_port import RobotPorts, RobotPortSettings, acting_now
from server.routes.sessions import existing_session

router = api_router("live", f"{API}/sessions/{{session_id}}")
_POSE = "p07 -195.8 1363.305 524.812 -179.924 0.889 179.635"


class RobotLine(BaseModel):
    """A line of the dialogue with a robot's program."""

    at: str
    peer: str
    heard: str
    said: str


class RobotPort(BaseModel):
    """The port of a session: where it listens, who may come, who is connected, and the newest lines."""

    open: bool
    host: str | None
    port: int | None
    allowed: list[str]
    peers: list[str]
    lines: list[RobotLine]


async def _ports(request: Request) -> RobotPorts:
    return request.app.state.robot_ports


RobotPortsDep = Annotated[RobotPorts, Depends(_ports)]


@router.get("/robot-port", response_model=RobotPort)
def get_port(session_id: SessionId, store: StoreDep, ports: RobotPortsDep) -> dict[str, Any]:
    """Return the session's port for robot programs."""
    existing_session(session_id, store)
    return ports.told(session_id)


@router.put("/robot-port", response_model=RobotPort)
async def open_port(
    session_id: SessionId, body: RobotPortSettings, store: StoreDep, ports: RobotPortsDep
) -> dict[str, Any]:
    """Open a plain TCP port for robot programs; each sends a token of the role `capture` in its first line.

    Only the session's captures can be added over it.  It is closed after a restart of the server.
    """
    require_known_fields(body, "request")
    await run_in_threadpool(existing_session, session_id, store)
    await ports.open(session_id, body)
    return ports.told(session_id)


@router.delete("/robot-port", status_code=204)
async def close_port(session_id: SessionId, store: StoreDep, ports: RobotPortsDep) -> None:
    """Close the session's port for robot programs."""
    await run_in_threadpool(existing_session, session_id, store)
    await ports.close(session_id)


@router.post(
    "/robot",
    response_class=Response,
    responses={
        200: {"description": "`OK …` or `NO …`", "content": {"text/plain": {"example": "OK p07 good 0.71"}}}
    },
    openapi_extra={
        "requestBody": {
            "content": {
                "text/plain": {"schema": {"type": "string"}, "example": _POSE},
                "application/octet-stream": {"schema": {"type": "string", "format": "binary"}, "example": _POSE},
            }
        }
    },
)
async def say(session_id: SessionId, request: Request, store: StoreDep, ports: RobotPortsDep) -> Response:
    """Take one line or XML element of a robot's program and answer with one, as its TCP port does."""
    await run_in_threadpool(existing_session, session_id, store)
    body = await request.body()
    if len(body) > LONGEST_MESSAGE:
        raise TooLargeError(f"at most {LONGEST_MESSAGE} bytes", f"{len(body)}", "Send one line.", "request")
    act = acting_now(request.client.host if request.client else "")
    answer, xml = await ports.answer(session_id, body.decode("ascii", errors="replace"), act)
    return Response(answer.to_bytes(xml), media_type="application/xml" if xml else "text/plain")
