"""A session as its file tells it: the cell, and the captures in it."""

from math import radians
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from calib_core.messages import message
from calib_core.records.base import (
    FORMAT,
    Finite,
    Identifier,
    Kind,
    Matrix4,
    NotNegative,
    PoseConvention,
    Positive,
    StepName,
    Vector3,
    WrittenRecord,
    mismatch,
    require_inside,
)
from calib_core.records.findings import Severity
from calib_core.records.merging import MergeSettings
from calib_core.records.planning import Limits, Nominal
from calib_core.records.policy import Environment, Equipment, Excluded, Policy, Removed
from calib_core.records.topology import CellAxis, KnownFrame, MountedScanner, Scanner, Sphere, SphereDistance

SphereClass = Literal["certified", "bearing", "coated", "turned"]
"""Of a sphere: with a certificate, a bearing ball, coated so that it is matt (assumed), turned or printed."""


class ArmJoint(WrittenRecord):
    """One row of a Denavit–Hartenberg table; `theta_deg` (or `d_mm` of a prismatic joint) is added to the reading.

    `sign` is −1 where the controller counts the joint the other way.  `previous_from_joint` stands before the row:
    a joint as a URDF has it, which turns or slides along its own z.  `limits` are in degrees or mm.
    """

    a_mm: Finite = 0.0
    alpha_deg: Finite = 0.0
    d_mm: Finite = 0.0
    theta_deg: Finite = 0.0
    kind: Literal["revolute", "prismatic"] = "revolute"
    sign: Literal[1, -1] = 1
    name: str | None = None
    previous_from_joint: Matrix4 | None = None
    limits: tuple[Finite, Finite] | None = None


class ArmTable(WrittenRecord):
    """An arm's joints from the base to the flange, in the standard or the modified (Craig) convention.

    `couples` has, for a joint that moves along with another (Fanuc's third with its second), the other's place,
    both from 0.  `source` says where the table is from, such as a URDF and the links it was read between.
    """

    joints: Annotated[list[ArmJoint], Field(min_length=1, max_length=12)]
    convention: Literal["standard", "modified"] = "standard"
    couples: dict[int, int] = Field(default_factory=dict)
    source: str | None = None
    base_from_first: Matrix4 | None = None
    last_from_tool0: Matrix4 | None = None


class Robot(WrittenRecord):
    """The robot's repeatability, standard deviations per axis, and its arm: by name, or by its table of joints.

    `errors`: what becomes of errors of the arm that are found where the captures have its joints: `cover` (left
    out) solves the tool for the poses as they are, `apply` for poses from which the errors are taken out.
    """

    position_sigma_mm: NotNegative | None = None
    orientation_sigma_deg: NotNegative | None = None
    brand: str | None = None
    arm: str | ArmTable | None = None
    errors: Literal["cover", "apply"] | None = None

    @property
    def orientation_sigma_rad(self) -> float | None:
        """The orientation's standard deviation in radians."""
        return None if self.orientation_sigma_deg is None else radians(self.orientation_sigma_deg)


class Turntable(WrittenRecord):
    """The turntable's sense of turning, its encoder's standard deviation, and whether its scale is an unknown.

    With `encoder` left out, its scale is an unknown where the captures leave no doubt that it is off.  `angles`
    says that nobody read them: captures of the sphere then need none.

    `direction` is 1 where the angles count right-handed about the axis that points up in base.
    """

    direction: Literal[1, -1] | None = None
    angle_sigma_deg: NotNegative | None = None
    encoder: Literal["exact", "scale"] | None = None
    angles: Literal["read", "unknown"] | None = None


class Board(WrittenRecord):
    """The calibration board of the camera stages.

    `pitch_y_mm` is the pitch along a column where it is not the one along a row, `margin_mm` how far the flat
    sheet goes on beyond the squares (circles); left out, the laser's lines tell. `flat` says whether it is taken
    to be flat or has its shape solved with the camera; left out, views that are held out decide.

    A `fixed` one stands still in the robot's base while the scanner moves, or on the flange before a scanner that
    stands still: then the robot's pose tells where it is in frames that show the stripe alone. `pitch_sigma_mm` is
    how well the pitch is known, 1 % without it: it counts where a robot's lengths are compared with the board's.
    """

    kind: Literal["chessboard", "charuco", "circles", "asymmetric-circles"]
    columns: Annotated[int, Field(ge=2, le=200)]
    rows: Annotated[int, Field(ge=2, le=200)]
    pitch_mm: Positive
    pitch_y_mm: Positive | None = None
    pitch_sigma_mm: NotNegative | None = None
    margin_mm: NotNegative | None = None
    marker_mm: Positive | None = None
    dictionary: str | None = None
    flat: bool | None = None
    fixed: bool = False

    @property
    def pitches_mm(self) -> tuple[float, float]:
        """The pitch along a row and along a column."""
        return self.pitch_mm, self.pitch_y_mm or self.pitch_mm


class CameraSegment(WrittenRecord):
    """One band of depth of a segmental camera."""

    near_mm: Finite
    far_mm: Finite
    distortion: dict[str, Finite]


class KnownCamera(WrittenRecord):
    """A camera calibration that the user brings; frames of another size than `image_size` are then refused."""

    camera_matrix: Annotated[list[Vector3], Field(min_length=3, max_length=3)]
    distortion: dict[str, Finite] = Field(default_factory=dict)
    image_size: tuple[int, int] | None = None
    segments: list[CameraSegment] = Field(default_factory=list)


class KnownPlane(WrittenRecord):
    """A laser plane that the user brings, in the camera frame: normal · p = distance."""

    normal: Vector3
    distance_mm: Finite


class Known(WrittenRecord):
    """Results that the user brings: a known stage is not solved, and later stages use it.

    `frames` are those of cells with several scanners or axes, each with its covariance where that is told.
    """

    camera: KnownCamera | None = None
    laser_plane: KnownPlane | None = None
    tool0_from_laser: Matrix4 | None = None
    base_from_laser: Matrix4 | None = None
    base_from_turntable: Matrix4 | None = None
    frames: list[KnownFrame] | None = None


class LimitChange(WrittenRecord):
    """A limit, or a ball bar's length, that was changed after captures for the verification had been taken.

    `field` is its name in `cell.verification`, `captures` how many there were then, those left out too; `why` as
    whoever changed it told.
    """

    at: str
    who: str = ""
    why: str | None = None
    field: str
    before_mm: Finite | None = None
    after_mm: Finite | None = None
    captures: Annotated[int, Field(ge=1)]


class Verification(WrittenRecord):
    """Limits of a verification, set before it; those left out are told and not judged.

    `tool_mm` is of the tool's error where the scanner sees the sphere, `form_mm` of the points' distances from
    their own sphere, `form_95_mm` of the band that holds 95 % of them, `size_mm` of the diameter's error.
    `spacing_mm` is of the error of the distance of two spheres (`mount` of the captures tells which), whose
    calibrated distance is `ball_bar_mm` with the standard uncertainty `ball_bar_sigma_mm`.  `flatness_mm` is of
    the range of all points' distances from the plane of a flat plate (captures with step `plate`),
    `flatness_95_mm` of the band that holds 95 % of them.

    `changes` are those that were made after the first capture for it: a server keeps them, and nobody edits them.
    """

    tool_mm: Positive | None = None
    form_mm: Positive | None = None
    form_95_mm: Positive | None = None
    size_mm: Positive | None = None
    spacing_mm: Positive | None = None
    flatness_mm: Positive | None = None
    flatness_95_mm: Positive | None = None
    ball_bar_mm: Positive | None = None
    ball_bar_sigma_mm: NotNegative | None = None
    changes: list[LimitChange] | None = None


class Cell(WrittenRecord):
    """The scanning cell: sphere, robot, scanner, table, board.

    Where the diameter's sigma is left out, `sphere_class` says how exact such a sphere is.

    `arrangement` says what the robot carries: the scanner, or the sphere before a scanner that stands still.

    `scanner` is the one scanner, `scanners` are several by name: a capture says which of them saw it.  `spheres`
    and `axes` are named where there are more than the one sphere and the turntable (an axis named `table`), or
    where something is known of them; `sphere_distances` are between spheres.  `id` is what sessions of one cell
    share; left out, it is made from the session's name.

    `findings` are severities of this cell's own, by code: applied where its results are read.  `equipment` is what
    it was found with, `release` what a folder's cell asks of an answer (a server has a policy of its own).

    `wanted_mm` is the ± (k = 2) that is wanted at the workpiece, `workpiece_in_laser_mm` where the scanner sees it
    and `workpiece_in_turntable_mm` where it stands; `limits` and `nominal` are for planning poses.
    """

    id: Identifier | None = None
    arrangement: Literal["scanner-on-robot", "sphere-on-robot"] = "scanner-on-robot"
    pose_convention: PoseConvention
    sphere_diameter_mm: Positive | None = None
    sphere_diameter_sigma_mm: NotNegative | None = None
    sphere_class: SphereClass | None = None
    scanner: Scanner = Field(default_factory=Scanner)
    scanners: dict[Identifier, MountedScanner] | None = None
    spheres: list[Sphere] | None = None
    sphere_distances: list[SphereDistance] | None = None
    axes: list[CellAxis] | None = None
    robot: Robot = Field(default_factory=Robot)
    turntable: Turntable = Field(default_factory=Turntable)
    board: Board | None = None
    known: Known = Field(default_factory=Known)
    merge: MergeSettings = Field(default_factory=MergeSettings)
    verification: Verification = Field(default_factory=Verification)
    findings: dict[str, Severity] | None = None
    equipment: list[Equipment] | None = None
    release: Policy | None = None
    wanted_mm: Positive | None = None
    workpiece_in_laser_mm: Vector3 | None = None
    workpiece_in_turntable_mm: Vector3 | None = None
    limits: Limits = Field(default_factory=Limits)
    nominal: Nominal | None = None


class TimedPose(WrittenRecord):
    """One pose of a track that is sampled in time."""

    t_s: Finite
    pose: list[Finite]


class Capture(WrittenRecord):
    """One measurement: its files and where robot and table stood, the numbers as they came.

    `table_deg` is the turntable's angle, `axes_deg` and `axes_mm` are the readings of the cell's `axes` by name.
    `board_of`, of dark boards, is kept and not used any more.
    `scanner` is a name in the cell's `scanners`; `joints_deg` are the robot's joints at `pose`, in order, those of
    prismatic ones in `joints_mm`; `active_tool` and `active_frame` are those that the controller gave `pose` in;
    `moving` says that the robot was; `source` is the file and line, or the device, that it came from.
    `taken` is when (ISO 8601 with offset), by `clock`: of the file, the server, a device, or the program that sent
    it, else when it was `received`; `excluded_because` who left it out, when and why, `included_because` who took
    it in again; `added_because` and `changed_because` who added or corrected it after a verification.
    `format` names the files' format where it is not recognised, `format_settings` says what they do not.
    """

    id: Identifier
    step: StepName
    kind: Kind
    files: list[str] = Field(default_factory=list)
    pose: list[Finite] | None = None
    table_deg: Finite | None = None
    axes_deg: dict[Identifier, Finite] | None = None
    axes_mm: dict[Identifier, Finite] | None = None
    mount: str | None = None
    center_mm: Vector3 | None = None
    poses: list[list[Finite]] | None = None
    timestamps_s: list[Finite] | None = None
    pose_track: list[TimedPose] | None = None
    excluded: bool = False
    excluded_because: Excluded | None = None
    included_because: Excluded | None = None
    added_because: Excluded | None = None
    changed_because: Excluded | None = None
    taken: str | None = None
    clock: Literal["file", "server", "device", "program", "received"] | None = None
    environment: Environment | None = None
    side: Literal[1, -1] | None = None
    board_of: Identifier | None = None
    scanner: Identifier | None = None
    joints_deg: list[Finite | None] | None = None
    joints_mm: list[Finite | None] | None = None
    device_time_s: Finite | None = None
    active_tool: int | str | None = None
    active_frame: int | str | None = None
    moving: bool | None = None
    source: str | None = None
    format: str | None = None
    format_settings: dict[str, Any] | None = None

    @field_validator("files")
    @classmethod
    def _files_stay_inside(cls, files: list[str]) -> list[str]:
        for name in files:
            require_inside(name)
        return files

    @model_validator(mode="after")
    def _has_its_data(self) -> "Capture":
        if self.kind == "center":
            if self.center_mm is None:
                raise mismatch("center_mm [x, y, z] in a capture of kind 'center'", "none", "Add it.")
        elif not self.files:
            raise mismatch(
                message("at least one file in `files` of a '{kind}' capture", kind=self.kind), "none", "Add it."
            )
        return self


class Session(WrittenRecord):
    """A session: the cell and its captures; one that is `archived` is kept, no longer in use.

    `documentation` is printed: operator, place, procedure, report number, customer, when the item was `received`,
    the report that it `replaces`, `replaces_because`, and what else there is. `removed` are captures that were
    taken out once something was solved.
    """

    format: Literal["scancell-session/1"] = FORMAT
    name: str = ""
    archived: bool = False
    documentation: dict[str, str] | None = None
    environment: Environment | None = None
    removed: list[Removed] | None = None
    cell: Cell
    captures: list[Capture] = Field(default_factory=list)

    @model_validator(mode="after")
    def _capture_ids_differ(self) -> "Session":
        seen: set[str] = set()
        for capture in self.captures:
            if capture.id in seen:
                raise mismatch(
                    "capture ids that differ", message("'{name}' twice", name=capture.id), "Rename or remove one."
                )
            seen.add(capture.id)
        return self
