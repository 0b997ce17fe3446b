"""The address by which a page sets how the merged cloud is shown: colours, a section, what it is compared with."""

from typing import Literal

from fastapi.routing import APIRoute
from pydantic import BaseModel, Field

from server.http.api_router import api_router
from server.scenes.cloud_view import Against, CloudColors, CloudView, Section
from server.scenes.router import Scenes, SessionId

cloud_router = api_router("scenes", "/scenes/{session}", APIRoute)


class CloudSectionShown(BaseModel):
    """A plane across an axis of the cloud's frame; what lies on its other side is hidden."""

    axis: Literal["x", "y", "z"] = Field(examples=["z"])
    at_mm: float = Field(allow_inf_nan=False, examples=[25.0])
    keep: Literal["below", "above"] = "below"


class CloudShown(BaseModel):
    """How the merged cloud is shown to all who look."""

    colors: Literal["height", "scan", "deviation"] = Field(default="height", examples=["deviation"])
    section: CloudSectionShown | None = None
    against: Literal["mesh", "sphere"] = "mesh"
    diameter_mm: float | None = Field(default=None, gt=0, le=10_000)


_COLORS: dict[str, CloudColors] = {"height": "by height", "scan": "by scan", "deviation": "by deviation"}


@cloud_router.post("/cloud", status_code=204, summary="How the merged cloud is shown")
def show_cloud(session: SessionId, body: CloudShown, scenes: Scenes) -> None:
    """Colour the merged cloud, and cut it open; nothing happens where nobody looks."""
    section = body.section and Section(body.section.axis, body.section.at_mm, body.section.keep)
    view = CloudView(_COLORS[body.colors], section, Against(body.against, body.diameter_mm))
    scenes.show_cloud(session, view)
