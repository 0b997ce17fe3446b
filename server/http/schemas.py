"""What the routes take and give beside the session's own records; these are the names in the API's schema."""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from calib_core.records import (
    Capture,
    Cell,
    CheckLine,
    Finding,
    Finite,
    Measured,
    Record,
    Session,
    StageName,
    Verdict,
)
from calib_core.records.described import DescribedCell
from calib_core.records.policy import Environment


class SimulatedCell(Record):
    """The simulated cell as a session's device: a named one, or one that is described by its edges."""

    scenario: str = "tcp"
    seed: int = Field(default=1, ge=0, lt=2**31)
    cell: DescribedCell | None = None


class SessionRequest(Record):
    """A session record without captures; or `simulated`, which brings its own cell."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "name": "cell 4",
                    "cell": {
                        "sphere_diameter_mm": 80.0,
                        "pose_convention": "fanuc",
                        "scanner": {"kind": "profile"},
                    },
                },
                {"name": "trial", "simulated": {"scenario": "tcp", "seed": 7}},
            ]
        }
    )

    format: Literal["scancell-session/1"] = "scancell-session/1"
    name: str = Field(default="", max_length=500)
    documentation: dict[str, str] | None = None
    environment: Environment | None = None
    cell: Cell | None = None
    simulated: SimulatedCell | None = None


class SessionChanges(BaseModel):
    """Fields of a session to change, as a merge patch: what is left out stays, null removes."""

    model_config = ConfigDict(
        extra="allow",
        json_schema_extra={"examples": [{"name": "cell 4, morning"}, {"cell": {"sphere_diameter_mm": 80.003}}]},
    )

    name: str | None = Field(default=None, max_length=500)
    archived: bool | None = None
    cell: dict[str, Any] | None = None
    why: str | None = Field(default=None, max_length=1000, description="Kept with limits that are changed late.")


class CaptureChanges(BaseModel):
    """Fields of a capture to change, as a merge patch: what is left out stays, null removes."""

    model_config = ConfigDict(
        extra="allow",
        json_schema_extra={
            "examples": [{"excluded": True}, {"pose": [-195.8, 1363.3, 524.8, -179.9, 0.9, 179.6]}]
        },
    )

    excluded: bool | None = None
    side: Literal[1, -1] | None = None
    table_deg: Finite | None = None
    mount: str | None = None
    pose: list[Finite] | None = None


class StoredSession(Session):
    """A session as the server keeps it."""

    id: str
    created: str
    updated: str
    revision: int
    scene: str
    simulated: bool


class SessionSummary(BaseModel):
    """A session in a list; `stale` names the stages whose verdict is of inputs that have changed since."""

    id: str
    name: str
    created: str
    updated: str
    cell: Cell
    cell_id: str
    capture_count: int
    archived: bool
    verdicts: dict[StageName, Verdict]
    stale: list[StageName]


class SessionPage(BaseModel):
    """A page of sessions, the newest first; `next` is the following page's cursor."""

    items: list[SessionSummary]
    next: str | None


class StoredCapture(Capture):
    """A capture with what was measured in it."""

    measured: Measured


class CapturePage(BaseModel):
    """A page of captures in the order of their arrival; `next` is the following page's cursor."""

    items: list[StoredCapture]
    next: str | None


class PoseText(BaseModel):
    """Pose lines as they are copied from a pendant, a table or a program."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"text": "-195.8 1363.305 524.812 -179.924 0.889 179.635"}]}
    )

    text: str = Field(max_length=1_000_000)
    convention: str | None = Field(default=None, description="Left out: the cell's.")


class PoseLine(BaseModel):
    """What one line says: the numbers, and either base_from_tool0 (rows, mm) or what is wrong with it."""

    line: int
    text: str
    numbers: list[float | None] | None = None
    matrix: list[list[float]] | None = None
    problem: str | None = None


class LikelyConvention(BaseModel):
    """The convention that poses are clearly written in: by it they look at one place."""

    convention: str
    spread_mm: float
    told_spread_mm: float | None = None


class LikelyColumns(BaseModel):
    """The order in which the numbers clearly stand instead: number k of the convention is at place order[k]."""

    order: list[int]
    spread_mm: float
    told_spread_mm: float


class PoseLines(BaseModel):
    """The lines that are not empty; `likely_…` where the poses tell another convention, or swapped columns."""

    items: list[PoseLine]
    likely_convention: LikelyConvention | None = None
    likely_columns: LikelyColumns | None = None


class Problem(BaseModel):
    """Problem details (RFC 9457): what was needed and there, what to do; `findings` where causes are known."""

    type: str
    title: str
    status: int
    detail: str
    need: str
    got: str
    to_do: str
    where: str
    findings: list[Finding] = []


class BatchItem(BaseModel):
    """What became of one capture of a batch: 201 stored now, 200 stored before, else refused and why."""

    id: str | None
    status: int
    problem: Problem | None = None


class BatchAnswer(BaseModel):
    """What became of each capture of a batch, in their order; `stored` counts those that are there now."""

    items: list[BatchItem]
    stored: int


JobStatus = Literal["queued", "running", "done", "failed", "cancelled"]


class Job(BaseModel):
    """A solve on its way or past."""

    id: str
    session: str
    stage: str
    status: JobStatus
    progress: float
    message: str
    error: Problem | None
    created: str
    finished: str | None


class JobPage(BaseModel):
    """A page of jobs, the newest first; `next` is the following page's cursor."""

    items: list[Job]
    next: str | None


class Findings(BaseModel):
    """What a check of a session found, worst first; `items` are the findings as lines."""

    findings: list[Finding]
    items: list[CheckLine]
    blocks_solving: bool


class KeptFile(BaseModel):
    """A file that an imported archive held beside session and results."""

    name: str
    bytes: int
    sha256: str


class StoredCloudFile(KeptFile):
    """A cloud or a mesh that a merge made, stored as PLY, and the formats that it can be had in."""

    formats: list[str]


class StoredCloudFiles(BaseModel):
    """What a session's merge made."""

    items: list[StoredCloudFile]


class KeptFiles(BaseModel):
    """What an imported archive held beside session and results."""

    items: list[KeptFile]


class CloudSection(BaseModel):
    """A thin slice of the merged cloud, seen along its axis or normal; lengths in mm.

    `points` are pairs along the two axes of `across`, the first two of `directions`, whose third is the normal;
    `deviations_mm` belong to them, where they were asked for, null beside the reference.
    `nominal` is the reference mesh cut by the plane: lines from u v to u v.
    """

    frame: Literal["turntable", "base", "tool0"]
    axis: Literal["x", "y", "z"] | None = None
    at_mm: float
    width_mm: float
    across: list[str]
    directions: list[list[float]]
    low_mm: list[float]
    high_mm: list[float]
    count: int
    points: list[list[float]]
    deviations_mm: list[float | None] | None = None
    nominal: list[list[float]] | None = None
    limit_mm: float | None = None


class CloudDeviations(BaseModel):
    """How far the merged cloud lies off a reference: signed, positive outside, before any alignment; in mm.

    `histogram` counts points in even bins from −`limit_mm` to +`limit_mm`; those beyond are in the end bins.
    """

    against: Literal["mesh", "sphere"]
    reference: str
    counted: int
    mean_mm: float
    rms_mm: float
    p95_mm: float
    largest_mm: float
    limit_mm: float
    histogram: list[int]
    center_mm: list[float] | None = None
    diameter_mm: float | None = None


class ReferenceMesh(BaseModel):
    """The mesh that says what the object should be, as it was stored."""

    triangles: int
    low_mm: list[float]
    high_mm: list[float]
    sha256: str


class Health(BaseModel):
    """Whether the server answers, and whether it is ready to solve; `reasons` say what is `degraded`.

    `kernels` are `compiling` after a fresh installation: what needs one meanwhile takes some seconds longer.
    """

    status: Literal["ready", "starting", "degraded", "stopping"]
    version: str
    kernels: Literal["ready", "compiling"] = "ready"
    reasons: dict[str, str] = Field(default_factory=dict)
