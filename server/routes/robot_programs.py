"""Programs for robot controllers that go through a planned set, ready to load."""

import io
import zipfile
from typing import Annotated, Any

from fastapi import Path, Response
from pydantic import BaseModel, ConfigDict, Field

from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.messages import message
from calib_core.proof import Proof, is_experimental
from calib_core.records import Finite, Identifier, Record, StepName
from calib_core.records.strict_fields import require_known_fields
from calib_core.steps import tool_stages
from server.http.api_router import api_router
from server.routes.dependencies import IdempotencyDep, SessionId, StoreDep
from server.store.sessions import StoredSession, load_session

router = api_router("live")

ProgramName = Annotated[str, Path(description="A `name` of the list.", max_length=64, examples=["krl"])]


class ProgramEntry(BaseModel):
    """A dialect that programs are written in; `needs` is the controller's option for it."""

    name: str
    title: str
    convention: str
    needs: str
    proof: Proof
    experimental: bool


class RobotPrograms(BaseModel):
    """The dialects."""

    items: list[ProgramEntry]


class PlannedPose(Record):
    """A pose of the planned set, in the session's convention."""

    id: Identifier
    pose: list[Finite] = Field(max_length=16)


class ProgramRequest(Record):
    """What a program shall do; without `poses`, it goes to those of the session's captures of `step` again.

    Left out, the token is a placeholder that the operator replaces on the controller.
    """

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"host": "192.168.0.5", "port": 5870, "step": "tcp", "speed_mm_s": 50.0}]}
    )

    host: str = Field(pattern=r"^[A-Za-z0-9.:-]{1,64}$")
    port: int = Field(ge=1, le=65535)
    token: str = Field(default="PUT THE TOKEN HERE", pattern=r"^[A-Za-z0-9_ -]{1,80}$")
    step: StepName = "tcp"
    mount: str | None = Field(default=None, pattern=r"^[A-Za-z0-9._-]{1,40}$")
    poses: list[PlannedPose] | None = Field(default=None, max_length=200)
    speed_mm_s: float = Field(default=50.0, gt=0, le=250)
    approach_mm: float = Field(default=150.0, ge=20, le=1000)


@router.get("/robot-programs", response_model=RobotPrograms)
def list_programs() -> RobotPrograms:
    """List the dialects that robot programs are written in."""
    from calib_core.robots.programs.registry import PROGRAMS

    return RobotPrograms(
        items=[
            ProgramEntry(
                name=p.name,
                title=p.title,
                convention=p.convention,
                needs=p.needs,
                proof=p.proof,
                experimental=is_experimental(p.proof),
            )
            for p in PROGRAMS
        ]
    )


@router.post(
    "/sessions/{session_id}/robot-programs/{name}",
    response_class=Response,
    responses={200: {"description": "A zip of the program's files.", "content": {"application/zip": {}}}},
)
def make_program(
    session_id: SessionId, name: ProgramName, body: ProgramRequest, _: IdempotencyDep, store: StoreDep
) -> Response:
    """Return a program that goes through a planned set, a capture at each pose, as a zip of its files.

    Each pose is gone to in a straight line from a point outside; the operator starts every way.
    """
    from calib_core.robots.programs.program import plan_of
    from calib_core.robots.programs.registry import PROGRAMS

    require_known_fields(body, "request")
    program = PROGRAMS.get(name, "name")
    with store.read() as db:
        stored = load_session(db, store.blobs, session_id)
    fields = [] if body.step == "tcp" else [f"step={body.step}"]
    fields += [f"mount={body.mount}"] if body.mount else []
    plan = plan_of(
        program,
        _poses(stored, body),
        body.host,
        body.port,
        body.token,
        body.speed_mm_s,
        body.approach_mm,
        _center(stored),
        " ".join(fields),
    )
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as zipped:
        for file, text in program.write(plan).items():
            zipped.writestr(zipfile.ZipInfo(file, (2026, 1, 1, 0, 0, 0)), text.encode("ascii", errors="replace"))
    headers = {"Content-Disposition": f'attachment; filename="scancell-{program.name}.zip"'}
    headers["Scancell-Proof"] = program.proof
    return Response(content.getvalue(), media_type="application/zip", headers=headers)


def _poses(stored: StoredSession, body: ProgramRequest) -> list[tuple[str, RigidTransform]]:
    from calib_core.robots import parse_pose

    convention = stored.session.cell.pose_convention
    if body.poses is not None:
        return [(planned.id, parse_pose(convention, planned.pose)) for planned in body.poses]
    captures = [
        c for c in stored.session.captures if c.step == body.step and c.pose is not None and not c.excluded
    ]
    if not captures:
        got = message("no captures of the step {step} with poses", step=body.step)
        raise InputError("poses to go to", got, "Send a planned set in `poses`.", "poses")
    return [(f"{c.id}-again"[:30], parse_pose(convention, c.pose)) for c in captures if c.pose]


def _center(stored: StoredSession) -> Any:
    for stage in tool_stages():
        if center := stored.results.get(stage, {}).get("sphere_center_in_base_mm"):
            return center
    return None
