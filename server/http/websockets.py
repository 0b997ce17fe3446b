"""WebSockets of pages: only this server's own may open one."""

from fastapi import Response, WebSocket

from server.http.same_origin import is_same_origin


async def deny(websocket: WebSocket, status: int, sentence: str) -> None:
    """Refuse the handshake with an HTTP answer that says why."""
    await websocket.send_denial_response(Response(sentence, status_code=status, media_type="text/plain"))


async def is_foreign(websocket: WebSocket, sentence: str) -> bool:
    """Refuse a WebSocket that a page of another server opens; returns whether it is one."""
    foreign = not is_same_origin(websocket.headers.get("origin"), websocket.headers.get("host"))
    if foreign:
        await deny(websocket, 403, sentence)
    return foreign
