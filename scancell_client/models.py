"""Results and answers as records, made by `scancell schema python-models`, not to be edited."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field


class Record(BaseModel):
    """Part of an answer; what a newer server adds is kept, too."""

    model_config = ConfigDict(extra="allow", frozen=True, populate_by_name=True, protected_namespaces=())


class Agreement(Record):
    """How far the scanner on the flange by the board lies from the sphere's."""
    with_stage: str
    angle_deg: float
    shift_mm: float
    sigmas: list[float]
    distance: float
    degrees_of_freedom: int | None = None
    chance: float


class Alignment(Record):
    """Where the nominal part lies: `base_from_reference` with its covariance (6, 6) of rx ry rz tx ty tz, the rotation on the right, rad and mm, of the fit and of what calibration and scans leave uncertain."""
    method: Literal['none', 'best-fit', '3-2-1', 'datums', 'matrix']
    rms_mm: float | None = None
    base_from_reference: list[list[float]]
    cloud_from_reference: list[list[float]]
    covariance: list[list[float]] | None = None
    alike: int | None = None
    datums: list[DatumFound] | None = None
    reference_sha256: str


class AnsweredFrame(Record):
    """A frame: 4×4 rows in mm, its covariance, and the same as the cell's controller writes it."""
    matrix: list[list[float]]
    covariance: list[list[float]]
    numbers: list[float]
    number_sigmas: list[float]


class ArmErrorsFound(Record):
    """How an answer's errors are correlated with the arm's: where a scan is taken, both cancel in part."""
    poses: list[list[list[float]]]
    middle_mm: list[float]
    lengths_sigma: float
    position_sigma_mm: float
    orientation_sigma_rad: float
    tool_with_lengths: list[float]
    tool_with_poses: list[list[list[float]]]
    scanner_with_lengths: list[float]
    scanner_with_poses: list[list[list[float]]]
    table_with_lengths: list[float] | None = None
    table_with_poses: list[list[list[float]]] | None = None
    tool_with_terms: list[list[float]] | None = None
    scanner_with_terms: list[list[float]] | None = None
    table_with_terms: list[list[float]] | None = None
    terms_with_lengths: list[float] | None = None
    terms_with_poses: list[list[list[float]]] | None = None
    term_moves: list[list[list[float]]] | None = None


class ArmModelFound(Record):
    """The arm's own errors as the captures tell them, by the names of its terms, which end in their units."""
    names: list[str]
    values: list[float]
    sigmas: list[float]
    members: list[str] | None = None
    held_out_rms_mm: list[float]
    decided_by: Literal['held-out', 'likelihood'] | None = None
    worth_it: bool
    applied: bool | None = None
    controller: list[FoundFrame] | None = None
    told: ArmTerms | None = None
    covariance: list[list[float]] | None = None


class ArmTerms(Record):
    """What the captures alone tell of an arm's errors, in units of what is `believed` of each (one σ)."""
    names: list[str]
    believed: list[float]
    information: list[list[float]]
    vector: list[float]


class AtPoint(Record):
    """How well a point is known that the scanner measures where it saw the sphere, scanner and tool together."""
    point_in_laser_mm: list[float]
    covariance: list[list[float]]


class AtWorkpiece(Record):
    """How well a point of the workpiece is known by one frame, or by tool and table together."""
    of: Literal['tool', 'table', 'both']
    where: str | None = None
    point_mm: list[float]
    sigmas_mm: list[float]
    worst_sigma_mm: float


class Axis(Record):
    """A plot's axis: what it shows, in which unit, and from where to where (None: as far as the points go)."""
    label: str
    unit: str | None = None
    low: float | None = None
    high: float | None = None


class Band(Record):
    """Where points are expected on the y axis."""
    low: float
    high: float
    label: str


class BeforeAfter(Record):
    """A figure as it is now and as it is with the remedy applied, None where it cannot be known before solving."""
    label: str
    unit: str | None = None
    before: float | None
    after: float | None


class CameraByRobot(Record):
    """What the robot's poses say of the camera, where it was carried past a fixed board."""
    views: int
    pitch_factor: float
    pitch_sigma: float
    focal_px: list[float]
    focal_sigma_px: list[float]
    chance: float
    position_sigma_mm: float
    orientation_sigma_deg: float


class CameraCandidate(Record):
    """A camera model that was compared, with a flat board or a `bent` one, and its error on held-out views."""
    model: str
    parameters: int
    held_out_rms_px: float
    bent: bool | None = None


class CameraCoverage(Record):
    """Where the boards were seen: corners per cell (rows from the top), their depths, the largest tilt."""
    counts: list[list[int]]
    covered: float
    near_mm: float
    far_mm: float
    largest_tilt_rad: float
    projection_sigma_px: list[list[float | None]] | None = None


class CameraResidual(Record):
    """Figures of one view of the board; `points_px` and `residuals_px` (seen minus predicted) draw its arrows."""
    capture: str
    used: bool
    reason: str | None = None
    corners: int | None = None
    rms_px: float | None = None
    edge_width_px: float | None = None
    camera_from_board: list[list[float]] | None = None
    points_px: list[list[float]] | None = None
    residuals_px: list[list[float]] | None = None


class CameraSegment(Record):
    """One band of depth of a segmental camera."""
    near_mm: float
    far_mm: float
    distortion: dict[str, float]


class Changes(Record):
    """Changes of a session: merge patches (RFC 7396) of its cell and, by id, of its captures."""
    cell: dict[str, Any] | None = None
    captures: dict[str, Any] | None = None


class Column(Record):
    """A table's column, with unit and decimals of its plain numbers."""
    label: str
    unit: str | None = None
    decimals: int | None = None
    align: Literal['left', 'right'] | None = None
    own: bool | None = None


class DatumFound(Record):
    """A datum as the merged points have it: `off_mm` is how far from the nominal's after the alignment, `rms_mm` what its points are off it."""
    kind: Literal['plane', 'sphere']
    at_mm: list[float]
    radius_mm: float
    off_mm: float
    rms_mm: float


class DecidedBefore(Record):
    """A decision that was made before captures were left out, added or changed, a limit (by figure) or the cell."""
    decision: str
    solved: str | None = None
    left_out: list[LeftOut] | None = None
    added: list[str] | None = None
    limits: list[str] | None = None
    taken_back: list[LeftOut] | None = None
    came: list[LeftOut] | None = None
    changed: list[LeftOut] | None = None
    cell: list[str] | None = None
    otherwise: bool | None = None
    removed: bool | None = None
    text: str | None = None


class Deviation(Record):
    """How far the merged points lie off the nominal, positive outside."""
    rms_mm: float
    within_95_mm: float
    signed_mean_mm: float
    uncertainty_mm: float | None = None
    points: int
    counted: float
    across_edges: int | None = None
    limit_mm: float
    histogram: list[int]
    extremes: list[ExtremePoint] | None = None
    tolerance_mm: float | None = None
    within_tolerance: float | None = None
    above_tolerance: float | None = None
    below_tolerance: float | None = None
    sections: list[PartSection] | None = None


class EncoderScaleError(Record):
    """The table turns by 1 + error for each unit read; `applied` where the answer accounts for it."""
    error: float
    sigma: float
    applied: bool


class Equipment(Record):
    """A piece of equipment by its identification; another serial number is another piece."""
    kind: str
    name: str | None = None
    model: str | None = None
    serial: str | None = None
    certificate: EquipmentCertificate | None = None
    expansion_per_k: float | None = None
    reference_c: float | None = None
    register_id: str | None = None


class EquipmentCertificate(Record):
    """A calibration certificate: number, laboratory, dates (ISO 8601) and its file in the session."""
    number: str | None = None
    laboratory: str | None = None
    issued: str | None = None
    due: str | None = None
    file: str | None = None


class Excluded(Record):
    """Who left a capture out, took it in again, added or corrected it, when (ISO 8601) and why."""
    who: str | None = None
    when: str | None = None
    why: str | None = None


class ExtremePoint(Record):
    """A place in the cloud's frame, and how far it lies off the nominal."""
    point_mm: list[float]
    deviation_mm: float


class Facing(Record):
    """What says which way is out: shares of patches before and behind a scan's own, and of a closed surface."""
    certain: bool
    before: float
    behind: float
    volume: float | None = None
    missing: float


class Figure(Record):
    """One number with its label; figures that follow each other make one list."""
    id: str | None = None
    title: str | None = None
    detail: bool | None = None
    kind: Literal['figure'] | None = None
    label: str
    quantity: Quantity | None = None
    text: str | None = None
    limit: Quantity | None = None
    limit_label: str | None = None
    remark: str | None = None
    headline: bool | None = None


class Finding(Record):
    """Something that was noticed."""
    code: str
    severity: Literal['error', 'warning', 'note']
    captures: list[str] | None = None
    values: dict[str, int | float | str] | None = None
    text: str
    to_do: str | None = None
    remedy: RootCause | None = None
    where: str | None = None
    each: dict[str, dict[str, int | float | str]] | None = None
    messages: dict[str, MessageParts] | None = None
    behind: str | None = None


class FlangeReading(Record):
    """Whose all poses are: a tool on the flange, in a frame; null where it is the flange, or the base."""
    tool0_from_tool: list[list[float]] | None = None
    base_from_frame: list[list[float]] | None = None


class FoundAxis(Record):
    """An axis `in` base, as it stands there where all axes read zero."""
    name: str
    in_: str = Field(alias="in")
    kind: Literal['rotary', 'linear']
    axis_direction: list[float | None]
    axis_point_mm: list[float | None] | None = None
    direction: Literal[1, -1] | None = None
    scale: float | None = None
    scale_sigma: float | None = None
    covariance: list[list[float | None]]


class FoundFrame(Record):
    """A transform `into` `outof`: 4×4 rows in mm, its covariance 6×6 of rx ry rz tx ty tz in rad and mm."""
    into: str
    outof: str
    scanner: str | None = None
    matrix: list[list[float | None]]
    covariance: list[list[float | None]] | None = None


class FoundSphere(Record):
    """Where a ball's centre is `in` what carries it, its covariance (3, 3) in mm², and who saw it."""
    name: str
    in_: str = Field(alias="in")
    center_mm: list[float | None]
    covariance: list[list[float | None]]
    captures: list[str] | None = None


class Frame(Record):
    """A transform into_from_outof with its covariance (6, 6; rx ry rz tx ty tz, rad and mm)."""
    id: str | None = None
    title: str | None = None
    detail: bool | None = None
    kind: Literal['frame'] | None = None
    name: str
    into: str
    outof: str
    matrix: list[list[float]]
    covariance: list[list[float]] | None = None
    convention: str
    units: str | None = None
    formula: str | None = None
    numbers: list[FrameNumber] | None = None


class FrameNumber(Record):
    """One number of a frame in a controller's convention."""
    label: str
    quantity: Quantity


class HandEyeResidual(Record):
    """How far one frame saw the board from where the robot's pose puts it: in degrees, mm, and sigmas of six."""
    capture: str
    used: bool
    reason: str | None = None
    angle_deg: float | None = None
    shift_mm: float | None = None
    mahalanobis: float | None = None


class LaserPlaneResidual(Record):
    """Figures of one board with the stripe: its points on the plane of light, and its corners."""
    capture: str
    used: bool
    reason: str | None = None
    points: int | None = None
    line_rms_mm: float | None = None
    line_mean_mm: float | None = None
    stripe_sigma_px: float | None = None
    board_sigma_px: float | None = None
    board_distance_mm: float | None = None


class LeftInFiles(Record):
    """By how much an answer is off for errors of the scanner that were found and stay in its files."""
    tool: list[float]
    scanner: list[float]
    turntable: list[float] | None = None


class LeftOut(Record):
    """A capture that was left out after a decision, taken in again, added or changed, and why where that was told."""
    capture: str
    because: Excluded | None = None
    deleted: bool | None = None
    fields: list[str] | None = None


class MergeResidual(Record):
    """Figures of one scan: points kept and dropped by reason, and how it lies to the scans that overlap it."""
    capture: str
    used: bool
    reason: str | None = None
    points: int | None = None
    kept: int | None = None
    stray: int | None = None
    mixed: int | None = None
    grazing: int | None = None
    overlap_pairs: int | None = None
    overlap_mean_mm: float | None = None
    overlap_rms_mm: float | None = None
    expected_overlap_rms_mm: float | None = None
    shift_mm: float | None = None
    turn_deg: float | None = None
    cloud_from_laser: list[list[float]] | None = None


class MessageParts(Record):
    """A value that is a message itself, so that it can be said in another language."""
    template: str
    values: dict[str, Any] | None = None
    many: str | None = None
    by: str | None = None


class Note(Record):
    """A sentence or two; `level` is a verdict where it carries one."""
    id: str | None = None
    title: str | None = None
    detail: bool | None = None
    kind: Literal['note'] | None = None
    text: str
    level: Literal['pass', 'warn', 'fail'] | Literal['info'] | None = None


class OpticsShift(Record):
    """What one standard deviation of camera or plane of light, along one direction, does to an answer."""
    source: Literal['camera', 'plane']
    tool: list[float]
    turntable: list[float] | None = None
    scanner: list[float]
    at_mm: list[float]
    point_mm: list[float]
    by_place: list[list[float]]


class PartSection(Record):
    """The part cut across an axis of the nominal's frame, in its other two axes."""
    axis: Literal['x', 'y', 'z']
    at_mm: float
    magnified: float
    nominal: list[list[float]]
    points: list[list[float]]


class Picture(Record):
    """A picture: a named `drawing` of a stage, or a `file` of a `capture`. `alt` says what there is to see."""
    id: str | None = None
    title: str | None = None
    detail: bool | None = None
    kind: Literal['picture'] | None = None
    drawing: str | None = None
    capture: str | None = None
    file: str | None = None
    alt: str


class PlaneInCamera(Record):
    """The plane of light in the camera frame: normal · p = distance, distance not negative."""
    normal: list[float]
    distance_mm: float


class Plot(Record):
    """A picture of numbers; `caption` says what it shows and how to read it."""
    id: str | None = None
    title: str | None = None
    detail: bool | None = None
    kind: Literal['plot'] | None = None
    shape: Literal['captures', 'line', 'xy', 'histogram', 'grid', 'section']
    caption: str
    x: Axis
    y: Axis
    series: list[Series]
    band: Band | None = None


class PoseReading(Record):
    """How the numbers of all poses are to be read instead: by a convention, in these units, this way round."""
    convention: str
    mm_per_unit: float
    radians: bool
    way: Literal['as-written', 'inverted', 'transposed', 'columns']


class PoseScatter(Record):
    """How far poses scatter, found from the scans' overlap: per axis, about the middle of all; and the surface."""
    position_sigma_mm: float
    orientation_sigma_deg: float
    surface_sigma_mm: float


class Quantity(Record):
    """A number as it is shown: with `decimals` digits after the point, its unit and its expanded uncertainty."""
    value: float | None
    unit: str | None = None
    uncertainty: float | None = None
    decimals: int | None = None


class RecheckResidual(Record):
    """One repeated capture: which it repeats, and how far it saw the sphere from where that one had seen it."""
    capture: str
    used: bool
    reason: str | None = None
    repeats: str | None = None
    round: int | None = None
    change_mm: float | None = None
    expected_mm: float | None = None
    mahalanobis: float | None = None
    pose_distance_mm: float | None = None
    pose_turn_deg: float | None = None


class RecheckRound(Record):
    """One round of a recheck: each pose captured once."""
    captures: list[str]
    scanner: str | None = None
    change_mm: float
    uncertainty_mm: float
    change_in_laser_mm: list[float]
    chance: float
    changed: Literal['nothing', 'tool', 'sphere', 'tool-or-sphere', 'joint', 'unclear']
    joint: int | None = None
    joint_deg: float | None = None
    joint_uncertainty_deg: float | None = None
    sentence: str


class RefinedCamera(Record):
    """The camera as it was refined together with the plane of light: the one that belongs to that plane."""
    model: Literal['plain', 'rational', 'tilted', 'segmental']
    image_size: list[Any]
    camera_matrix: list[list[float]]
    distortion: dict[str, float]
    segments: list[CameraSegment] | None = None


class RootCause(Record):
    """One root cause: what it is, as title and sentence, what speaks for it, and exactly what Apply changes."""
    id: str
    kind: Literal['pose-reading', 'swapped-poses', 'shifted-poses', 'moved-sphere', 'changed-tool', 'sphere-diameter', 'point-unit', 'scaled-profile', 'table-direction', 'table-angles', 'not-the-flange', 'scan-elsewhere', 'scanner-axis', 'pose-list-order']
    title: str | None = None
    sentence: str | None = None
    evidence: list[BeforeAfter] | None = None
    captures: list[str] | None = None
    changes: Changes | None = None
    pose_reading: PoseReading | None = None
    poses_from: dict[str, str] | None = None
    table_reading: TableReading | None = None
    point_settings: dict[str, Any] | None = None
    flange_reading: FlangeReading | None = None


class Row(Record):
    """A table's row: texts, numbers (a quantity brings its own unit), or None where there is nothing."""
    cells: list[str | float | Quantity | None]
    capture: str | None = None
    used: bool | None = None
    reason: str | None = None


class ScannerFound(Record):
    """What was found of sphere and scanner with the tool, in the order of `names`, and how both are correlated."""
    names: list[str]
    values: list[float]
    sigmas: list[float]
    covariance: list[list[float]]
    covariance_with_tool: list[list[float]]
    applied: bool
    sphere_diameter_sigma_mm: float
    covariance_with_table: list[list[float]] | None = None
    half_width_mm: float | None = None
    facing: int | None = None
    left_in_files: LeftInFiles | None = None
    sheet_bend_mm: float | None = None


class Series(Record):
    """Points of one kind: `x` (empty: 0, 1, 2, …) and `y`, None where there is no value."""
    label: str | None = None
    x: list[float] | None = None
    y: list[float | None]
    captures: list[str] | None = None
    reasons: list[str | None] | None = None


class SessionAnswer(Record):
    """The answer of a session: of `chain` or, without a table, of `tcp`."""
    format: str | None = None
    session: str
    cell: str
    stage: str
    verdict: Literal['pass', 'warn', 'fail']
    stale: bool
    faults: list[str]
    findings: list[Finding] | None = None
    warnings: list[str]
    undetermined: list[Any]
    solved: str | None
    software: str
    inputs_sha256: dict[str, str]
    pose_convention: str
    names: list[str]
    units: str
    tool0_from_laser: AnsweredFrame | None
    base_from_laser: AnsweredFrame | None = None
    base_from_turntable: AnsweredFrame | None
    laser_from_turntable: AnsweredFrame | None = None
    position_sigma_mm: float | None
    rotation_sigma_deg: float | None
    budget: Any = None
    decision: str | None = None
    limits_changed: list[str] | None = None
    frames: list[FoundFrame] | None = None
    workpiece_sigma_mm: float | None = None
    verified: str | None = None
    decided_before: list[DecidedBefore] | None = None
    equipment: list[Equipment] | None = None


class SessionDrift(Record):
    """How far scanner or sphere drifted from the first used capture to the last, ± `uncertainty_mm` (k = 2)."""
    moved: Literal['scanner', 'sphere', 'scanner-or-sphere']
    drift_mm: float
    uncertainty_mm: float
    found: bool
    settled: bool
    over_s: float | None = None
    settling_s: float | None = None
    again: list[str] | None = None
    sentence: str | None = None
    points: list[SessionDriftPoint] | None = None


class SessionDriftPoint(Record):
    """One used capture: how far it lies along the drift, and what the drift says; `at_s` from the first."""
    capture: str
    at_s: float | None
    offset_mm: float
    sigma_mm: float
    course_mm: float


class SharedShift(Record):
    """What the scans' overlap adds to the calibration that they share."""
    directions: int
    shift: list[float]
    covariance: list[list[float]]


class SolvedBoardShape(Record):
    """How a board leaves its plane: mm of x², xy, y², x³, x²y, xy², y³, places scaled to ±1 about its middle."""
    coefficients_mm: list[float]
    extent_mm: list[list[float]]


class CameraResult(Record):
    """The camera, with its evidence; `covariance` is of `parameters`, in their order and units (px, rad, 1)."""
    stale: bool
    at_workpiece: list[AtWorkpiece] | None = None
    turned_deg: dict[str, float] | None = None
    decided_before: list[DecidedBefore] | None = None
    method: str
    method_revision: int | None = None
    software: str
    inputs_sha256: str
    verdict: Literal['pass', 'warn', 'fail']
    pose_convention: Literal['matrix', 'quaternion-xyzw', 'quaternion-wxyz', 'abb', 'kuka', 'fanuc', 'ur', 'staubli', 'kawasaki', 'mitsubishi', 'yaskawa', 'nachi', 'ros'] | None = None
    solved: str | None = None
    provenance: Literal['solved', 'imported', 'replayed', 'differs'] | None = None
    seal: dict[str, Any] | None = None
    findings: list[Finding] | None = None
    warnings: list[str] | None = None
    notes: list[str] | None = None
    causes: list[RootCause] | None = None
    frames: list[FoundFrame] | None = None
    evidence: list[Figure | Frame | Table | Plot | Picture | Note] | None = None
    stage: Literal['camera'] | None = None
    model: Literal['plain', 'rational', 'tilted', 'segmental']
    image_size: list[Any]
    camera_matrix: list[list[float]]
    distortion: dict[str, float]
    tilt_rad: list[float]
    segments: list[CameraSegment] | None = None
    reprojection_rms_px: float
    corner_sigma_px: float
    parameters: list[str]
    covariance: list[list[float]]
    inflation: float | None = None
    tilt_correlation: float | None = None
    board_bend_mm: float | None = None
    board_shape: SolvedBoardShape | None = None
    candidates: list[CameraCandidate] | None = None
    coverage: CameraCoverage
    by_robot: CameraByRobot | None = None
    residuals: list[CameraResidual]


class ChainResult(Record):
    """Tool and turntable from all captures together; the stages' own answers stay beside it."""
    stale: bool
    at_workpiece: list[AtWorkpiece] | None = None
    turned_deg: dict[str, float] | None = None
    decided_before: list[DecidedBefore] | None = None
    base_from_turntable: list[list[float | None]]
    axis_direction_in_base: list[float | None]
    axis_point_in_base_mm: list[float | None]
    direction: Literal[1, -1]
    axis_direction_covariance: list[list[float | None]]
    axis_point_covariance: list[list[float | None]]
    axis_direction_sigma_deg: float | None
    axis_point_sigma_mm: float | None
    mounts: list[TableMount]
    circles: list[TableCircle] | None = None
    circles_axis_direction_in_base: list[float] | None = None
    angle_sigma_deg: float
    reading_sigma_mm: float | None = None
    encoder_scale: EncoderScaleError
    radial_rms_mm: float
    axial_rms_mm: float
    angle_rms_deg: float
    spheres: list[FoundSphere] | None = None
    axes: list[FoundAxis] | None = None
    tool0_from_laser: list[list[float | None]] | None = None
    base_from_laser: list[list[float | None]] | None = None
    up_to_shift: UpToShift | None = None
    method: str
    method_revision: int | None = None
    software: str
    inputs_sha256: str
    verdict: Literal['pass', 'warn', 'fail']
    pose_convention: Literal['matrix', 'quaternion-xyzw', 'quaternion-wxyz', 'abb', 'kuka', 'fanuc', 'ur', 'staubli', 'kawasaki', 'mitsubishi', 'yaskawa', 'nachi', 'ros'] | None = None
    solved: str | None = None
    provenance: Literal['solved', 'imported', 'replayed', 'differs'] | None = None
    seal: dict[str, Any] | None = None
    findings: list[Finding] | None = None
    warnings: list[str] | None = None
    notes: list[str] | None = None
    causes: list[RootCause] | None = None
    frames: list[FoundFrame] | None = None
    evidence: list[Figure | Frame | Table | Plot | Picture | Note] | None = None
    covariance: list[list[float | None]]
    sphere_center_in_base_mm: list[float] | None = None
    sphere_center_in_tool0_mm: list[float] | None = None
    sphere_center_covariance: list[list[float | None]]
    surface_rms_mm: float
    leave_one_out_surface_rms_mm: float | None
    center_scatter_rms_mm: float
    undetermined: list[Undetermined] | None = None
    two_step: TwoStep
    variance_components: VarianceComponents
    scanner: ScannerFound | str | None = None
    scanner_errors: dict[str, ScannerFound] | None = None
    optics: list[OpticsShift] | None = None
    workpiece: AtPoint | None = None
    arm_errors: ArmErrorsFound | None = None
    arm_model: ArmModelFound | None = None
    confidence_95: dict[str, float] | None = None
    stage: Literal['chain'] | None = None
    turntable_covariance: list[list[float | None]]
    cross_covariance: list[list[float | None]]
    residuals: list[TcpResidual | TurntableResidual]


class HandEyeResult(Record):
    """The camera on the flange and the board in the base, from frames of a fixed board; or the other way round."""
    stale: bool
    at_workpiece: list[AtWorkpiece] | None = None
    turned_deg: dict[str, float] | None = None
    decided_before: list[DecidedBefore] | None = None
    method: str
    method_revision: int | None = None
    software: str
    inputs_sha256: str
    verdict: Literal['pass', 'warn', 'fail']
    pose_convention: Literal['matrix', 'quaternion-xyzw', 'quaternion-wxyz', 'abb', 'kuka', 'fanuc', 'ur', 'staubli', 'kawasaki', 'mitsubishi', 'yaskawa', 'nachi', 'ros'] | None = None
    solved: str | None = None
    provenance: Literal['solved', 'imported', 'replayed', 'differs'] | None = None
    seal: dict[str, Any] | None = None
    findings: list[Finding] | None = None
    warnings: list[str] | None = None
    notes: list[str] | None = None
    causes: list[RootCause] | None = None
    frames: list[FoundFrame] | None = None
    evidence: list[Figure | Frame | Table | Plot | Picture | Note] | None = None
    stage: Literal['hand-eye'] | None = None
    tool0_from_camera: list[list[float]] | None = None
    base_from_camera: list[list[float]] | None = None
    covariance: list[list[float]]
    base_from_board: list[list[float]] | None = None
    tool0_from_board: list[list[float]] | None = None
    board_covariance: list[list[float]]
    pitch_factor: float | None = None
    pitch_sigma: float | None = None
    position_sigma_mm: float
    orientation_sigma_deg: float
    tool0_from_laser_by_board: list[list[float]] | None = None
    base_from_laser_by_board: list[list[float]] | None = None
    laser_covariance: list[list[float]] | None = None
    agreement: Agreement | None = None
    residuals: list[HandEyeResidual] | None = None


class LaserPlaneResult(Record):
    """The plane of light in the camera frame, and the frame L in it."""
    stale: bool
    at_workpiece: list[AtWorkpiece] | None = None
    turned_deg: dict[str, float] | None = None
    decided_before: list[DecidedBefore] | None = None
    method: str
    method_revision: int | None = None
    software: str
    inputs_sha256: str
    verdict: Literal['pass', 'warn', 'fail']
    pose_convention: Literal['matrix', 'quaternion-xyzw', 'quaternion-wxyz', 'abb', 'kuka', 'fanuc', 'ur', 'staubli', 'kawasaki', 'mitsubishi', 'yaskawa', 'nachi', 'ros'] | None = None
    solved: str | None = None
    provenance: Literal['solved', 'imported', 'replayed', 'differs'] | None = None
    seal: dict[str, Any] | None = None
    findings: list[Finding] | None = None
    warnings: list[str] | None = None
    notes: list[str] | None = None
    causes: list[RootCause] | None = None
    frames: list[FoundFrame] | None = None
    evidence: list[Figure | Frame | Table | Plot | Picture | Note] | None = None
    stage: Literal['laser-plane'] | None = None
    plane_in_camera: PlaneInCamera
    camera_from_laser: list[list[float]]
    plane_rms_mm: float
    covariance: list[list[float]]
    plane_covariance: list[list[float]]
    camera: RefinedCamera | None = None
    joint_parameters: list[str] | None = None
    joint_covariance: list[list[float]]
    normal_sigma_deg: float
    distance_sigma_mm: float
    residuals: list[LaserPlaneResidual]


class MergeResult(Record):
    """All scans in one frame, and how far they lie apart where they overlap, before any registration."""
    stale: bool
    at_workpiece: list[AtWorkpiece] | None = None
    turned_deg: dict[str, float] | None = None
    decided_before: list[DecidedBefore] | None = None
    tool0_from_laser: list[list[float | None]] | None = None
    base_from_laser: list[list[float | None]] | None = None
    up_to_shift: UpToShift | None = None
    method: str
    method_revision: int | None = None
    software: str
    inputs_sha256: str
    verdict: Literal['pass', 'warn', 'fail']
    pose_convention: Literal['matrix', 'quaternion-xyzw', 'quaternion-wxyz', 'abb', 'kuka', 'fanuc', 'ur', 'staubli', 'kawasaki', 'mitsubishi', 'yaskawa', 'nachi', 'ros'] | None = None
    solved: str | None = None
    provenance: Literal['solved', 'imported', 'replayed', 'differs'] | None = None
    seal: dict[str, Any] | None = None
    findings: list[Finding] | None = None
    warnings: list[str] | None = None
    notes: list[str] | None = None
    causes: list[RootCause] | None = None
    frames: list[FoundFrame] | None = None
    evidence: list[Figure | Frame | Table | Plot | Picture | Note] | None = None
    stage: Literal['merge'] | None = None
    frame: Literal['turntable', 'base', 'tool0']
    cloud: str | None
    with_intensity: bool | None = None
    points: int
    scanned_points: int
    voxel_mm: float
    spills: int | None = None
    overlap_rms_mm: float | None
    expected_overlap_rms_mm: float | None
    overlap_expected_mm: float | None = None
    overlap_pairs: int
    normals_outward: str | None = None
    facing: Facing | None = None
    pose_scatter: PoseScatter | None = None
    registered_overlap_rms_mm: float | None = None
    registration_shift_rms_mm: float | None = None
    self_calibration: SharedShift | None = None
    surface_sigma_mm: float | None = None
    calibrated_by: str | None = None
    base_from_turntable: list[list[float]] | None = None
    mesh: str | None
    triangles: int | None = None
    mesh_open_edges: int | None = None
    low_mm: list[float]
    high_mm: list[float]
    alignment: Alignment | None = None
    deviation: Deviation | None = None
    residuals: list[MergeResidual]


class RecheckResult(Record):
    """Whether the calibration still holds."""
    stale: bool
    at_workpiece: list[AtWorkpiece] | None = None
    turned_deg: dict[str, float] | None = None
    decided_before: list[DecidedBefore] | None = None
    method: str
    method_revision: int | None = None
    software: str
    inputs_sha256: str
    verdict: Literal['pass', 'warn', 'fail']
    pose_convention: Literal['matrix', 'quaternion-xyzw', 'quaternion-wxyz', 'abb', 'kuka', 'fanuc', 'ur', 'staubli', 'kawasaki', 'mitsubishi', 'yaskawa', 'nachi', 'ros'] | None = None
    solved: str | None = None
    provenance: Literal['solved', 'imported', 'replayed', 'differs'] | None = None
    seal: dict[str, Any] | None = None
    findings: list[Finding] | None = None
    warnings: list[str] | None = None
    notes: list[str] | None = None
    causes: list[RootCause] | None = None
    frames: list[FoundFrame] | None = None
    evidence: list[Figure | Frame | Table | Plot | Picture | Note] | None = None
    stage: Literal['recheck'] | None = None
    rechecked: str
    holds: bool
    changed: Literal['nothing', 'tool', 'sphere', 'tool-or-sphere', 'joint', 'unclear']
    change_mm: float
    uncertainty_mm: float
    rounds: list[RecheckRound] | None = None
    residuals: list[RecheckResidual]


class TcpResult(Record):
    """The scanner's pose on the flange, with its evidence. As the server keeps it."""
    stale: bool
    at_workpiece: list[AtWorkpiece] | None = None
    turned_deg: dict[str, float] | None = None
    decided_before: list[DecidedBefore] | None = None
    spheres: list[FoundSphere] | None = None
    axes: list[FoundAxis] | None = None
    tool0_from_laser: list[list[float | None]] | None = None
    base_from_laser: list[list[float | None]] | None = None
    up_to_shift: UpToShift | None = None
    method: str
    method_revision: int | None = None
    software: str
    inputs_sha256: str
    verdict: Literal['pass', 'warn', 'fail']
    pose_convention: Literal['matrix', 'quaternion-xyzw', 'quaternion-wxyz', 'abb', 'kuka', 'fanuc', 'ur', 'staubli', 'kawasaki', 'mitsubishi', 'yaskawa', 'nachi', 'ros'] | None = None
    solved: str | None = None
    provenance: Literal['solved', 'imported', 'replayed', 'differs'] | None = None
    seal: dict[str, Any] | None = None
    findings: list[Finding] | None = None
    warnings: list[str] | None = None
    notes: list[str] | None = None
    causes: list[RootCause] | None = None
    frames: list[FoundFrame] | None = None
    evidence: list[Figure | Frame | Table | Plot | Picture | Note] | None = None
    covariance: list[list[float | None]]
    sphere_center_in_base_mm: list[float] | None = None
    sphere_center_in_tool0_mm: list[float] | None = None
    sphere_center_covariance: list[list[float | None]]
    surface_rms_mm: float
    leave_one_out_surface_rms_mm: float | None
    center_scatter_rms_mm: float
    undetermined: list[Undetermined] | None = None
    two_step: TwoStep
    variance_components: VarianceComponents
    scanner: ScannerFound | str | None = None
    scanner_errors: dict[str, ScannerFound] | None = None
    optics: list[OpticsShift] | None = None
    workpiece: AtPoint | None = None
    arm_errors: ArmErrorsFound | None = None
    arm_model: ArmModelFound | None = None
    confidence_95: dict[str, float] | None = None
    stage: Literal['tcp'] | None = None
    warm_up: SessionDrift | None = None
    residuals: list[TcpResidual]


class TurntableResult(Record):
    """The turntable, with its evidence; the scanner's pose that it rests on is on the flange or in base. As the server keeps it."""
    stale: bool
    at_workpiece: list[AtWorkpiece] | None = None
    turned_deg: dict[str, float] | None = None
    decided_before: list[DecidedBefore] | None = None
    spheres: list[FoundSphere] | None = None
    axes: list[FoundAxis] | None = None
    tool0_from_laser: list[list[float | None]] | None = None
    base_from_laser: list[list[float | None]] | None = None
    up_to_shift: UpToShift | None = None
    base_from_turntable: list[list[float | None]]
    axis_direction_in_base: list[float | None]
    axis_point_in_base_mm: list[float | None]
    direction: Literal[1, -1]
    axis_direction_covariance: list[list[float | None]]
    axis_point_covariance: list[list[float | None]]
    axis_direction_sigma_deg: float | None
    axis_point_sigma_mm: float | None
    mounts: list[TableMount]
    circles: list[TableCircle] | None = None
    circles_axis_direction_in_base: list[float] | None = None
    angle_sigma_deg: float
    reading_sigma_mm: float | None = None
    encoder_scale: EncoderScaleError
    radial_rms_mm: float
    axial_rms_mm: float
    angle_rms_deg: float
    method: str
    method_revision: int | None = None
    software: str
    inputs_sha256: str
    verdict: Literal['pass', 'warn', 'fail']
    pose_convention: Literal['matrix', 'quaternion-xyzw', 'quaternion-wxyz', 'abb', 'kuka', 'fanuc', 'ur', 'staubli', 'kawasaki', 'mitsubishi', 'yaskawa', 'nachi', 'ros'] | None = None
    solved: str | None = None
    provenance: Literal['solved', 'imported', 'replayed', 'differs'] | None = None
    seal: dict[str, Any] | None = None
    findings: list[Finding] | None = None
    warnings: list[str] | None = None
    notes: list[str] | None = None
    causes: list[RootCause] | None = None
    frames: list[FoundFrame] | None = None
    evidence: list[Figure | Frame | Table | Plot | Picture | Note] | None = None
    stage: Literal['turntable'] | None = None
    covariance: list[list[float | None]]
    undetermined: list[Undetermined] | None = None
    variance_components: VarianceComponents
    residuals: list[TurntableResidual]


class VerifyResult(Record):
    """How far the sphere's centre scatters over captures that the answer was not solved from."""
    stale: bool
    at_workpiece: list[AtWorkpiece] | None = None
    turned_deg: dict[str, float] | None = None
    decided_before: list[DecidedBefore] | None = None
    tool0_from_laser: list[list[float | None]] | None = None
    base_from_laser: list[list[float | None]] | None = None
    up_to_shift: UpToShift | None = None
    method: str
    method_revision: int | None = None
    software: str
    inputs_sha256: str
    verdict: Literal['pass', 'warn', 'fail']
    pose_convention: Literal['matrix', 'quaternion-xyzw', 'quaternion-wxyz', 'abb', 'kuka', 'fanuc', 'ur', 'staubli', 'kawasaki', 'mitsubishi', 'yaskawa', 'nachi', 'ros'] | None = None
    solved: str | None = None
    provenance: Literal['solved', 'imported', 'replayed', 'differs'] | None = None
    seal: dict[str, Any] | None = None
    findings: list[Finding] | None = None
    warnings: list[str] | None = None
    notes: list[str] | None = None
    causes: list[RootCause] | None = None
    frames: list[FoundFrame] | None = None
    evidence: list[Figure | Frame | Table | Plot | Picture | Note] | None = None
    stage: Literal['verify'] | None = None
    verified: str
    sphere_center_in_base_mm: list[float] | None
    sphere_center_in_tool0_mm: list[float] | None = None
    sphere_center_covariance: list[list[float]] | None
    surface_rms_mm: float | None
    held_out_scatter_rms_mm: float | None
    expected_scatter_rms_mm: float | None
    chi_squared: float | None
    degrees_of_freedom: int
    chance: float | None
    moved_chance: float | None = None
    checks: list[VerifyCheck] | None = None
    decision: Literal['pass', 'conditional-pass', 'undecided', 'conditional-fail', 'fail'] | None = None
    limits_changed: list[str] | None = None
    residuals: list[VerifyResidual]


class Table(Record):
    """Rows under columns; the first column heads its row. `caption` says what the table shows."""
    id: str | None = None
    title: str | None = None
    detail: bool | None = None
    kind: Literal['table'] | None = None
    caption: str | None = None
    columns: list[Column]
    rows: list[Row]


class TableCircle(Record):
    """The circle of one mounting by the paper's method, in base; the RMS in its plane and out of it."""
    mount: str
    center_in_base_mm: list[float]
    normal_in_base: list[float]
    radius_mm: float
    circle_rms_mm: float
    plane_rms_mm: float
    captures: list[str]


class TableMount(Record):
    """Where one mounting put the sphere's centre, in the turntable's frame at angle zero."""
    mount: str
    center_in_turntable_mm: list[float]
    radius_mm: float
    captures: int


class TableReading(Record):
    """How the table's angles are to be read instead: times `factor`, plus `offset_deg` from capture `since` on."""
    factor: float | None = None
    offset_deg: float | None = None
    since: str | None = None


class TcpResidual(Record):
    """Figures of one capture of the sphere, in millimetres unless the name says otherwise."""
    capture: str
    used: bool
    reason: str | None = None
    points: int | None = None
    surface_rms_mm: float | None = None
    center_distance_mm: float | None = None
    center_offset_in_base_mm: list[float] | None = None
    center_offset_in_tool0_mm: list[float] | None = None
    leave_one_out_rms_mm: float | None = None
    two_step_surface_rms_mm: float | None = None
    mahalanobis: float | None = None
    weight: float | None = None
    side: int | None = None
    zone: float | None = None
    shift_without_mm: float | None = None
    turn_without_deg: float | None = None
    growth_without: float | None = None
    profiles: int | None = None
    profiles_used: int | None = None


class TurntableResidual(Record):
    """Measured minus expected sphere centre of one capture of the table: across, around and along its axis."""
    capture: str
    used: bool
    reason: str | None = None
    mount: str | None = None
    table_deg: float | None = None
    points: int | None = None
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


class TwoStep(Record):
    """The paper's two-step answer, beside the joint one."""
    tool0_from_laser: list[list[float | None]] | None = None
    base_from_laser: list[list[float | None]] | None = None
    up_to_shift: UpToShift | None = None
    sphere_center_in_base_mm: list[float] | None = None
    sphere_center_in_tool0_mm: list[float] | None = None
    surface_rms_mm: float | None = None
    leave_one_out_surface_rms_mm: float | None = None
    center_scatter_rms_mm: float | None = None
    covariance: list[list[float]] | None = None
    translations: list[list[str]] | None = None
    reason: str | None = None


class Undetermined(Record):
    """A direction of the answer that the motions do not fix."""
    direction: list[float]
    description: str


class UpToShift(Record):
    """Scanner and table up to one shift of both, by a machine that did not turn enough to tell more."""
    directions: list[list[float]]
    travel: list[float] | None = None
    own_base: Literal[True] | None = None
    tool0_from_laser: list[list[float]] | None = None
    base_from_laser: list[list[float]] | None = None
    base_from_turntable: list[list[float]] | None = None
    covariance: list[list[float]]
    turntable_covariance: list[list[float]] | None = None
    cross_covariance: list[list[float]] | None = None
    axes: list[FoundAxis] | None = None
    frames: list[FoundFrame] | None = None


class VarianceComponents(Record):
    """Standard deviations of the point noise and of the robot's pose errors."""
    point_sigma_mm: float | None
    position_sigma_mm: float
    orientation_sigma_rad: float
    orientation_sigma_deg: float
    estimated: list[str] | None = None
    alike_position_sigma_mm: float | None = None
    alike_orientation_sigma_rad: float | None = None
    reach_mm: float | None = None
    reach_rad: float | None = None
    points_per_independent: float | None = None
    degrees_of_freedom: float | None = None
    play_sigma_mm: float | None = None


class VerifyCheck(Record):
    """One figure of a verification, its expanded uncertainty (k = 2), and the limit that was set for it before."""
    name: str
    title: str
    value_mm: float
    uncertainty_mm: float
    limit_mm: float | None = None
    decision: Literal['pass', 'conditional-pass', 'undecided', 'conditional-fail', 'fail'] | None = None
    reason: str | None = None


class VerifyResidual(Record):
    """Where one held-out capture saw the sphere: its own centre, off the one that all of them agree on."""
    capture: str
    used: bool
    reason: str | None = None
    points: int | None = None
    surface_rms_mm: float | None = None
    center_offset_in_base_mm: list[float] | None = None
    center_distance_mm: float | None = None
    expected_center_distance_mm: float | None = None
    mahalanobis: float | None = None
    side: int | None = None
    zone: float | None = None
    profiles: int | None = None
    plane_offset_mm: float | None = None


RESULTS: dict[str, type[Record]] = {
    "camera": CameraResult,
    "laser-plane": LaserPlaneResult,
    "tcp": TcpResult,
    "turntable": TurntableResult,
    "chain": ChainResult,
    "hand-eye": HandEyeResult,
    "verify": VerifyResult,
    "recheck": RecheckResult,
    "merge": MergeResult,
}
