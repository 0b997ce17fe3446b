"""What a capture was measured to be, what is wrong with a session, and what to do next."""

from typing import Literal

from pydantic import Field

from calib_core.records.base import GuidedStep, Kind, Matrix4, Record, Rows, StageName, Verdict
from calib_core.records.findings import Finding, Severity


class Still(Record):
    """Whether a capture's exposures at one commanded pose show the sphere at one place.

    `movement_mm` is the root mean square of what is beyond noise in centre and radius of the arc, `noise_mm` what
    noise alone gives, `chance` how often noise alone scatters as much.
    """

    exposures: int
    movement_mm: float
    noise_mm: float
    chance: float
    stands_still: bool


class Measured(Record):
    """What was seen in one capture of the sphere, in the scanner's frame L, and how good it is.

    A profile's `center_mm` and the rows of `preview` are [x, z] of the plane of light; those of a cloud or a
    centre are [x, y, z].  `zone` is r/R, the circle's radius over the sphere's; `extent_deg` the length of the
    arc seen.  A frame's `preview` are pixels of `image_size` (width, height).  A sweep's `profiles` are those in
    which the sphere's arc is found; its figures are of the one with the largest circle, its points of all.

    Of a frame of the board: `board_px` are its corners, `pitch_px` how far they stand apart (the nearer the board,
    the farther), `edge_width_px` the rise of its squares' edges from 10 to 90 %: how sharp the frame is;
    `pixel_from_board` the homography (3, 3) from its plane, mm, to pixels.

    `without_ray` counts stripe centres of raw frames that were dropped: they lie beyond the fold of the camera's
    distortion, where a pixel has no ray.

    `still` tells of standstill where the capture has several exposures at one pose; of one it cannot be told.

    So many neighbouring points of a profile as `points_per_independent` say what one alone would.

    `verdict`, `reason` and `to_do` are made of `findings`.
    """

    capture: str
    kind: Kind
    verdict: Verdict
    findings: list[Finding] = Field(default_factory=list[Finding])
    reason: str | None = None
    to_do: str | None = None
    points: int = 0
    on_sphere: int = 0
    without_ray: int = 0
    center_mm: list[float] | None = None
    radius_mm: float | None = None
    rms_mm: float | None = None
    point_sigma_mm: float | None = None
    points_per_independent: float | None = None
    covariance: Rows | None = None
    zone: float | None = None
    extent_deg: float | None = None
    preview: Rows = Field(default_factory=list)
    preview_on_sphere: list[bool] = Field(default_factory=list)
    image_size: tuple[int, int] | None = None
    board_px: Rows = Field(default_factory=list)
    pitch_px: float | None = None
    pixel_from_board: Rows | None = None
    edge_width_px: float | None = None
    profiles: int | None = None
    still: Still | None = None


class CheckLine(Record):
    """A finding of a check as a line: how severe it is, where, and what with what to do."""

    level: Severity
    where: str
    sentence: str


GuideStatus = Literal["done", "working", "todo", "later", "stale", "failing", "known", "not-needed"]


class GuideStep(Record):
    """One step of the way and how far it is; computed, never stored.

    `title` is what it is called where the cell is another than a scanner on the flange and a turntable.
    """

    step: GuidedStep
    status: GuideStatus
    title: str | None = None
    note: str | None = None


class MeterPoint(Record):
    """How well the workpiece was known after a capture, ± mm (k = 2); null where a direction was still open."""

    capture: str
    uncertainty_mm: float | None


class Meter(Record):
    """How well a point of the workpiece is known by now, and how well it should be; every ± is k = 2, in mm.

    `uncertainty_mm` is null where a direction is still open; `after_next_mm` is what the proposed pose will leave;
    `still_needed` how many more captures, each the best next one, reach `wanted_mm`: null where more than a dozen
    would not. `history` has one point a capture, in their order.
    """

    uncertainty_mm: float | None
    wanted_mm: float | None = None
    after_next_mm: float | None = None
    still_needed: int | None = None
    enough: bool = False
    stated: bool = False
    history: list[MeterPoint] = Field(default_factory=list[MeterPoint])


class GuideNow(Record):
    """The one thing to do now.

    `drawing` names the picture beside it.  `suggested_pose` is base_from_tool0 of a capture that would help, and
    `suggested_pose_numbers` the same as the controller writes it; `suggested_table_deg` is the table's
    angle for it, as read. `meter` tells what the captures are worth at the
    workpiece; its `stated` says that this is a result's own figure and not a prediction.
    """

    step: str
    stage: StageName | None = None
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
    suggested_table_deg: float | None = None
    meter: Meter | None = None


class GuideLast(Record):
    """How the last capture was, and what to do where it was not good."""

    capture: str
    verdict: Verdict
    findings: list[Finding] = Field(default_factory=list[Finding])
    reason: str | None = None
    to_do: str | None = None


class BoardFacing(Record):
    """Which way the board of a capture faces, before there is a camera.

    `facing_rad` is its tilt as turned to the right and to the lower edge of the image, [0, 0] seen squarely, and
    `nearness` how large it looks beside the largest.
    """

    capture: str
    facing_rad: tuple[float, float]
    nearness: float


class BoardsSeen(Record):
    """Where the boards of a step's frames were seen so far.

    `covered` is the share of the image's parts with a corner, as the camera's result counts them; `depth_ratio`
    how many times as large the nearest board looks as the farthest, `one_distance` says that this is too little.
    `facing` is empty until the boards' tilts say what the focal length is.
    """

    step: str
    frames: int
    covered: float
    depth_ratio: float
    one_distance: bool
    facing: list[BoardFacing] = Field(default_factory=list[BoardFacing])


class Guide(Record):
    """What to do now and why, how much is still needed, and where every step stands.

    `findings` are those of the last capture, and of the result that `current` is about.
    """

    steps: list[GuideStep]
    current: GuideNow
    findings: list[Finding] = Field(default_factory=list[Finding])
    last_capture: GuideLast | None = None
    coverage: list[BoardsSeen] = Field(default_factory=list[BoardsSeen])
