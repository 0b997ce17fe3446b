"""Addresses by which a page controls the scene that stands in it: views, layers, turning, pictures, the past."""

from typing import Annotated

from fastapi import Path, Query, Request, Response, WebSocket
from fastapi.responses import HTMLResponse, StreamingResponse
from fastapi.routing import APIRoute
from pydantic import BaseModel, Field

from calib_core.errors import InputError, NotFoundError
from calib_core.records import StageName
from server.http.api_router import api_router
from server.scenes.bridge import bridge
from server.scenes.layers import LAYERS
from server.scenes.live import LiveScene
from server.scenes.manager import SceneManager
from server.scenes.router import Past, Scenes, SessionId, client_answer, legend_answer
from server.scenes.step_views import Side
from server.scenes.views import VIEWS

controls_router = api_router("scenes", "/scenes/{session}", APIRoute)

Viewer = Annotated[
    str,
    Path(pattern=r"^[A-Za-z0-9]{8,64}$", description="A name that the page gives itself.", examples=["page4711"]),
]
Pixels = Annotated[int, Query(ge=64, le=4096)]


class LayerShown(BaseModel):
    """A layer of the scene: its name, its words for people, and whether it is shown."""

    name: str
    title: str
    shown: bool


class SceneControls(BaseModel):
    """What can be set in a scene; layers are those of everybody who looks."""

    views: list[str]
    layers: list[LayerShown]


class LayerChange(BaseModel):
    """A layer to show or to hide."""

    name: str = Field(max_length=40, examples=["frames"])
    shown: bool = Field(examples=[False])


class ViewChange(BaseModel):
    """A view to take; `if_open` asks for it only where that page looks at the scene already."""

    view: str = Field(max_length=40, examples=["Top"])
    if_open: bool = False


class StoryChange(BaseModel):
    """The step whose story is told, and whether at its captures or at its result."""

    step: str = Field(max_length=40, examples=["tcp"])
    side: Side = "measure"


class StoryShown(BaseModel):
    """The view that was taken, and each layer: whether it belongs to the story; `open` where somebody looks."""

    open: bool
    view: str
    layers: dict[str, bool]
    subject: list[str]


class Turn(BaseModel):
    """The capture at which the cell is shown; null shows all captures."""

    capture: str | None = Field(default=None, examples=["t01"])


class TwoResults(BaseModel):
    """Two results of a stage, each SESSION or SESSION:NUMBER as in the comparison."""

    stage: StageName = Field(examples=["tcp"])
    left: str = Field(max_length=100, examples=["4c1f0a92e6b37d58:3"])
    right: str = Field(max_length=100, examples=["4c1f0a92e6b37d58:5"])


class MomentChange(BaseModel):
    """A place on the session's time line."""

    place: int = Field(ge=0, lt=2**31, examples=[3])


@controls_router.get("/controls", response_model=SceneControls, summary="What can be set in a scene")
def controls(session: SessionId, scenes: Scenes) -> SceneControls:
    """Return the views and layers that there is something of now; all of them where nobody looks."""
    scenes.require(session)
    live = scenes.live(session)
    shown = live.layers if live else {}
    drawn = live.drawn_layers if live else LAYERS.keys()
    layers = [
        LayerShown(name=name, title=title, shown=shown.get(name, True))
        for name, (title, _) in LAYERS.items()
        if name in drawn
    ]
    return SceneControls(views=live.views if live else list(VIEWS), layers=layers)


@controls_router.post("/layers", status_code=204, summary="Show or hide a layer of the scene")
def show_layer(session: SessionId, body: LayerChange, scenes: Scenes) -> None:
    """Show or hide a layer for everybody who looks at this scene."""
    if body.name not in LAYERS:
        raise InputError.unknown(body.name, LAYERS, "name")
    _live(scenes, session).show_layer(body.name, body.shown)


@controls_router.post("/turn", status_code=204, summary="Turn the cell to a capture")
def turn(session: SessionId, body: Turn, scenes: Scenes) -> None:
    """Show the cell as it stood at a capture, for everybody who looks; null shows all captures."""
    _live(scenes, session).turn_to_capture(body.capture)


@controls_router.post("/moment", status_code=204, summary="Move a scene of the past along the time line")
def go_to_moment(session: SessionId, body: MomentChange, scenes: Scenes, past: Past) -> None:
    """Let a page's own scene (SESSION.NAME) show the session as it stood at a place of its time line."""
    past.go(session, body.place)
    scenes.refresh(session)


@controls_router.post("/compared", status_code=204, summary="Show two answers in one scene")
def show_both(session: SessionId, body: TwoResults, scenes: Scenes, past: Past) -> None:
    """Let a page's own scene (SESSION.NAME) show two results of a stage, the first as SESSION has it."""
    past.compare(session, body.stage, body.left, body.right)
    scenes.refresh(session)


@controls_router.get("/page", response_class=StreamingResponse, summary="The scene as one HTML file")
def offline(session: SessionId, scenes: Scenes) -> Response:
    """Return the scene as one HTML file that needs no server and no net."""
    from server.scenes.offline import scene_html

    headers = {"Content-Disposition": f'attachment; filename="scene-{session}.html"'}
    return Response(scene_html(scenes.load(session)), media_type="text/html; charset=utf-8", headers=headers)


@controls_router.get("/viewers/{viewer}/", response_class=HTMLResponse, summary="The scene within a named page")
def viewer_page(session: SessionId, viewer: Viewer, scenes: Scenes, request: Request) -> Response:
    """Return the page that draws the scene for one viewer, whose camera and picture can then be asked for."""
    scenes.require(session)
    return client_answer(request)


@controls_router.websocket("/viewers/{viewer}")
@controls_router.websocket("/viewers/{viewer}/")
async def viewer_socket(websocket: WebSocket, session: str, viewer: str, scenes: Scenes) -> None:
    """Carry the scene's messages between one viewer and the session's viser server."""
    await bridge(websocket, scenes, session, viewer if viewer.isalnum() and viewer.isascii() else "")


@controls_router.post("/viewers/{viewer}/view", status_code=204, summary="Move one viewer's camera")
def take_view(session: SessionId, viewer: Viewer, body: ViewChange, scenes: Scenes) -> None:
    """Move the camera of one viewer to a view; nobody else's."""
    if body.view not in VIEWS:
        raise InputError.unknown(body.view, VIEWS, "view")
    try:
        _live(scenes, session).move(viewer, body.view)
    except NotFoundError:
        if not body.if_open:
            raise


@controls_router.post(
    "/viewers/{viewer}/story", response_model=StoryShown, summary="Tell one viewer the story of a step"
)
def tell_story(session: SessionId, viewer: Viewer, body: StoryChange, scenes: Scenes) -> StoryShown:
    """Move one viewer's camera to what a step is about, and say which layers tell it; nobody else's changes."""
    scenes.require(session)
    live = scenes.live(session)
    if live is None:
        return StoryShown(open=False, view="", layers={}, subject=[])
    told = live.tell(viewer, _shown_by(body.step), body.side)
    return StoryShown(
        open=True,
        view=told.view,
        layers={name: name in told.layers for name in LAYERS},
        subject=sorted(told.subject),
    )


@controls_router.get(
    "/viewers/{viewer}/legend", response_class=HTMLResponse, summary="The legend of what one viewer sees"
)
def viewer_legend(session: SessionId, viewer: Viewer, scenes: Scenes, request: Request) -> Response:
    """Return the legend of a viewer's story as a piece of HTML; empty while nobody looks at the scene."""
    live = scenes.live(session)
    return legend_answer(live.legend_of(viewer) if live else "", request)


@controls_router.get("/viewers/{viewer}/picture", response_class=Response, summary="What one viewer sees, as PNG")
def viewer_picture(
    session: SessionId, viewer: Viewer, scenes: Scenes, width: Pixels = 1280, height: Pixels = 800
) -> Response:
    """Return what one viewer sees, drawn by that viewer's browser in this size, on a transparent ground."""
    import cv2
    import numpy as np

    pixels = _live(scenes, session).viewers.picture(viewer, width, height)
    colors = np.ascontiguousarray(pixels[..., [2, 1, 0, 3]])
    headers = {"Content-Disposition": f'attachment; filename="scene-{session}.png"', "Cache-Control": "no-store"}
    return Response(cv2.imencode(".png", colors)[1].tobytes(), media_type="image/png", headers=headers)


def _shown_by(step: str) -> str:
    """Return what the captures of a step, or of the stage of this name, show; else the sphere."""
    from calib_core.graph.registry import stages
    from calib_core.steps import table_stages

    for stage in stages():
        if step in (stage.name, *stage.guided) and stage.step is not None:
            return stage.step.shows
    if step in table_stages():
        return "sphere-on-table"
    return "answers" if step == "compared" else "sphere"


def _live(scenes: SceneManager, session: str) -> LiveScene:
    live = scenes.live(session)
    if live is None:
        raise NotFoundError("a scene that somebody looks at", f"'{session}'", "Open the scene first.", "session")
    return live
