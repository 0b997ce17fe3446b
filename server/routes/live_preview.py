"""What a page sees of a live cell, over a WebSocket: it asks for the next preview when it has drawn the last.

So a slow page or line misses previews and never falls behind, and captures do not wait for it.
"""

import asyncio
import json

from fastapi import APIRouter, WebSocket
from starlette.concurrency import run_in_threadpool
from starlette.websockets import WebSocketDisconnect

from calib_core.errors import NotFoundError
from server.http.api_router import API
from server.http.websockets import deny, is_foreign
from server.live.live_cell import LiveCell
from server.live.manager import LiveCells
from server.live.pictures import preview_jpeg
from server.live.preview import live_data
from server.routes.dependencies import existing_session

router = APIRouter(prefix=API)

_LOOK_EVERY_S = 0.01
_QUIET_S = 0.5


@router.websocket("/sessions/{session_id}/live/preview")
async def live_preview(websocket: WebSocket, session_id: str) -> None:
    """Answer each text with the newest preview: a JSON text, and its image as JPEG where `image` is true."""
    if await is_foreign(websocket, "Previews are shown on pages of this server."):
        return
    cells: LiveCells = websocket.app.state.live
    try:
        await run_in_threadpool(existing_session, session_id, websocket.app.state.store)
    except NotFoundError as error:
        await deny(websocket, 404, str(error))
        return
    await websocket.accept()
    seen: object = None
    try:
        while True:
            await websocket.receive_text()
            seen = await _changed(cells, session_id, seen)
            text, jpeg = await run_in_threadpool(_preview, cells.live(session_id))
            await websocket.send_text(text)
            if jpeg is not None:
                await websocket.send_bytes(jpeg)
    except (WebSocketDisconnect, RuntimeError):  # the page went away while something was being sent
        return


async def _changed(cells: LiveCells, session_id: str, seen: object) -> object:
    """Wait until there is something newer than what was seen, half a second at most; return what is newest."""
    waited_s = 0.0
    while True:
        live = cells.live(session_id)
        now = live.state if live else None
        if now != seen or waited_s >= _QUIET_S:
            return now
        await asyncio.sleep(_LOOK_EVERY_S)
        waited_s += _LOOK_EVERY_S


def _preview(live: LiveCell | None) -> tuple[str, bytes | None]:
    newest = live.newest() if live else None
    told = live_data(live, newest)
    picture = newest[2].picture if newest and newest[2] else None
    jpeg = None if picture is None else preview_jpeg(picture)
    return json.dumps({**told, "image": jpeg is not None}, allow_nan=False), jpeg
