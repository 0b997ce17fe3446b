"""The result of a recheck."""

from typing import Literal

from pydantic import Field

from calib_core.records.base import Finite, Record, Vector3
from calib_core.records.results import CaptureResidual, Result

Changed = Literal["nothing", "tool", "sphere", "tool-or-sphere", "joint", "unclear"]
"""What a recheck finds: `unclear` is a difference that no changed tool, moved sphere or bumped joint explains."""


class RecheckResidual(CaptureResidual):
    """One repeated capture: which it repeats, and how far it saw the sphere from where that one had seen it.

    `expected_mm` is what noise and the robot's repeatability make of `change_mm` (root mean square), `mahalanobis`
    the change in standard deviations.
    """

    repeats: str | None = None
    round: int | None = None
    change_mm: float | None = None
    expected_mm: float | None = None
    mahalanobis: float | None = None
    pose_distance_mm: float | None = None
    pose_turn_deg: float | None = None


class RecheckRound(Record):
    """One round of a recheck: each pose captured once.

    `change_mm` ± `uncertainty_mm` (k = 2, worst direction) is how far the scanner now sees a point of the
    workpiece from where it saw it at the calibration, `change_in_laser_mm` the same by axis; of several scanners
    it is `scanner`, the one whose change is least likely chance.  `chance` is how
    often an unchanged cell shows as much.  `joint` is the one whose zero moved, counted from 1, by `joint_deg` ±
    `joint_uncertainty_deg` (k = 2), where that explains the change.
    """

    captures: list[str]
    scanner: str | None = None
    change_mm: float
    uncertainty_mm: float
    change_in_laser_mm: Vector3
    chance: Finite
    changed: Changed
    joint: int | None = None
    joint_deg: float | None = None
    joint_uncertainty_deg: float | None = None
    sentence: str


class RecheckResult(Result):
    """Whether the calibration still holds.

    `rounds` are in order of their captures; the last one decides: `holds`, `changed` and the verdict are its own.
    `rechecked` names the stage whose answer it is.
    """

    stage: Literal["recheck"] = "recheck"
    rechecked: str
    holds: bool
    changed: Changed
    change_mm: float
    uncertainty_mm: float
    rounds: list[RecheckRound] = Field(default_factory=list[RecheckRound])
    residuals: list[RecheckResidual]
