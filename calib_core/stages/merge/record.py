"""The result of the merge."""

from typing import Literal

import numpy as np
from pydantic import Field

from calib_core.cell.found import ScannerPlaced
from calib_core.formats.format import ScanPlace
from calib_core.records.base import Matrix4, Record, Vector3
from calib_core.records.results import CaptureResidual, Result


class MergeResidual(CaptureResidual):
    """Figures of one scan: points kept and dropped by reason, and how it lies to the scans that overlap it.

    `overlap_mean_mm` is how far the scan lies in front of the others, `shift_mm` and `turn_deg` what registration
    did to it.  `cloud_from_laser` is where its scanner stood in the middle of it, as the cloud has it.
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
    cloud_from_laser: Matrix4 | None = None


class SharedShift(Record):
    """What the scans' overlap adds to the calibration that they share.

    `shift` is that of the scanner, then of base_from_turntable: rx ry rz tx ty tz each, rotation perturbing
    on the right, rad and mm; `covariance` (12, 12) is theirs after it.  `directions` counts those that the overlap
    determines 4.5 times better than the captures did; no other is moved.
    """

    directions: int
    shift: list[float]
    covariance: list[list[float]]


class Facing(Record):
    """What says which way is out: shares of patches before and behind a scan's own, and of a closed surface.

    `before` and `behind` are those of the patches that other scans have seen along each scan's line of sight:
    before its own surface nothing can lie.  `volume` is that of the merged surface beside a ball's of the same
    area, as it is written, `missing` what it lacks of a closed one.
    """

    certain: bool
    before: float
    behind: float
    volume: float | None = None
    missing: float


class PoseScatter(Record):
    """How far poses scatter, found from the scans' overlap: per axis, about the middle of all; and the surface."""

    position_sigma_mm: float
    orientation_sigma_deg: float
    surface_sigma_mm: float


class DatumFound(Record):
    """A datum as the merged points have it: `off_mm` is how far from the nominal's after the alignment, `rms_mm`
    what its points are off it.
    """

    kind: Literal["plane", "sphere"]
    at_mm: Vector3
    radius_mm: float
    off_mm: float
    rms_mm: float


class Alignment(Record):
    """Where the nominal part lies: `base_from_reference` with its covariance (6, 6) of rx ry rz tx ty tz, the
    rotation on the right, rad and mm, of the fit and of what calibration and scans leave uncertain.

    `rms_mm` is that of the distances that the method goes by, `alike` counts other poses that fit as well, as
    those of a symmetric part do.  `datums` are those that it goes by, in the nominal's frame.
    `cloud_from_reference` is into the cloud's own frame;
    `reference_sha256` is the nominal's file.
    """

    method: Literal["none", "best-fit", "3-2-1", "datums", "matrix"]
    rms_mm: float | None = None
    base_from_reference: Matrix4
    cloud_from_reference: Matrix4
    covariance: list[list[float]] | None = None
    alike: int = 0
    datums: list[DatumFound] = Field(default_factory=list[DatumFound])
    reference_sha256: str


class ExtremePoint(Record):
    """A place in the cloud's frame, and how far it lies off the nominal."""

    point_mm: Vector3
    deviation_mm: float


class PartSection(Record):
    """The part cut across an axis of the nominal's frame, in its other two axes.

    `nominal` are its lines (u v to u v), `points` the merged ones (u, v), `magnified` times as far off.
    """

    axis: Literal["x", "y", "z"]
    at_mm: float
    magnified: float
    nominal: list[list[float]]
    points: list[list[float]]


class Deviation(Record):
    """How far the merged points lie off the nominal, positive outside.

    `counted` is the share of the points that are of the part: others, such as a fixture's, lie farther off than a
    twentieth of its size.  `across_edges` points are not compared: the mean of a voxel across an edge or of both
    sides of a sheet lies on no face.  `within_95_mm` holds 95 % of the others in either direction.
    `uncertainty_mm` is the standard deviation of a point's deviation by calibration, scans and noise, RMS over
    all, after the alignment.
    `histogram` counts them in even bins from −`limit_mm` to `limit_mm`; `extremes` are the farthest, outside
    first, apart from each other.  `within_tolerance` is the share within ± `tolerance_mm`, `above_tolerance` and
    `below_tolerance` are those farther outside and inside.  `sections` go through the nominal's middle.
    """

    rms_mm: float
    within_95_mm: float
    signed_mean_mm: float
    uncertainty_mm: float | None = None
    points: int
    counted: float
    across_edges: int = 0
    limit_mm: float
    histogram: list[int]
    extremes: list[ExtremePoint] = Field(default_factory=list[ExtremePoint])
    tolerance_mm: float | None = None
    within_tolerance: float | None = None
    above_tolerance: float | None = None
    below_tolerance: float | None = None
    sections: list[PartSection] = Field(default_factory=list[PartSection])


class MergeResult(Result, ScannerPlaced):
    """All scans in one frame, and how far they lie apart where they overlap, before any registration.

    `cloud` and `mesh` name the files, where they were stored; `frame` says whether points are in the frame of the
    turntable, without one in the robot's base, or on the flange that holds the part.  `expected_overlap_rms_mm`
    follows from noise and from what the calibration leaves uncertain; `registered_overlap_rms_mm` is that after a
    registration, and `registration_shift_rms_mm` how far it moved the scans.  `surface_sigma_mm` is the standard
    deviation of the merged surface's place along its normal.  `spills` counts how often memory was emptied to
    disk; `calibrated_by` says where tool and table come from: the stage, or "known".  `normals_outward` is how
    it was decided which way is out: "told" by `scanner.z_axis`, by captures of the "ball", by "visibility" (who
    sees whom), by a scanner's "rays" that run apart, by the surface's "volume", by the "distance" to the scanner's
    own zero, or "assumed"; `facing` has the figures.  `pose_scatter` is what the overlap says of poses where no
    calibration tells it.  `mesh_open_edges` is 0 of a watertight mesh.  `alignment` and `deviation`
    compare the part with its nominal, where one is told.  `with_intensity` says that the scans brought how bright
    points came back, and the cloud has it.
    """

    stage: Literal["merge"] = "merge"
    frame: Literal["turntable", "base", "tool0"]
    cloud: str | None
    with_intensity: bool = False
    points: int
    scanned_points: int
    voxel_mm: float
    spills: int = 0
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
    base_from_turntable: Matrix4 | None = None
    mesh: str | None
    triangles: int = 0
    mesh_open_edges: int | None = None
    low_mm: Vector3
    high_mm: Vector3
    alignment: Alignment | None = None
    deviation: Deviation | None = None
    residuals: list[MergeResidual]

    @property
    def scan_names(self) -> tuple[str, ...]:
        """The scans that were merged, as the cloud's column `scan` counts them: by their first captures."""
        return tuple(row.capture for row in self.residuals if row.used and row.points)

    @property
    def scan_places(self) -> tuple[ScanPlace, ...]:
        """The same scans with their poses; none where an earlier version did not write them."""
        rows = [row for row in self.residuals if row.used and row.points]
        poses = [row.cloud_from_laser for row in rows if row.cloud_from_laser is not None]
        if len(poses) < len(rows):
            return ()
        return tuple(ScanPlace(row.capture, np.array(pose)) for row, pose in zip(rows, poses, strict=True))
