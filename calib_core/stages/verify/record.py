"""The result of the verification."""

from typing import Literal

from pydantic import Field

from calib_core.cell.found import ScannerPlaced
from calib_core.records.base import Record, Rows, Vector3
from calib_core.records.results import CaptureResidual, Result


class VerifyResidual(CaptureResidual):
    """Where one held-out capture saw the sphere: its own centre, off the one that all of them agree on.

    `expected_center_distance_mm` is what the uncertainty of the capture and of the answer make of that distance,
    `mahalanobis` how far its figures are from the expected ones in standard deviations.  Of a capture of the flat
    plate `plane_offset_mm` is how far its points lie from the plane of all on average, `surface_rms_mm` how they
    scatter.
    """

    points: int = 0
    surface_rms_mm: float | None = None
    center_offset_in_base_mm: list[float] | None = None
    center_distance_mm: float | None = None
    expected_center_distance_mm: float | None = None
    mahalanobis: float | None = None
    side: int | None = None
    zone: float | None = None
    profiles: int | None = None
    plane_offset_mm: float | None = None


Decision = Literal["pass", "conditional-pass", "undecided", "conditional-fail", "fail"]


class VerifyCheck(Record):
    """One figure of a verification, its expanded uncertainty (k = 2), and the limit that was set for it before."""

    name: str
    title: str
    value_mm: float
    uncertainty_mm: float
    limit_mm: float | None = None
    decision: Decision | None = None
    reason: str = ""


class VerifyResult(Result, ScannerPlaced):
    """How far the sphere's centre scatters over captures that the answer was not solved from.

    `held_out_scatter_rms_mm` is the root mean square of the captures' distances to the sphere's centre, which is
    in tool0 where the flange carries it, the other field null; `expected_scatter_rms_mm` follows from their own
    uncertainty, the robot's and the answer's, and is null where the tool was brought without any.  `chi_squared`
    has `degrees_of_freedom`; `chance` is how often a right answer shows as large a one, and
    `moved_chance` how often it lets another tool explain as much of it.  Where a flat plate alone
    was captured, what is of the sphere is null.  `verified` names the stage whose answer it is, or "known".

    `checks` are the figures that limits may be set for (`cell.verification`), 2634-style; `decision` is the worst
    of theirs, `undecided` where too few captures count or U is above a limit, null where no limit was set.
    `limits_changed` says in sentences which limits were changed after the first capture: where they let more pass
    now, a decision of `pass` has the verdict `warn`.
    """

    stage: Literal["verify"] = "verify"
    verified: str
    sphere_center_in_base_mm: Vector3 | None
    sphere_center_in_tool0_mm: Vector3 | None = None
    sphere_center_covariance: Rows | None
    surface_rms_mm: float | None
    held_out_scatter_rms_mm: float | None
    expected_scatter_rms_mm: float | None
    chi_squared: float | None
    degrees_of_freedom: int
    chance: float | None
    moved_chance: float | None = None
    checks: list[VerifyCheck] = Field(default_factory=list[VerifyCheck])
    decision: Decision | None = None
    limits_changed: list[str] = Field(default_factory=list[str])
    residuals: list[VerifyResidual]
