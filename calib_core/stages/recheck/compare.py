"""Captures of a still sphere compared with those of the same poses before: what changed, and by how much.

The robot repeats a pose far better than it reaches it, and its errors are alike where poses are alike; so the
differences of repeated captures tell a change that the answer's own covariance would hide.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib_core.chain.observations import Observations, SphereObservation
from calib_core.estimation import chance_of, covariance_of
from calib_core.frames import FloatArray
from calib_core.stages.recheck.record import Changed
from calib_core.stages.verify.joint_moved import SHIFTED_MM, TURNED_RAD, Bump, bumped, by_errors_of_arm
from calib_core.stages.verify.seen import block_diagonal, linearised
from calib_core.stages.verify.tool import Tool

_FALSE_ALARM = 0.005  # of each of the three tests; together they stay below 2 %
_EXPLAINED = 0.01
_PRIOR_MM = 1000.0  # of a shift, only so that one that the captures leave open has a large uncertainty


@dataclass(frozen=True)
class Alike:
    """How errors of the arm are alike where poses are alike: what is left of them when a pose is nearly repeated.

    Parameters
    ----------
    position_sigma_mm, orientation_sigma_rad : float
    reach_mm, reach_rad : float
        Zero where no such errors were found.
    """

    position_sigma_mm: float = 0.0
    orientation_sigma_rad: float = 0.0
    reach_mm: float = 0.0
    reach_rad: float = 0.0

    def apart(self, then: SphereObservation, now: SphereObservation) -> float:
        """Return the share (0 to 2) of their variance that does not cancel between two poses."""
        difference = now.base_from_tool0.difference(then.base_from_tool0)
        exponent = 0.0
        for step, reach in ((difference[3:], self.reach_mm), (difference[:3], self.reach_rad)):
            exponent += float(step @ step) / (2 * reach**2) if reach > 0 else 0.0
        return 2 * (1 - float(np.exp(-exponent)))


@dataclass(frozen=True, eq=False)
class Change:
    """What K repeated captures say.

    Attributes
    ----------
    shift_in_laser_mm : (3,)
        How far the scanner now sees a point from where it saw it then.
    covariance : (3, 3)
    changed : str
    chance : float
        The smallest chance of the tests, times their number.
    differences : (K, 3)
        Figures now minus then, the change of the pose taken out.
    covariances : (K, 3, 3)
    bump : Bump or None
        Of the joint, where the zero of one explains the change.
    """

    shift_in_laser_mm: FloatArray
    covariance: FloatArray
    changed: Changed
    chance: float
    differences: FloatArray
    covariances: FloatArray
    bump: Bump | None = None

    @property
    def change_mm(self) -> float:
        """The length of the shift."""
        return float(np.linalg.norm(self.shift_in_laser_mm))

    @property
    def uncertainty_mm(self) -> float:
        """Of the shift in its worst direction, k = 2."""
        return 2 * float(np.sqrt(np.linalg.eigvalsh(self.covariance)[-1]))

    @property
    def mahalanobis(self) -> FloatArray:
        """Each capture's difference in its standard deviations (K,)."""
        weighed = np.linalg.solve(self.covariances, self.differences[..., None])[..., 0]
        return np.sqrt(np.sum(self.differences * weighed, axis=1))


def compared(
    then: Observations,
    now: Observations,
    radius_mm: float,
    center_mm: FloatArray,
    tool: Tool,
    alike: Alike | None = None,
    zeros: Mapping[int, int] | None = None,
    scanners: int = 1,
) -> Change:
    """Return what changed between captures of the same poses.

    Parameters
    ----------
    then, now : K observations each, the k-th of one pose
    radius_mm : float
    center_mm : (3,) or (K, 3)
        The sphere as the calibration found it on what carries it; or each capture's, of several.
    tool : Tool
        The calibration's; of its uncertainty only that of the robot's poses counts, for the tool's own cancels.
    alike : Alike, optional
    zeros : mapping, optional
        By joints, counted from 1, which of the arm's terms is its zero.
    scanners : int
        So many are compared, each by itself: together they raise no more false alarms than one.

    Notes
    -----
    Tested are a shift of the scanner on what carries it (3 degrees of freedom), one of the spheres (3), and
    whatever else moves the figures (3 K).  What is named is what explains them: a tool that shifted and turned, a
    sphere that shifted, or one joint's zero where that is far likelier than either.
    """
    before, noise_before, _, _, _ = linearised(then, radius_mm, center_mm, tool)
    after, noise_after, by_center, by_tool, _ = linearised(now, radius_mm, center_mm, tool)
    differences = after - before
    covariances = noise_before + noise_after + _not_cancelled(then, now, radius_mm, center_mm, tool, alike)
    turns = np.array([(o.ball_from_scanner @ tool.mount_from_laser).rotation for o in now])
    by_laser = by_center @ turns  # how the figures follow the sphere's place in L
    weights: FloatArray = np.asarray(np.linalg.inv(covariances), dtype=np.float64)
    whole = float(np.einsum("ki,kij,kj->", differences, weights, differences))
    shift, covariance, left_of_tool = _fitted(by_laser, differences, weights)
    _, _, left_of_sphere = _fitted(by_center, differences, weights)
    _, _, left_of_turn = _fitted(by_tool, differences, weights)
    freedom = 3 * len(differences)
    chances = [chance_of(whole - left_of_tool, 3), chance_of(whole - left_of_sphere, 3), chance_of(whole, freedom)]
    changed: Changed = "nothing"
    bump: Bump | None = None
    if min(chances) < _FALSE_ALARM / scanners:
        by_turn = chance_of(left_of_turn, max(freedom - 6, 1))
        by_shift = chance_of(left_of_sphere, max(freedom - 3, 1))
        changed = _what(by_turn > _EXPLAINED, by_shift > _EXPLAINED)
        by_joint = by_errors_of_arm(now, center_mm, by_center, zeros or {})
        others = [by_center * SHIFTED_MM, by_tool * [*[TURNED_RAD] * 3, *[SHIFTED_MM] * 3]]
        others = [one.reshape(freedom, -1) for one in others]
        bump = bumped(by_joint, others, differences.ravel(), block_diagonal(covariances))
    if bump is not None:
        changed = "joint"
    return Change(shift, covariance, changed, min(1.0, 3 * min(chances)), differences, covariances, bump)


def _what(tool_explains: bool, sphere_explains: bool) -> Changed:
    if tool_explains and sphere_explains:
        return "tool-or-sphere"
    if tool_explains:
        return "tool"
    return "sphere" if sphere_explains else "unclear"


def _fitted(
    design: FloatArray, differences: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return the step (n,) that explains the differences best, its covariance, and what chi-squared it leaves."""
    turned = np.swapaxes(design, 1, 2) @ weights
    covariance = covariance_of((turned @ design).sum(axis=0) + np.eye(design.shape[2]) / _PRIOR_MM**2)
    shift = covariance @ (turned @ differences[..., None]).sum(axis=0)[:, 0]
    left = differences - design @ shift
    return shift, covariance, float(np.einsum("ki,kij,kj->", left, weights, left))


def _not_cancelled(
    then: Observations,
    now: Observations,
    radius_mm: float,
    center_mm: FloatArray,
    tool: Tool,
    alike: Alike | None,
) -> FloatArray:
    """Return the covariance (K, 3, 3) that the arm's alike errors add where poses were not quite repeated."""
    if alike is None or not (alike.position_sigma_mm or alike.orientation_sigma_rad):
        return np.zeros((len(now), 3, 3))
    still = Tool(tool.mount_from_laser, tool.covariance, 0.0, 0.0)
    moving = Tool(tool.mount_from_laser, tool.covariance, alike.position_sigma_mm, alike.orientation_sigma_rad)
    own = linearised(now, radius_mm, center_mm, still)[1]
    more = linearised(now, radius_mm, center_mm, moving)[1] - own
    shares = np.array([alike.apart(one, other) for one, other in zip(then, now, strict=True)])
    return more * shares[:, None, None]
