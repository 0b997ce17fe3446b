"""Why a session fails or is doubtful: root causes, each with its evidence and with what would mend it."""

from typing import Any, Literal

from pydantic import Field

from calib_core.records.base import Finite, Identifier, Matrix4, Record

CauseKind = Literal[
    "pose-reading", "swapped-poses", "shifted-poses", "moved-sphere", "changed-tool", "sphere-diameter",
    "point-unit", "scaled-profile", "table-direction", "table-angles", "not-the-flange", "scan-elsewhere",
    "scanner-axis", "pose-list-order",
]  # fmt: skip
"""What is at fault: how poses are read, which capture has which, what moved, and what was told wrongly."""


class Changes(Record):
    """Changes of a session: merge patches (RFC 7396) of its cell and, by id, of its captures."""

    cell: dict[str, Any] = Field(default_factory=dict[str, Any])
    captures: dict[Identifier, dict[str, Any]] = Field(default_factory=dict[str, dict[str, Any]])

    @property
    def empty(self) -> bool:
        """Whether nothing is changed."""
        return not self.cell and not self.captures


class BeforeAfter(Record):
    """A figure as it is now and as it is with the remedy applied, None where it cannot be known before solving."""

    label: str
    unit: str = ""
    before: Finite | None
    after: Finite | None


class PoseReading(Record):
    """How the numbers of all poses are to be read instead: by a convention, in these units, this way round."""

    convention: str
    mm_per_unit: float
    radians: bool
    way: Literal["as-written", "inverted", "transposed", "columns"]


class TableReading(Record):
    """How the table's angles are to be read instead: times `factor`, plus `offset_deg` from capture `since` on."""

    factor: Finite = 1.0
    offset_deg: Finite = 0.0
    since: Identifier | None = None


class FlangeReading(Record):
    """Whose all poses are: a tool on the flange, in a frame; null where it is the flange, or the base."""

    tool0_from_tool: Matrix4 | None = None
    base_from_frame: Matrix4 | None = None


class RootCause(Record):
    """One root cause: what it is, as title and sentence, what speaks for it, and exactly what Apply changes.

    `id` names it among the causes of its result.  `changes` is null where nothing but other captures mends it;
    in a stage's result they name the stage's own captures.  Applied they change all of the session: by
    `pose_reading` where every pose is rewritten, by `poses_from`, the capture whose pose each one gets, by
    `table_reading` where every angle of the table is, by `point_settings` where every file of points is read anew,
    by `flange_reading` where every pose is brought back to the flange.
    """

    id: Identifier
    kind: CauseKind
    title: str = ""
    sentence: str = ""
    evidence: list[BeforeAfter] = Field(default_factory=list[BeforeAfter])
    captures: list[str] = Field(default_factory=list[str])
    changes: Changes | None = None
    pose_reading: PoseReading | None = None
    poses_from: dict[str, str] = Field(default_factory=dict[str, str])
    table_reading: TableReading | None = None
    point_settings: dict[str, Any] = Field(default_factory=dict[str, Any])
    flange_reading: FlangeReading | None = None
