"""The records of a session, its captures and its results: one set for the solvers, the API and the archive.

Names and nesting are the published session format `scancell-session/1`.  Records are frozen; what a user's file
says beyond these fields is kept and given back, so that nothing is lost in a round trip.
"""

from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    ValidationError,
    field_validator,
    model_validator,
)

from calib_core.errors import InputError

FORMAT = "scancell-session/1"

Step = Literal["camera", "laser-plane", "tcp", "turntable", "verify", "scan"]
Kind = Literal["frame", "profile", "cloud", "sweep", "center"]
Stage = Literal["camera", "laser-plane", "tcp", "turntable", "chain", "verify", "merge"]
Verdict = Literal["pass", "warn", "fail"]
PoseConvention = Literal[
    "matrix", "quaternion-xyzw", "quaternion-wxyz", "abb", "kuka", "fanuc", "ur",
    "staubli", "kawasaki", "yaskawa", "mitsubishi", "nachi", "ros",
]  # fmt: skip

Identifier = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Vector3 = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Matrix4 = Annotated[
    list[Annotated[list[Finite], Field(min_length=4, max_length=4)]], Field(min_length=4, max_length=4)
]
Rows = list[list[float]]


def _mismatch(need: str, got: str, to_do: str) -> ValueError:
    """Return what a validator raises: `input_error_from_details` takes the three parts out again."""
    return ValueError(f"need {need}, got {got}. {to_do}", need, got, to_do)


class Record(BaseModel):
    """A frozen record that keeps fields it does not know."""

    model_config = ConfigDict(frozen=True, extra="allow")

    def to_json(self) -> dict[str, Any]:
        """Return the record as plain JSON data, without the fields that were left out."""
        return self.model_dump(mode="json", exclude_unset=True)

    def unknown_fields(self) -> list[str]:
        """Return the names in this record that the format does not know (typing errors, or newer fields)."""
        return sorted(self.model_extra or {})


class Scanner(Record):
    """What kind of data the scanner delivers and how noisy it is."""

    kind: Kind | None = None
    point_sigma_mm: Positive | None = None
    z_axis: Literal["away", "toward"] | None = None


class Robot(Record):
    """The repeatability of the robot, standard deviations per axis."""

    position_sigma_mm: NotNegative | None = None
    orientation_sigma_deg: NotNegative | None = None
    brand: str | None = None


class Turntable(Record):
    """The turntable's sense of turning, its encoder's standard deviation, and whether its scale is an unknown.

    With `encoder` left out, its scale is an unknown where the captures leave no doubt that it is off.  `angles`
    says that nobody read them: captures of the sphere then need none.

    `direction` is 1 where the angles count right-handed about the axis that points up in base.
    """

    direction: Literal[1, -1] | None = None
    angle_sigma_deg: NotNegative | None = None
    encoder: Literal["exact", "scale"] | None = None
    angles: Literal["read", "unknown"] | None = None


class Board(Record):
    """The calibration board of the camera stages; one that is not `flat` has its shape refined with the camera."""

    kind: Literal["chessboard", "charuco", "circles", "asymmetric-circles"]
    columns: Annotated[int, Field(ge=2, le=200)]
    rows: Annotated[int, Field(ge=2, le=200)]
    pitch_mm: Positive
    marker_mm: Positive | None = None
    dictionary: str | None = None
    flat: bool = True


class KnownCamera(Record):
    """A camera calibration that the user brings."""

    camera_matrix: Annotated[list[Vector3], Field(min_length=3, max_length=3)]
    distortion: dict[str, Finite] = Field(default_factory=dict)


class KnownPlane(Record):
    """A laser plane that the user brings, in the camera frame: normal · p = distance."""

    normal: Vector3
    distance_mm: Finite


class Known(Record):
    """Results that the user brings: a known stage is not solved, and later stages use it."""

    camera: KnownCamera | None = None
    laser_plane: KnownPlane | None = None
    tool0_from_laser: Matrix4 | None = None
    base_from_turntable: Matrix4 | None = None


class MergeSettings(Record):
    """How scans are merged; all may be left out.  Voxels beyond `memory_mb` go to the disk meanwhile."""

    voxel_mm: Positive = 0.5
    mesh: Literal["poisson", "grid", "none"] = "poisson"
    registration: bool = False
    memory_mb: Positive = 1000.0


class Cell(Record):
    """The scanning cell: sphere, robot, scanner, table, board."""

    pose_convention: PoseConvention
    sphere_diameter_mm: Positive | None = None
    sphere_diameter_sigma_mm: NotNegative | None = None
    scanner: Scanner = Field(default_factory=Scanner)
    robot: Robot = Field(default_factory=Robot)
    turntable: Turntable = Field(default_factory=Turntable)
    board: Board | None = None
    known: Known = Field(default_factory=Known)
    merge: MergeSettings = Field(default_factory=MergeSettings)


class TimedPose(Record):
    """One pose of a track that is sampled in time."""

    t_s: Finite
    pose: list[Finite]


class Capture(Record):
    """One measurement: its files and where robot and table stood, the numbers as they came."""

    id: Identifier
    step: Step
    kind: Kind
    files: list[str] = Field(default_factory=list)
    pose: list[Finite] | None = None
    table_deg: Finite | None = None
    mount: str | None = None
    center_mm: Vector3 | None = None
    poses: list[list[Finite]] | None = None
    timestamps_s: list[Finite] | None = None
    pose_track: list[TimedPose] | None = None
    excluded: bool = False
    side: Literal[1, -1] | None = None

    @field_validator("files")
    @classmethod
    def _files_stay_inside(cls, files: list[str]) -> list[str]:
        for name in files:
            path = PurePosixPath(name)
            if not name or path.is_absolute() or ".." in path.parts or "\\" in name or "\0" in name or ":" in name:
                raise _mismatch("a file inside the session folder", repr(name)[:80], "Copy it into captures/.")
        return files

    @model_validator(mode="after")
    def _has_its_data(self) -> "Capture":
        if self.kind == "center":
            if self.center_mm is None:
                raise _mismatch("center_mm [x, y, z] in a capture of kind 'center'", "none", "Add it.")
        elif not self.files:
            raise _mismatch(f"at least one file in `files` of a '{self.kind}' capture", "none", "Add it.")
        return self


class Session(Record):
    """A session: the cell and its captures."""

    format: Literal["scancell-session/1"] = FORMAT
    name: str = ""
    cell: Cell
    captures: list[Capture] = Field(default_factory=list)

    @model_validator(mode="after")
    def _capture_ids_differ(self) -> "Session":
        seen: set[str] = set()
        for capture in self.captures:
            if capture.id in seen:
                raise _mismatch("capture ids that differ", f"'{capture.id}' twice", "Rename or remove one.")
            seen.add(capture.id)
        return self


class CaptureResidual(Record):
    """What one capture contributed to a solve, or why it did not."""

    capture: str
    used: bool
    reason: str | None = None


class TcpResidual(CaptureResidual):
    """Figures of one capture of the sphere, in millimetres unless the name says otherwise.

    A sweep is one row: the root mean squares over those of its `profiles` that are used, and their mean offset.
    """

    points: int = 0
    surface_rms_mm: float | None = None
    center_distance_mm: float | None = None
    center_offset_in_base_mm: list[float] | None = None
    leave_one_out_rms_mm: float | None = None
    two_step_surface_rms_mm: float | None = None
    mahalanobis: float | None = None
    side: int | None = None
    zone: float | None = None
    profiles: int | None = None
    profiles_used: int | None = None


class Result(Record):
    """What every stage's result has, beside the name of its `stage`."""

    method: str
    software: str
    inputs_sha256: str
    verdict: Verdict
    warnings: list[str] = Field(default_factory=list)


class VarianceComponents(Record):
    """Standard deviations of the point noise and of the robot's random pose errors."""

    point_sigma_mm: float | None
    position_sigma_mm: float
    orientation_sigma_rad: float
    orientation_sigma_deg: float
    estimated: list[str] = Field(default_factory=list)


class Undetermined(Record):
    """A direction of the answer that the motions do not fix."""

    direction: list[float]
    description: str


class TwoStep(Record):
    """The paper's two-step answer, beside the joint one."""

    tool0_from_laser: Matrix4 | None = None
    sphere_center_in_base_mm: Vector3 | None = None
    surface_rms_mm: float | None = None
    leave_one_out_surface_rms_mm: float | None = None
    center_scatter_rms_mm: float | None = None
    covariance: Rows | None = None
    translations: list[list[str]] = Field(default_factory=list)
    reason: str | None = None


class TcpResult(Result):
    """The scanner's pose on the flange, with its evidence."""

    stage: Literal["tcp"] = "tcp"
    tool0_from_laser: Matrix4
    covariance: Rows
    sphere_center_in_base_mm: Vector3
    sphere_center_covariance: Rows
    surface_rms_mm: float
    leave_one_out_surface_rms_mm: float | None
    center_scatter_rms_mm: float
    undetermined: list[Undetermined] = Field(default_factory=list)
    two_step: TwoStep
    variance_components: VarianceComponents
    confidence_95: dict[str, float] = Field(default_factory=dict)
    residuals: list[TcpResidual]


class Measured(Record):
    """What was seen in one capture of the sphere, in the scanner's frame L, and how good it is.

    A profile's `center_mm` and the rows of `preview` are [x, z] of the plane of light; those of a cloud or a
    centre are [x, y, z].  `zone` is r/R, the circle's radius over the sphere's; `extent_deg` the length of the
    arc seen.  A frame's `preview` are pixels of `image_size` (width, height).  A sweep's `profiles` are those in
    which the sphere's arc is found; its figures are of the one with the largest circle, its points of all.

    Of a frame of the board: `board_px` are its corners, `pitch_px` how far they stand apart (the nearer the board,
    the farther), `edge_width_px` the rise of its squares' edges from 10 to 90 %: how sharp the frame is.
    """

    capture: str
    kind: Kind
    verdict: Verdict
    reason: str | None = None
    to_do: str | None = None
    points: int = 0
    on_sphere: int = 0
    center_mm: list[float] | None = None
    radius_mm: float | None = None
    rms_mm: float | None = None
    point_sigma_mm: float | None = None
    covariance: Rows | None = None
    zone: float | None = None
    extent_deg: float | None = None
    preview: Rows = Field(default_factory=list)
    preview_on_sphere: list[bool] = Field(default_factory=list)
    image_size: tuple[int, int] | None = None
    board_px: Rows = Field(default_factory=list)
    pitch_px: float | None = None
    edge_width_px: float | None = None
    profiles: int | None = None


class Finding(Record):
    """Something that a check of a session found: an error blocks solving, a warning doubts it, a note informs."""

    level: Literal["error", "warning", "note"]
    where: str
    sentence: str


class CameraSegment(Record):
    """One band of depth of a segmental camera."""

    near_mm: float
    far_mm: float
    distortion: dict[str, float]


class RefinedCamera(Record):
    """The camera as it was refined together with the plane of light: the one that belongs to that plane."""

    model: Literal["plain", "rational", "tilted", "segmental"]
    image_size: tuple[int, int]
    camera_matrix: Rows
    distortion: dict[str, float]
    segments: list[CameraSegment] = Field(default_factory=list)


class PlaneInCamera(Record):
    """The plane of light in the camera frame: normal · p = distance, distance not negative."""

    normal: Vector3
    distance_mm: float


class LaserPlaneResidual(CaptureResidual):
    """Figures of one board with the stripe: its points on the plane of light, and its corners."""

    points: int = 0
    line_rms_mm: float | None = None
    line_mean_mm: float | None = None
    stripe_sigma_px: float | None = None
    board_sigma_px: float | None = None
    board_distance_mm: float | None = None


class LaserPlaneResult(Result):
    """The plane of light in the camera frame, and the frame L in it.

    `covariance` is of camera_from_laser, `plane_covariance` (4, 4) of the normal and the distance,
    `joint_covariance` of the camera's parameters named (none where the camera was brought) and normal / distance.
    `camera` is the camera refined together with the plane, where the session's boards gave it.
    """

    stage: Literal["laser-plane"] = "laser-plane"
    plane_in_camera: PlaneInCamera
    camera_from_laser: Matrix4
    plane_rms_mm: float
    covariance: Rows
    plane_covariance: Rows
    camera: RefinedCamera | None = None
    joint_parameters: list[str] = Field(default_factory=list)
    joint_covariance: Rows
    normal_sigma_deg: float
    distance_sigma_mm: float
    residuals: list[LaserPlaneResidual]


class TurntableResidual(CaptureResidual):
    """Measured minus expected sphere centre of one capture of the table: across, around and along its axis.

    `table_deg` is the angle as read, `angle_deg` the part around the axis as an angle of the table.
    """

    mount: str | None = None
    table_deg: float | None = None
    points: int = 0
    surface_rms_mm: float | None = None
    center_distance_mm: float | None = None
    radial_mm: float | None = None
    tangential_mm: float | None = None
    axial_mm: float | None = None
    angle_deg: float | None = None
    center_in_base_mm: list[float] | None = None
    mahalanobis: float | None = None
    side: int | None = None
    profiles: int | None = None
    profiles_used: int | None = None


class TableCircle(Record):
    """The circle of one mounting by the paper's method, in base; the RMS in its plane and out of it."""

    mount: str
    center_in_base_mm: Vector3
    normal_in_base: Vector3
    radius_mm: float
    circle_rms_mm: float
    plane_rms_mm: float
    captures: list[str]


class TableMount(Record):
    """Where one mounting put the sphere's centre, in the turntable's frame at angle zero."""

    mount: str
    center_in_turntable_mm: Vector3
    radius_mm: float
    captures: int


class EncoderScaleError(Record):
    """The table turns by 1 + error for each unit read; `applied` where the answer accounts for it."""

    error: float
    sigma: float
    applied: bool


class TableFields(Record):
    """The turntable's axis and frame T: z the axis, the origin the centre of the first mounting's circle.

    point_in_base = base_from_turntable · Rz(direction · table angle) · point_in_turntable.  `covariance` of
    base_from_turntable has rank 5, since T's x axis follows from z; `axis_direction_sigma_deg` is the standard
    deviation of the angle between true and stated axis.
    """

    base_from_turntable: Matrix4
    axis_direction_in_base: Vector3
    axis_point_in_base_mm: Vector3
    direction: Literal[1, -1]
    axis_direction_covariance: Rows
    axis_point_covariance: Rows
    axis_direction_sigma_deg: float
    axis_point_sigma_mm: float
    mounts: list[TableMount]
    circles: list[TableCircle] = Field(default_factory=list)
    circles_axis_direction_in_base: Vector3 | None = None
    angle_sigma_deg: float
    encoder_scale: EncoderScaleError
    radial_rms_mm: float
    axial_rms_mm: float
    angle_rms_deg: float


class TurntableResult(Result, TableFields):
    """The turntable, with its evidence."""

    stage: Literal["turntable"] = "turntable"
    covariance: Rows
    tool0_from_laser: Matrix4
    undetermined: list[Undetermined] = Field(default_factory=list)
    variance_components: VarianceComponents
    residuals: list[TurntableResidual]


class ChainResult(Result, TableFields):
    """Tool and turntable from all captures together; the stages' own answers stay beside it.

    `covariance` is of tool0_from_laser, `turntable_covariance` of base_from_turntable, `cross_covariance` (6, 6)
    of the two.
    """

    stage: Literal["chain"] = "chain"
    tool0_from_laser: Matrix4
    covariance: Rows
    turntable_covariance: Rows
    cross_covariance: Rows
    sphere_center_in_base_mm: Vector3
    sphere_center_covariance: Rows
    surface_rms_mm: float
    leave_one_out_surface_rms_mm: float | None
    center_scatter_rms_mm: float
    undetermined: list[Undetermined] = Field(default_factory=list)
    two_step: TwoStep
    variance_components: VarianceComponents
    confidence_95: dict[str, float] = Field(default_factory=dict)
    residuals: list[TcpResidual | TurntableResidual]


class MergeResidual(CaptureResidual):
    """Figures of one scan: points kept and dropped by reason, and how it lies to the scans that overlap it.

    `overlap_mean_mm` is how far the scan lies in front of the others, `shift_mm` and `turn_deg` what registration
    did to it.
    """

    points: int = 0
    kept: int = 0
    stray: int = 0
    mixed: int = 0
    grazing: int = 0
    overlap_pairs: int = 0
    overlap_mean_mm: float | None = None
    overlap_rms_mm: float | None = None
    expected_overlap_rms_mm: float | None = None
    shift_mm: float | None = None
    turn_deg: float | None = None


class MergeResult(Result):
    """All scans in one frame, and how far they lie apart where they overlap, before any registration.

    `cloud` and `mesh` name the files, where they were stored; `frame` says whether points are in the turntable's
    frame or, without a turntable, in the robot's base.  `expected_overlap_rms_mm` follows from noise and from what
    the calibration leaves uncertain; `registered_overlap_rms_mm` is that after a registration, and
    `registration_shift_rms_mm` how far it moved the scans.  `surface_sigma_mm` is the standard deviation of the
    merged surface's place along its normal.  `spills` counts how often memory was emptied to disk; `calibrated_by`
    says where tool and table come from: the stage, or "known".
    """

    stage: Literal["merge"] = "merge"
    frame: Literal["turntable", "base"]
    cloud: str | None
    points: int
    scanned_points: int
    voxel_mm: float
    spills: int = 0
    overlap_rms_mm: float | None
    expected_overlap_rms_mm: float | None
    overlap_pairs: int
    registered_overlap_rms_mm: float | None = None
    registration_shift_rms_mm: float | None = None
    surface_sigma_mm: float | None = None
    calibrated_by: Literal["known", "tcp", "turntable", "chain"] | None = None
    tool0_from_laser: Matrix4 | None = None
    base_from_turntable: Matrix4 | None = None
    mesh: str | None
    triangles: int = 0
    low_mm: Vector3
    high_mm: Vector3
    residuals: list[MergeResidual]


class CameraResidual(CaptureResidual):
    """Figures of one view of the board; `points_px` and `residuals_px` (seen minus predicted) draw its arrows."""

    corners: int = 0
    rms_px: float | None = None
    edge_width_px: float | None = None
    camera_from_board: Matrix4 | None = None
    points_px: Rows = Field(default_factory=list)
    residuals_px: Rows = Field(default_factory=list)


class CameraCandidate(Record):
    """A camera model that was compared, and its error on held-out views."""

    model: str
    parameters: int
    held_out_rms_px: float


class CameraCoverage(Record):
    """Where the boards were seen: corners per cell (rows from the top), their depths, the largest tilt."""

    counts: list[list[int]]
    covered: float
    near_mm: float
    far_mm: float
    largest_tilt_rad: float


class CameraResult(Result):
    """The camera, with its evidence; `covariance` is of `parameters`, in their order and units (px, rad, 1).

    `tilt_rad` are the sensor's two angles, also in `distortion` as tauX and tauY.
    """

    stage: Literal["camera"] = "camera"
    model: Literal["plain", "rational", "tilted", "segmental"]
    image_size: tuple[int, int]
    camera_matrix: Rows
    distortion: dict[str, float]
    tilt_rad: list[float]
    segments: list[CameraSegment] = Field(default_factory=list)
    reprojection_rms_px: float
    corner_sigma_px: float
    parameters: list[str]
    covariance: Rows
    tilt_correlation: float | None = None
    board_bend_mm: float | None = None
    candidates: list[CameraCandidate] = Field(default_factory=list)
    coverage: CameraCoverage
    residuals: list[CameraResidual]


GuideStatus = Literal["done", "working", "todo", "later", "stale", "failing", "known", "not-needed"]


class GuideStep(Record):
    """One step of the way and how far it is; computed, never stored."""

    step: Literal["camera", "laser-plane", "tcp", "turntable", "verify", "scan", "merge"]
    status: GuideStatus
    note: str | None = None


class GuideNow(Record):
    """The one thing to do now.

    `drawing` names the picture beside it.  `suggested_pose` is base_from_tool0 of a capture that would help, and
    `suggested_pose_numbers` the same as the controller writes it.
    """

    step: str
    stage: Stage | None = None
    action: Literal["capture", "solve", "review"]
    instruction: str
    why: str
    exit: str
    drawing: str
    progress: str | None = None
    still_needed: int = 0
    suggested_pose: Matrix4 | None = None
    suggested_pose_numbers: list[float] | None = None
    suggested_note: str | None = None


class GuideLast(Record):
    """How the last capture was, and what to do where it was not good."""

    capture: str
    verdict: Verdict
    reason: str | None = None
    to_do: str | None = None


class Guide(Record):
    """What to do now and why, how much is still needed, and where every step stands."""

    steps: list[GuideStep]
    current: GuideNow
    last_capture: GuideLast | None = None


def parse_session(data: Mapping[str, Any], where: str = "session.json") -> Session:
    """Return the session that JSON data describes.

    Raises
    ------
    InputError
        With the field that is at fault and what it should hold.
    """
    return _parse(Session, data, where)


def parse_capture(data: Mapping[str, Any], where: str = "capture") -> Capture:
    """Return the capture that JSON data describes; raises InputError."""
    return _parse(Capture, data, where)


def parse_cell(data: Mapping[str, Any], where: str = "cell") -> Cell:
    """Return the cell that JSON data describes; raises InputError."""
    return _parse(Cell, data, where)


_R = TypeVar("_R", bound=Record)


def _parse(model: type[_R], data: Mapping[str, Any], where: str) -> _R:
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise input_error(error, data, where) from None


def input_error(error: ValidationError, data: Any, where: str) -> InputError:
    """Return a validation error as need, got and what to do, naming the capture it stands in."""
    return input_error_from_details(error.errors(include_url=False), data, where)


def input_error_from_details(details: Sequence[Any], data: Any, where: str) -> InputError:
    """Return the first of pydantic's error details as need, got and to_do (a request's `body` is left out)."""
    first = details[0]
    place = _place(first["loc"][1:] if first["loc"][:1] == ("body",) else first["loc"], data)
    value = repr(first["input"])
    got = value if len(value) < 80 else value[:77] + "…"
    to_do = "Correct this field."
    message = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    if first["type"] == "missing":
        got, message = "nothing", f"the field '{first['loc'][-1]}'"
        to_do = "Add it."
    elif first["loc"] and first["loc"][-1] == "pose_convention":
        message = "one of the pose conventions " + ", ".join(get_args(PoseConvention))
        to_do = "Name the controller's convention."
    elif first["type"] == "value_error" and len(parts := first["ctx"]["error"].args) == 4:
        _, message, got, to_do = parts  # of a `_mismatch`
    more = len(details) - 1
    if more:
        to_do += f" ({more} more field{'s' if more > 1 else ''} will need attention.)"
    return InputError(message[0].lower() + message[1:], got, to_do, f"{where}: {place}" if place else where)


def _place(location: tuple[int | str, ...], data: Any) -> str:
    """Return a path like `captures[p05].pose`, captures by their id."""
    text = ""
    for key in location:
        name: object = key
        try:
            data = data[key]
            if isinstance(key, int) and isinstance(data, Mapping) and "id" in data:
                name = data["id"]
        except (KeyError, IndexError, TypeError):
            data = None
        text += f"[{name}]" if isinstance(key, int) else f".{key}" if text else str(key)
    return text
