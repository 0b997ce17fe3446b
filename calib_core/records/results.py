"""What the results of all stages share."""

from importlib import import_module
from typing import Any, Final, Literal

from pydantic import Field

from calib_core.records.base import Matrix4, OpenMatrix4, OpenRows, PoseConvention, Record, Rows, Vector3, Verdict
from calib_core.records.causes import RootCause
from calib_core.records.evidence import AnyBlock
from calib_core.records.findings import Finding

_SHOWN: Final = "calib_core.stages.evidence"  # by name: the records know nothing of what shows them


class CaptureResidual(Record):
    """What one capture contributed to a solve, or why it did not."""

    capture: str
    used: bool
    reason: str | None = None


class FoundFrame(Record):
    """A transform `into` `outof`: 4×4 rows in mm, its covariance 6×6 of rx ry rz tx ty tz in rad and mm."""

    into: str
    outof: str
    scanner: str | None = None
    matrix: OpenMatrix4
    covariance: OpenRows | None = None


class Result(Record):
    """What every stage's result has, beside the name of its `stage`.

    `method_revision` is the stage's when it was solved: a later one gives other numbers or verdicts on purpose.
    `findings` are what was noticed, errors first. All of the judgement is made of them, in
    `calib_core.findings.judgement`: `verdict`; `warnings`, doubts, one sentence a cause; `notes`, what else is
    worth knowing; `causes`, the root causes that were found, the likeliest first, with what would mend them.
    `frames` are all transforms that it found. `evidence` is the result told in blocks, as terminal, report and
    page show it.  `pose_convention` is the cell's when it was solved, `solved` when that was (ISO 8601,
    told by whoever stores it).  `provenance` is how it came to be here, `seal` the signature that proves it.
    """

    method: str
    method_revision: int = 1
    software: str
    inputs_sha256: str
    verdict: Verdict
    pose_convention: PoseConvention | None = None
    solved: str | None = None
    provenance: Literal["solved", "imported", "replayed", "differs"] | None = None
    seal: dict[str, Any] | None = None
    findings: list[Finding] = Field(default_factory=list[Finding])
    warnings: list[str] = Field(default_factory=list)
    notes: list[str] = Field(default_factory=list)
    causes: list[RootCause] = Field(default_factory=list[RootCause])
    frames: list[FoundFrame] = Field(default_factory=list[FoundFrame])
    evidence: list[AnyBlock] = Field(default_factory=list[AnyBlock])

    def __str__(self) -> str:
        return import_module(_SHOWN).text_of(self)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.verdict}; print it, or show it in a notebook>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows."""
        return import_module(_SHOWN).html_of(self)


class VarianceComponents(Record):
    """Standard deviations of the point noise and of the robot's pose errors.

    Of the latter one part is each pose's own; the `alike` part is shared where poses are alike, within about
    `reach_mm` and `reach_rad`.  So many neighbouring points as `points_per_independent` say what one alone would.
    The robot's scatter is known as well as from `degrees_of_freedom`; null where it was told.  `play_sigma_mm` is
    of a sphere on an axis, each way, before a scanner that stands still; elsewhere it is part of the robot's.
    """

    point_sigma_mm: float | None
    position_sigma_mm: float
    orientation_sigma_rad: float
    orientation_sigma_deg: float
    estimated: list[str] = Field(default_factory=list)
    alike_position_sigma_mm: float = 0.0
    alike_orientation_sigma_rad: float = 0.0
    reach_mm: float = 0.0
    reach_rad: float = 0.0
    points_per_independent: float = 1.0
    degrees_of_freedom: float | None = None
    play_sigma_mm: float | None = None


class LeftInFiles(Record):
    """By how much an answer is off for errors of the scanner that were found and stay in its files.

    The tool (rx ry rz tx ty tz), base_from_turntable likewise, and what was found of the scanner, in the order of
    its names. The squares are in the covariances; but one knows these shares, and they are the same in every scan.
    """

    tool: list[float]
    scanner: list[float]
    turntable: list[float] | None = None


class ScannerFound(Record):
    """What was found of sphere and scanner with the tool, in the order of `names`, and how both are correlated.

    `covariance_with_tool` is (6, n).  With `applied` the tool belongs to points from which scale, shear and bow
    are taken out, otherwise to the files as they are.  `sphere_diameter_sigma_mm` is what was told or assumed.
    `covariance_with_table` is (6, n), of base_from_turntable in the whole chain; `half_width_mm` half the width
    that the points fill, in which a bow is measured; `facing` is 1 where z grows away from the scanner, else −1.
    `left_in_files` is what stays in the files where nothing is applied.  `sheet_bend_mm` is how far the light lies
    off its plane along y at `half_width_mm`, by the square of x, where it is bent and that was solved.
    """

    names: list[str]
    values: list[float]
    sigmas: list[float]
    covariance: Rows
    covariance_with_tool: Rows
    applied: bool
    sphere_diameter_sigma_mm: float
    covariance_with_table: Rows | None = None
    half_width_mm: float | None = None
    facing: int = 1
    left_in_files: LeftInFiles | None = None
    sheet_bend_mm: float | None = None


class ArmTerms(Record):
    """What the captures alone tell of an arm's errors, in units of what is `believed` of each (one σ).

    `vector` is the information times the likeliest values: those of sessions of one arm add up.
    """

    names: list[str]
    believed: list[float]
    information: Rows
    vector: list[float]


class ArmModelFound(Record):
    """The arm's own errors as the captures tell them, by the names of its terms, which end in their units.

    `held_out_rms_mm` is by how much the ball's place is predicted wrong at groups of poses that were left out,
    without and with it. It is `worth_it` where the captures are likelier with it beyond chance and these poses
    do not contradict; `decided_by` says which of both decided. With `applied` poses are
    corrected by it in this stage and all later ones; `controller` then has what is best with the controller's own
    poses: the scanner's and the table's frames. `told` is what a later session is held against. `covariance`, of
    the values, is there where they are applied.
    """

    names: list[str]
    values: list[float]
    sigmas: list[float]
    members: list[str] = Field(default_factory=list[str])
    held_out_rms_mm: list[float]
    decided_by: Literal["held-out", "likelihood"] = "held-out"
    worth_it: bool
    applied: bool = False
    controller: list[FoundFrame] | None = None
    told: ArmTerms | None = None
    covariance: Rows | None = None


class OpticsShift(Record):
    """What one standard deviation of camera or plane of light, along one direction, does to an answer.

    It moves the tool by `tool` (rx ry rz tx ty tz), base_from_turntable by `turntable`, what was found of the
    scanner by `scanner` (in the order of its names), and a point that is measured at `at_mm` in L by `point_mm`,
    which changes with the place by `by_place` (3, 3).  Directions are independent, and in the covariances.
    `source` is "plane" for what the camera's error leaves open of the plane.
    """

    source: Literal["camera", "plane"]
    tool: list[float]
    turntable: list[float] | None = None
    scanner: list[float]
    at_mm: Vector3
    point_mm: Vector3
    by_place: Rows


class ArmErrorsFound(Record):
    """How an answer's errors are correlated with the arm's: where a scan is taken, both cancel in part.

    The arm's errors are those of its lengths, and those that are alike where poses are alike: the reported place
    less the true one along base's axes, and the turn about base's axes from the reported orientation to the true
    one. `poses` (base_from_tool0) stand for all; how alike two poses' errors are follows exp(−½ d²), d by
    `reach_mm` and `reach_rad` of `variance_components`. `position_sigma_mm` and `orientation_sigma_rad` are of
    the alike part, with what the captures leave open of it. Lengths are compared from `middle_mm` in base, and
    are off by a share whose standard deviation is `lengths_sigma`. Of tool, scanner (in the order of its names)
    and table the covariances with that share, and at each pose with its position (3) and orientation (3); for
    frames of rx ry rz tx ty tz. With poses that are corrected by the arm's own errors, `*_with_terms` are their
    covariances with the errors of `arm_model`'s values, `terms_with_*` those of these with the arm's other errors,
    and `term_moves` how the flange moves in base with them (six a pose: mm, then rad about base's axes).
    """

    poses: list[Matrix4]
    middle_mm: Vector3
    lengths_sigma: float
    position_sigma_mm: float
    orientation_sigma_rad: float
    tool_with_lengths: list[float]
    tool_with_poses: list[Rows]
    scanner_with_lengths: list[float]
    scanner_with_poses: list[Rows]
    table_with_lengths: list[float] | None = None
    table_with_poses: list[Rows] | None = None
    tool_with_terms: Rows | None = None
    scanner_with_terms: Rows | None = None
    table_with_terms: Rows | None = None
    terms_with_lengths: list[float] | None = None
    terms_with_poses: list[Rows] | None = None
    term_moves: list[Rows] | None = None


class AtPoint(Record):
    """How well a point is known that the scanner measures where it saw the sphere, scanner and tool together.

    `covariance` is (3, 3), mm², along the flange's axes, in base as the arm tells it: what lengths of the arm that
    are off did to the tool cancels there.
    """

    point_in_laser_mm: Vector3
    covariance: Rows


class Undetermined(Record):
    """A direction of the answer that the motions do not fix."""

    direction: list[float]
    description: str
