"""The address by which a page shows poses in the scene before they are stored."""

from typing import Annotated

from fastapi.routing import APIRoute
from pydantic import BaseModel, Field

from calib_core.frames import RigidTransform
from server.http.api_router import api_router
from server.scenes.router import Scenes, SessionId

trials_router = api_router("scenes", "/scenes/{session}", APIRoute)

_MOST = 300


_Number = Annotated[float, Field(ge=-1e7, le=1e7)]
_Row = Annotated[list[_Number], Field(min_length=4, max_length=4)]
_Matrix = Annotated[list[_Row], Field(min_length=4, max_length=4)]


class Trial(BaseModel):
    """Poses of the flange in the base, 4×4, rows, mm; none takes away those that are shown."""

    poses: list[_Matrix] = Field(
        max_length=_MOST, examples=[[[[1, 0, 0, -195.8], [0, 1, 0, 1363.3], [0, 0, 1, 524.8], [0, 0, 0, 1]]]]
    )


@trials_router.post("/trial", status_code=204, summary="Show poses that are being read")
def try_poses(session: SessionId, body: Trial, scenes: Scenes) -> None:
    """Show poses in the session's scene without storing them; where nobody looks, nothing happens.

    Raises
    ------
    InputError
        If one is no rigid transform.
    """
    poses = tuple(RigidTransform.from_rounded(rows, "base", "tool0") for rows in body.poses)
    live = scenes.live(session)
    if live is not None:
        live.try_poses(poses)
