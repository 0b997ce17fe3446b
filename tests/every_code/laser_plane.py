"""Rows of the plane of light: a solved one with a figure at either side of its limit."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from calib_core.optics.focus_change import FocusChange
from calib_core.optics.laser_plane import plane_findings
from calib_core.optics.laser_plane_joint import Joint
from calib_core.optics.laser_plane_solve import PlaneSolution, solve_plane, why_held
from calib_core.stages.laser_plane.solve import lines_not_used, noticed
from tests.core.test_optics_plane import CAMERA, views
from tests.every_code.made import Case


@cache
def right() -> PlaneSolution:
    """Return the plane of eight good boards."""
    return solve_plane(CAMERA, views(1))


def plane(normal_sigma_deg: float = 0.05, **fields: Any) -> Case:
    """Return what is noticed of a right plane with other figures."""
    return lambda: noticed(replace(right(), **fields), normal_sigma_deg)


def across(share: float) -> Case:
    """Return what is noticed where the lines lie such a share of their length apart."""
    return lambda: plane_findings(
        replace(right().fit, width_mm=share * right().fit.length_mm), right().lines, 0.05
    )


def boards(count: int) -> Case:
    """Return what is noticed where so many boards carry the plane."""

    def found() -> Any:
        inliers = tuple(one & (k < count) for k, one in enumerate(right().fit.inliers))
        return plane_findings(replace(right().fit, inliers=inliers), right().lines, 0.05)

    return found


def near_camera(sigmas: float) -> Case:
    """Return what is noticed of a plane that passes the camera's centre so many standard deviations beside it."""
    covariance = np.diag([0, 0, 0, 1.0])
    return plane(distance_mm=sigmas, covariance=covariance)


def left_out(*why: str | None) -> Case:
    """Return what is noticed, and which lines are not used, where lines are left out for these reasons."""

    def case() -> Any:
        seen = tuple(
            replace(one, left_out=reason)
            for one, reason in zip(right().views, [*why, *[None] * (8 - len(why))], strict=True)
        )
        solution = replace(right(), views=seen)
        return [*noticed(solution, 0.05), *lines_not_used(solution, {}, 8)]

    return case


def held(moved_sigmas: float) -> Case:
    """Return why a camera is held whose refinement moved it so many standard deviations."""

    def case() -> Any:
        none: Any = None
        joint = Joint(CAMERA, np.zeros(3), np.zeros((3, 3)), none, None, 1.0, moved_sigmas)
        return filter(None, [why_held(joint)])

    return case


CASES: dict[str, tuple[Case, Case]] = {
    "line-off-plane": (left_out("off-plane"), left_out("no-line")),
    "no-line-on-board": (left_out("no-line"), left_out("off-plane")),
    "board-lines-close": (across(0.099), across(0.101)),
    "plane-normal-weak": (plane(0.11), plane(0.09)),
    "few-boards-carry-plane": (boards(3), boards(4)),
    "plane-not-determined": (plane(rms_mm=np.inf), plane(rms_mm=1e3)),
    "board-pitch-unit": (
        plane(fit=replace(right().fit, length_mm=0.49)),
        plane(fit=replace(right().fit, length_mm=0.51)),
    ),
    "plane-normal-open": (plane(2.1), plane(1.9)),
    "plane-through-camera": (near_camera(2.9), near_camera(3.1)),
    "most-lines-off-plane": (left_out(*["off-plane"] * 5), left_out(*["off-plane"] * 4)),
    "focus-changed": (plane(focus=FocusChange(0.994, 0.0014)), plane(focus=FocusChange(0.994, 0.0016))),
    "camera-not-refined": (held(3.1), held(2.9)),
}
