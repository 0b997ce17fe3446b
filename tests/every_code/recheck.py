"""Rows of rechecks and of the board as a second opinion: what they say at either side of their limits."""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache

import numpy as np

from calib_core.findings import Finding
from calib_core.frames import RigidTransform
from calib_core.optics.hand_eye import HandEye
from calib_core.records import Session
from calib_core.simulation import retake
from calib_core.stages.hand_eye.solve import agreement_of, hand_eye_findings
from calib_core.stages.pipeline import solve_stage
from tests.every_code.made import Case, made

STILL = RigidTransform.of(np.zeros(3), np.zeros(3), "tool0", "laser")


@cache
def _again(shift_mm: float, count: int, off_mm: float) -> list[Finding]:
    cell = made("tcp", 2)
    data, files = cell.session.to_json(), dict(cell.files)
    assert cell.world is not None
    tool = cell.world.tool0_from_laser.copy()
    tool[0, 3] += shift_mm
    moved = replace(cell, world=replace(cell.world, tool0_from_laser=tool))
    for number, name in enumerate(("p02", "p08", "p12", "p14")[:count]):
        record, own = retake(moved, name, f"r-{name}", 7)
        told = {**record.to_json(), "step": "recheck"}
        told["pose"][0] += off_mm * (number == 3)
        data["captures"].append(told)
        files |= own
    return list(solve_stage(Session.model_validate(data), "recheck", files.__getitem__).findings)


def again(shift_mm: float = 0.0, count: int = 3, off_mm: float = 0.0) -> Case:
    """Return what a recheck says, the scanner shifted by so much, the fourth capture so far beside its pose."""
    return lambda: _again(shift_mm, count, off_mm)


def by_board(sigma_mm: float = 0.1, off_mm: float = 0.0) -> Case:
    """Return what a board says of a tool that it knows so well, the sphere's answer so far off."""

    def case() -> Iterable[Finding]:
        covariance = np.diag([1e-8] * 3 + [sigma_mm**2] * 3)
        found = HandEye(STILL, STILL, 1.0, np.zeros(0), covariance, 0.05, 1e-4)
        other = STILL.perturbed(np.array([0, 0, 0, off_mm, 0, 0]))
        return hand_eye_findings(found, agreement_of("tcp", STILL, covariance, other, 1e-12 * np.eye(6)))

    return case


CASES: dict[str, tuple[Case, Case]] = {
    "calibration-holds": (again(), again(1.5)),
    "calibration-changed": (again(1.5), again()),
    "few-poses-repeated": (again(count=2), again(count=3)),
    "pose-not-repeated": (again(count=4, off_mm=21.0), again(count=4, off_mm=19.0)),
    "camera-on-flange-weak": (by_board(sigma_mm=1.1), by_board(sigma_mm=0.9)),
    "board-and-sphere-differ": (by_board(off_mm=0.42), by_board(off_mm=0.40)),
}
