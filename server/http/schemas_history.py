"""What the routes of a session's past give; these are names in the API's schema."""

from typing import Literal

from pydantic import BaseModel

from calib_core.records import Guide, Session, StepName, Verdict
from calib_core.records.policy import Excluded
from calib_core.review.compare import Comparison
from calib_core.review.replay import Replay
from server.http.schemas import StoredCapture
from server.http.schemas_results import StoredResult


class TimelineItem(BaseModel):
    """What happened: a capture came or was removed, a limit changed late, a stage was solved, an answer released.

    The last one is `now`.

    `removed` says of a capture that it is not in the session any more; it then stands before the first result that
    used it. `message` says why a solve failed, which limit of a verification was changed, who acknowledged
    that cell or equipment changed, or who released (`brought`: elsewhere, as the archive tells that the session
    came with);
    `excluded_because` who left a capture out, `included_because` who took it in again,
    `added_because` and `changed_because` who added or corrected it after a verification, `removed_because` who
    removed it.
    """

    place: int
    kind: Literal["capture", "removed", "result", "limit", "release", "acknowledged", "failed", "cancelled", "now"]
    at: str
    capture: str | None = None
    step: StepName | None = None
    removed: bool = False
    stage: str | None = None
    number: int | None = None
    verdict: Verdict | None = None
    software: str | None = None
    message: str | None = None
    brought: bool = False
    excluded_because: Excluded | None = None
    included_because: Excluded | None = None
    added_because: Excluded | None = None
    changed_because: Excluded | None = None
    removed_because: Excluded | None = None


class Timeline(BaseModel):
    """What happened in a session, in order."""

    items: list[TimelineItem]


class MomentOfSession(BaseModel):
    """A session as it stood at a place of its time line.

    `numbers` are those of the results by stage; `frames` is the export `json` of then, null before a tool is
    known. Each result has `stale` and `at_workpiece` beside its own fields.
    """

    place: int
    session: Session
    captures: list[StoredCapture]
    results: dict[str, StoredResult]
    numbers: dict[str, int]
    guide: Guide
    frames: dict[str, object] | None


class PastResult(BaseModel):
    """One result of a stage: `captures` it was given, `used` of them; `figures` are its single numbers by name."""

    number: int
    created: str
    stage: str
    verdict: Verdict
    method: str
    software: str
    inputs_sha256: str
    captures: int
    used: int
    figures: dict[str, float]


class ResultHistory(BaseModel):
    """All results that a stage ever had, the newest first."""

    items: list[PastResult]


class Recomputed(BaseModel):
    """What came of solving afresh: every number compared, and each stage side by side (left stored, right new)."""

    replay: Replay
    stages: dict[str, Comparison]
