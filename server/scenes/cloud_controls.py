"""The address by which a page sets how the merged cloud is shown: colours, a section, what it is compared with."""

from typing import Literal

from fastapi.routing import APIRoute
from pydantic import BaseModel, Field, FiniteFloat

from server.http.api_router import api_router
from server.scenes.cloud_view import Against, CloudColors, CloudView, section_of
from server.scenes.router import Scenes, SessionId

cloud_router = api_router("scenes", "/scenes/{session}", APIRoute)


class CloudSectionShown(BaseModel):
    """A plane across an axis or a normal in the cloud's frame; what lies on its other side is hidden."""

    axis: Literal["x", "y", "z"] = Field(default="z", examples=["z"])
    normal: list[FiniteFloat] | None = Field(default=None, min_length=3, max_length=3)
    at_mm: float = Field(allow_inf_nan=False, examples=[25.0])
    keep: Literal["below", "above"] = "below"


class CloudShown(BaseModel):
    """How the merged cloud is shown to all who look."""

    colors: Literal["height", "scan", "intensity", "deviation"] = Field(default="height", examples=["deviation"])
    section: CloudSectionShown | None = None
    against: Literal["mesh", "sphere"] = "mesh"
    diameter_mm: float | None = Field(default=None, gt=0, le=10_000)
    picked_mm: list[tuple[FiniteFloat, FiniteFloat, FiniteFloat]] = Field(default_factory=list, max_length=6)


_COLORS: dict[str, CloudColors] = {
    "height": "by height", "scan": "by scan", "intensity": "by intensity", "deviation": "by deviation",
}  # fmt: skip


@cloud_router.post("/cloud", status_code=204, summary="How the merged cloud is shown")
def show_cloud(session: SessionId, body: CloudShown, scenes: Scenes) -> None:
    """Colour the merged cloud, cut it open, mark points on it; nothing happens where nobody looks."""
    cut = body.section
    section = None if cut is None else section_of(cut.axis, cut.at_mm, cut.keep, cut.normal)
    against = Against(body.against, body.diameter_mm)
    view = CloudView(_COLORS[body.colors], section, against, tuple(body.picked_mm))
    scenes.show_cloud(session, view)
