"""Addresses of the scenes: viser's page, its WebSocket at the same place, the legend and the picked capture."""

from typing import Annotated
from zlib import crc32

from fastapi import Path, Request, Response, WebSocket
from fastapi.responses import HTMLResponse, RedirectResponse
from fastapi.routing import APIRoute
from pydantic import BaseModel, Field

from server.http.api_router import api_router, of_app
from server.scenes.bridge import bridge
from server.scenes.manager import SceneManager
from server.scenes.page import client_page, content_security_policy, page_tag
from server.scenes.review_scenes import PastScenes

scenes_router = api_router("scenes", "/scenes", APIRoute)

SessionId = Annotated[str, Path(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", examples=["4c1f0a92e6b37d58"])]


Scenes = Annotated[SceneManager, of_app("scenes")]
Past = Annotated[PastScenes, of_app("past_scenes")]


class Highlight(BaseModel):
    """The capture to light up; null lights up none."""

    capture: str | None = Field(default=None, examples=["p01"])


@scenes_router.get("/{session}", include_in_schema=False)
def scene_address(session: SessionId, request: Request) -> RedirectResponse:
    """Send a browser to the address with its slash, on which the client's relative addresses rely."""
    query = f"?{request.url.query}" if request.url.query else ""
    return RedirectResponse(f"{request.url.path}/{query}")


@scenes_router.get("/{session}/", response_class=HTMLResponse, summary="The 3-D scene of a session")
def scene_page(session: SessionId, scenes: Scenes, request: Request) -> Response:
    """Return the page that draws the session's scene, live. `?theme=dark` or `?theme=light` sets its theme."""
    scenes.require(session)
    return client_answer(request)


@scenes_router.get("/{session}/picture", response_class=Response, summary="A small picture of a session")
def session_picture(session: SessionId, scenes: Scenes) -> Response:
    """Return the session's picture for a list, as SVG. Ask with `?v=…` of your own to have a new one drawn."""
    headers = {"Cache-Control": "private, max-age=86400"}
    return Response(scenes.picture(session), media_type="image/svg+xml", headers=headers)


@scenes_router.get("/{session}/legend", response_class=HTMLResponse, summary="The legend of a live scene")
def scene_legend(session: SessionId, scenes: Scenes, request: Request) -> Response:
    """Return the legend as a piece of HTML; empty while nobody looks at the scene."""
    return legend_answer(scenes.legend(session), request)


def legend_answer(legend: str, request: Request) -> Response:
    """Return a legend, or that the browser has it already."""
    return _tagged(legend, f'"{crc32(legend.encode()):08x}"', request)


@scenes_router.post("/{session}/highlight", status_code=204, summary="Light up one capture in the scene")
def highlight(session: SessionId, body: Highlight, scenes: Scenes) -> None:
    """Light up a capture in the scenes of everybody who looks at this session; null ends it."""
    scenes.highlight(session, body.capture)


@scenes_router.websocket("/{session}")
@scenes_router.websocket("/{session}/")
async def scene_socket(websocket: WebSocket, session: str, scenes: Scenes) -> None:
    """Carry the scene's messages between a viewer and the session's viser server."""
    await bridge(websocket, scenes, session)


def client_answer(request: Request) -> Response:
    """Return the page that draws scenes, or that the browser has it already: it is the same for all of them."""
    return _tagged(client_page(), page_tag(), request, content_security_policy())


def _tagged(page: str, tag: str, request: Request, policy: str | None = None) -> Response:
    """Return a page, or that the browser has it already."""
    headers = {"ETag": tag, "Cache-Control": "no-cache"}
    if policy is not None:
        headers["Content-Security-Policy"] = policy
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers=headers)
    return HTMLResponse(page, headers=headers)
