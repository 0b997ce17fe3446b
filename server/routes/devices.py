"""Live devices of a session's cell, what comes from them, and captures taken at standstill."""

import asyncio
import time
from collections.abc import AsyncIterator
from dataclasses import asdict
from typing import Annotated, Any, Literal

from fastapi import Path, Response
from fastapi.sse import EventSourceResponse, ServerSentEvent
from pydantic import BaseModel, ConfigDict, Field
from starlette.concurrency import run_in_threadpool

from calib_core.clock_offset import ClockOffset
from calib_core.errors import NotFoundError
from calib_core.messages import message
from calib_core.records import Finite, Identifier, Record
from calib_core.records.strict_fields import require_known_fields
from server.http.api_router import API, api_router, of_app
from server.live.live_captures import CaptureSettings, Shot, Taken
from server.live.manager import LiveCells, require_live
from server.live.preview import device_data, live_data
from server.routes.dependencies import ExistingSession, HubDep, IdempotencyDep, SessionId, StoreDep
from server.sources.device import host_now_s
from server.store.audit import acting

router = api_router("live", f"{API}/sessions/{{session_id}}")

DeviceName = Annotated[
    str, Path(description="A device's `name`.", pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", examples=["robot"])
]
_PREVIEW_EVERY_S = 0.05
_LEAST_DRIFT_S = 0.002


class DeviceRequest(Record):
    """A device: a live source of `GET /sources` and its settings; `connected` for this session, or only kept."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"source": "pose-lines", "settings": {"host": "127.0.0.1", "port": 5890}, "connected": True}
            ]
        }
    )

    source: str = Field(max_length=64)
    settings: dict[str, Any] = Field(default_factory=dict)
    connected: bool = True


class DeviceEntry(BaseModel):
    """A device of the cell; `status` is off where it is not connected for this session."""

    name: str
    source: str
    title: str
    delivers: list[str]
    settings: dict[str, Any] = Field(description="Without secrets.")
    secrets: list[str] = Field(description="The names of those that are kept.")
    connected_for: str | None = Field(description="The session that it is connected for.")
    status: Literal["off", "connecting", "live", "silent", "nonsense", "lost"]
    problem: str
    fresh: bool = Field(description="Whether what it tells is new; `why` says why not, or what else is odd.")
    why: str
    since: str | None
    readings: int
    refused: int
    rate_hz: float
    model: str
    can: list[str]


class Devices(BaseModel):
    """The devices of a session's cell, and what its live captures are taken for."""

    items: list[DeviceEntry]
    capture: CaptureSettings
    waits_for: str = Field(description="What a capture waits for.")


_WHY = Field(default="", max_length=1000, description="Kept with a capture that comes after a verification.")


class ShotRequest(Record):
    """A capture to be taken now, once robot, table and stripe prove that they stand; all may be left out."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"id": "p07"}]})

    id: Identifier | None = None
    pose: list[Finite] | None = Field(default=None, max_length=16)
    table_deg: Finite | None = None
    why: str = _WHY


class SweepRequest(Record):
    """A recording of some seconds; the robot's program moves meanwhile."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"seconds": 2.0}]})

    id: Identifier | None = None
    seconds: float = Field(ge=0.2, le=120.0)
    table_deg: Finite | None = None
    why: str = _WHY


class TakenShot(BaseModel):
    """A capture that was taken and stored."""

    id: str
    verdict: str
    zone: float | None = Field(description="r/R: the circle's radius by the sphere's.")
    text: str


class MeasuredClocks(BaseModel):
    """How much more the scanner's clock tells than the robot's; its standard deviation, and what that shifts."""

    offset_s: float
    sigma_s: float
    rms_mm: float
    exposures: int
    clocks: str = Field(description="Whose times these are: of the device, or of arrival.")
    shift_at_100_mm_s_mm: float
    warning: str = Field(description="Where it has drifted since it was last measured.")


LiveCellsDep = Annotated[LiveCells, of_app("live")]


@router.get("/devices", response_model=Devices)
def list_devices(session_id: SessionId, cells: LiveCellsDep) -> Devices:
    """List the devices of the session's cell with their states."""
    return _devices(session_id, cells)


@router.put("/devices/{device}", response_model=Devices)
def put_device(session_id: SessionId, device: DeviceName, body: DeviceRequest, cells: LiveCellsDep) -> Devices:
    """Keep a device with the cell and connect it for this session; `connected: false` ends its connection.

    Devices are read only: none of them moves anything.
    """
    require_known_fields(body, "request")
    cells.put(session_id, device, body.source, body.settings, body.connected)
    return _devices(session_id, cells)


@router.delete("/devices/{device}", status_code=204)
def delete_device(session_id: SessionId, device: DeviceName, cells: LiveCellsDep) -> None:
    """Forget a device of the cell, its settings and its secrets."""
    cells.remove(session_id, device)


@router.put("/live", response_model=CaptureSettings)
def put_live(session_id: ExistingSession, body: CaptureSettings, cells: LiveCellsDep) -> CaptureSettings:
    """Say what live captures are taken for, and whether one is taken at each standstill at a new place."""
    require_known_fields(body, "request")
    cells.set_capture(session_id, body)
    return body


@router.post("/live/capture", status_code=201, response_model=TakenShot)
async def take_shot(
    session_id: ExistingSession,
    body: ShotRequest,
    _: IdempotencyDep,
    store: StoreDep,
    cells: LiveCellsDep,
    response: Response,
) -> TakenShot:
    """Take a capture now: it is stored once robot, table and stripe prove that they stand still, else refused."""
    require_known_fields(body, "request")
    shot = await run_in_threadpool(_shot, session_id, body, store)
    require_live(cells, session_id).ask(shot)
    taken = await asyncio.wrap_future(shot.answer)
    return _taken(session_id, response, taken)


@router.post("/live/sweep", status_code=201, response_model=TakenShot)
def take_sweep(
    session_id: ExistingSession, body: SweepRequest, _: IdempotencyDep, cells: LiveCellsDep, response: Response
) -> TakenShot:
    """Record every exposure and the robot's poses for some seconds, and store them as one capture: a sweep.

    On the move the offset between the clocks must be known well enough for the speed; else it is refused.  The
    files are removed from the recording's folder once they are stored.
    """
    require_known_fields(body, "request")
    live = require_live(cells, session_id)
    shot = Shot(body.id, host_now_s(), extra=_told(body), act=acting.get())
    with cells.recording_folder() as folder:
        taken = live.sweep(shot, body.seconds, folder)
    return _taken(session_id, response, taken)


def _taken(session_id: str, response: Response, taken: Taken) -> TakenShot:
    response.headers["Location"] = f"/api/v1/sessions/{session_id}/captures/{taken.capture}"
    return TakenShot(id=taken.capture, verdict=taken.verdict, zone=taken.zone, text=taken.text)


@router.post("/live/clock-offset", response_model=MeasuredClocks)
def measure_clocks(session_id: ExistingSession, _: IdempotencyDep, cells: LiveCellsDep) -> MeasuredClocks:
    """Measure the offset between the scanner's and the robot's clocks from what has just come.

    Before, the robot moves back and forth for five seconds or more, its orientation held, the sphere in view.
    """
    live = require_live(cells, session_id)
    before = live.clocks.offset
    found, clocks = live.clock_offset()
    return MeasuredClocks(
        **asdict(found), clocks=clocks, shift_at_100_mm_s_mm=found.shift_mm(100.0), warning=_drift(before, found)
    )


@router.get("/live/picture", response_class=Response)
def picture(session_id: ExistingSession, cells: LiveCellsDep) -> Response:
    """Return the newest image of the session's camera as it came."""
    live = cells.live(session_id)
    exposure = live.newest()[2] if live else None
    ending = exposure.frame.name.rpartition(".")[2].lower() if exposure else ""
    media = {"png": "image/png", "jpg": "image/jpeg", "jpeg": "image/jpeg", "bmp": "image/bmp"}.get(ending)
    if exposure is None or media is None:
        to_do = "Connect one in the session's devices."
        raise NotFoundError("an image of a camera that is connected", "none", to_do, "devices")
    return Response(exposure.frame.content, media_type=media, headers={"Cache-Control": "no-store"})


@router.get("/live/events", response_class=EventSourceResponse)
async def live_events(
    session_id: ExistingSession, hub: HubDep, cells: LiveCellsDep
) -> AsyncIterator[ServerSentEvent]:
    """Stream the live cell, twenty times a second at most: `live` events of devices, pose, profile, arc and r/R.

    Who reads slowly misses previews, never captures.
    """
    before: Any = None
    told_s = 0.0
    while not hub.closed:
        live = cells.live(session_id)
        state = live.state if live else None
        now_s = host_now_s()
        if state != before or now_s - told_s > 0.5:
            before, told_s = state, now_s
            yield ServerSentEvent(event="live", data=await run_in_threadpool(live_data, live))
        await asyncio.sleep(_PREVIEW_EVERY_S)


def _drift(before: ClockOffset | None, now: ClockOffset) -> str:
    if before is None:
        return ""
    apart_s = abs(now.offset_s - before.offset_s)
    if apart_s <= max(_LEAST_DRIFT_S, 3 * (before.sigma_s**2 + now.sigma_s**2) ** 0.5):
        return ""
    return message(
        "The clocks have drifted by {drift_ms:.1f} ms since the offset was last measured.", drift_ms=apart_s * 1000
    )


def _shot(session_id: str, body: ShotRequest, store: StoreDep) -> Shot:
    from calib_core.robots import parse_pose
    from server.store.sessions import session_row

    pose = None
    if body.pose is not None:
        with store.read() as db:
            convention = session_row(db, session_id).record["cell"]["pose_convention"]
        pose = parse_pose(convention, body.pose)
    return Shot(body.id, host_now_s(), body.pose, pose, _told(body), act=acting.get())


def _told(body: ShotRequest | SweepRequest) -> dict[str, Any]:
    """Return what a request says of the capture itself."""
    told = {} if body.table_deg is None else {"table_deg": body.table_deg}
    return {**told, **({"added_because": {"why": body.why}} if body.why else {})}


def _devices(session_id: str, cells: LiveCells) -> Devices:
    now = time.time() - host_now_s()
    items = [device_data(*device, now) for device in cells.devices(session_id)]
    live = cells.live(session_id)
    told = {"capture": cells.capture_settings(session_id), "waits_for": live.waits_for if live else ""}
    return Devices.model_validate({"items": items, **told})
