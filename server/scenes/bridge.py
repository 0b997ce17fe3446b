"""The WebSocket between a browser and a session's viser server, with what viser does not do: who may, and what."""

import asyncio
from typing import Any

import anyio
import msgspec
from fastapi import WebSocket
from starlette.websockets import WebSocketDisconnect, WebSocketState
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from calib_core.errors import NotFoundError
from server.http.websockets import deny, is_foreign
from server.scenes.live import SECRET_HEADER, LiveScene
from server.scenes.manager import SceneManager
from server.scenes.viewers import VIEWER_HEADER

MAX_MESSAGE_BYTES = 1 << 20
"""The longest message a viewer may send: cameras and clicks, a few hundred bytes each."""

MAX_PICTURE_BYTES = 32 << 20
"""The same of a picture of the scene that was asked for."""

ALLOWED_MESSAGES = frozenset(
    {
        "ViewerCameraMessage",
        "GuiUpdateMessage",
        "GuiButtonHoldMessage",
        "SceneNodeClickMessage",
        "ScenePointerMessage",
        "GetRenderResponseMessage",
        "CommandTriggerMessage",
    }
)
"""What a viewer may say; a request for a public share tunnel or an upload of files is none of it."""

POLICY_VIOLATION, TOO_BIG, INTERNAL = 1008, 1009, 1011


def refusal(message: bytes) -> tuple[int, str] | None:
    """Return the close code and reason for a message from a viewer that must not pass, None for one that may."""
    content = _content(message) if len(message) <= MAX_PICTURE_BYTES else None
    kind = content.get("type") if isinstance(content, dict) else None
    if len(message) > MAX_MESSAGE_BYTES and kind != "GetRenderResponseMessage":
        return TOO_BIG, f"A message may have {MAX_MESSAGE_BYTES} bytes."
    if content is None:
        return POLICY_VIOLATION, "Not a message of the scene's client."
    if kind not in ALLOWED_MESSAGES:
        return POLICY_VIOLATION, f"{str(kind)[:60]} is not allowed here."
    if kind == "GuiUpdateMessage" and set(content.get("updates", ())) - {"value"}:
        return POLICY_VIOLATION, "Only values of controls may change."
    return None


def _content(message: bytes) -> Any:
    try:
        return msgspec.msgpack.decode(message)
    except (msgspec.DecodeError, UnicodeDecodeError):
        return None


async def bridge(websocket: WebSocket, manager: SceneManager, session_id: str, viewer: str = "") -> None:
    """Serve one viewer of a session: check, open the scene, and carry messages both ways until one side ends.

    `viewer` is the name of the page that the scene stands in, where it has one.
    """
    if await is_foreign(websocket, "A scene is only shown on pages of this server."):
        return
    protocol = next((p for p in websocket.scope["subprotocols"] if p.startswith("viser-v")), None)
    if protocol is None:
        await deny(websocket, 400, "Offer the sub-protocol viser-v<version>, as the scene's page does.")
        return
    try:
        await anyio.to_thread.run_sync(manager.require, session_id)
    except NotFoundError as error:
        await deny(websocket, 404, str(error))
        return
    # Before the scene is opened, which may take long where the disk is slow: viser's client gives up what is not
    # accepted within 5 s, and from then on tries anew each second.
    try:
        await websocket.accept(subprotocol=protocol)
    except OSError:  # it went away meanwhile, and comes back by itself
        return
    viewing = manager.viewing(session_id)
    try:
        live = await anyio.to_thread.run_sync(viewing.__enter__)
    except NotFoundError:  # removed meanwhile
        await _close(websocket, 1001, "The scene is closed.")
        return
    try:
        await _carry(websocket, live, protocol, viewer)
    finally:
        viewing.__exit__(None, None, None)


async def _close(websocket: WebSocket, code: int, reason: str) -> None:
    if websocket.client_state is WebSocketState.CONNECTED:
        await websocket.close(code, reason)


async def _carry(websocket: WebSocket, live: LiveScene, protocol: str, viewer: str) -> None:
    try:
        inner = connect(
            f"ws://127.0.0.1:{live.port}",
            subprotocols=[Subprotocol(protocol)],
            additional_headers={SECRET_HEADER: live.secret, VIEWER_HEADER: viewer},
            compression=None,
            max_size=None,
            proxy=None,
        )
        async with inner as viser:
            code, reason = await _first_of(_to_viser(websocket, viser), _to_browser(viser, websocket))
    except (OSError, ConnectionClosed):
        code, reason = INTERNAL, "The scene is closed; it opens again by itself."
    await _close(websocket, code, reason)


async def _first_of(*carriers: Any) -> tuple[int, str]:
    """Run both directions until the first one ends; return why it did."""
    tasks = [asyncio.ensure_future(carrier) for carrier in carriers]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        return next(iter(done)).result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _to_viser(websocket: WebSocket, viser: ClientConnection) -> tuple[int, str]:
    while True:
        try:
            message = await websocket.receive_bytes()
        except (WebSocketDisconnect, KeyError):
            return 1000, ""
        refused = refusal(message)
        if refused:
            return refused
        try:
            await viser.send(message)
        except ConnectionClosed:
            return INTERNAL, "The scene is closed; it opens again by itself."


async def _to_browser(viser: ClientConnection, websocket: WebSocket) -> tuple[int, str]:
    try:
        async for message in viser:
            await websocket.send_bytes(message if isinstance(message, bytes) else message.encode())
    except (ConnectionClosed, WebSocketDisconnect):
        pass
    received = viser.close_code or 1000
    # 1002 is viser's word for a page of another version: it must reach the page, which then says so.
    return (received, viser.close_reason or "") if received == 1002 else (1001, "The scene is closed.")
