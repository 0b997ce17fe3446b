"""Robot programs: the port that listens for them, and the same dialogue over HTTP."""

from typing import Annotated, Any

from fastapi import Request, Response
from pydantic import BaseModel

from calib_core.errors import TooLargeError
from calib_core.records.strict_fields import require_known_fields
from server.http.api_router import API, api_router, of_app
from server.http.openapi import BYTES
from server.live.dialogue import LONGEST_MESSAGE
from server.live.robot_port import RobotPorts, RobotPortSettings, acting_now
from server.routes.dependencies import ExistingSession

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


RobotPortsDep = Annotated[RobotPorts, of_app("robot_ports")]


@router.get("/robot-port", response_model=RobotPort)
def get_port(session_id: ExistingSession, ports: RobotPortsDep) -> dict[str, Any]:
    """Return the session's port for robot programs."""
    return ports.told(session_id)


@router.put("/robot-port", response_model=RobotPort)
async def open_port(session_id: ExistingSession, body: RobotPortSettings, ports: RobotPortsDep) -> dict[str, Any]:
    """Open a plain TCP port for robot programs; each sends a token of the role `capture` in its first line.

    Only the session's captures can be added over it.  It is closed after a restart of the server.
    """
    require_known_fields(body, "request")
    await ports.open(session_id, body)
    return ports.told(session_id)


@router.delete("/robot-port", status_code=204)
async def close_port(session_id: ExistingSession, ports: RobotPortsDep) -> None:
    """Close the session's port for robot programs."""
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
                "application/octet-stream": {"schema": BYTES, "example": _POSE},
            }
        }
    },
)
async def say(session_id: ExistingSession, request: Request, ports: RobotPortsDep) -> Response:
    """Take one line or XML element of a robot's program and answer with one, as its TCP port does."""
    body = await request.body()
    if len(body) > LONGEST_MESSAGE:
        need = "at most {max_bytes} bytes"
        raise TooLargeError(need, f"{len(body)}", "Send one at a time.", "request", max_bytes=LONGEST_MESSAGE)
    act = acting_now(request.client.host if request.client else "")
    answer, xml = await ports.answer(session_id, body.decode("ascii", errors="replace"), act)
    return Response(answer.to_bytes(xml), media_type="application/xml" if xml else "text/plain")
