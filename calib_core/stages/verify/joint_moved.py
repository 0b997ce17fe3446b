"""Whether the zero of one joint of a known arm moved, held against whatever else could have moved instead."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.arms.errors import places_of_zeros
from calib_core.captures.arm_joints import terms_of
from calib_core.chain.observations import Observations, SphereSize
from calib_core.estimation import chance_of
from calib_core.findings.codes.verify import JOINT_MOVED
from calib_core.frames import FloatArray, skew
from calib_core.records import Cell
from calib_core.records.findings import Finding
from calib_core.records.results import ArmModelFound
from calib_core.stages.verify.held_out import HeldOut
from calib_core.stages.verify.seen import linearised
from calib_core.stages.verify.tool import Tool

_EXPLAINED = 0.01
# What a collision does: a scanner or a sphere shifts (mm), a scanner turns (rad), a joint's zero moves (deg).
SHIFTED_MM, TURNED_RAD, _BUMPED_DEG = 1.0, 0.005, 0.2
_LIKELIER = 4.0  # of a log-likelihood: what is named a bumped joint is 50 times likelier so


@dataclass(frozen=True)
class Bump:
    """By how much the zero of a joint, counted from 1, moved: deg, ± one standard deviation."""

    joint: int
    change_deg: float
    sigma_deg: float


def by_errors_of_arm(
    seen: Observations, center: FloatArray, by_center: FloatArray, terms: Mapping[int, int]
) -> dict[int, FloatArray]:
    """Return how K captures' figures follow errors of the arm, (3 K, 1) a unit; empty where joints are not known.

    Parameters
    ----------
    seen : K observations
    center : (3,) or (K, 3)
        The sphere's, on what carries it; or that of each capture's.
    by_center : (K, 3, 3)
        How the figures follow it.
    terms : mapping
        Which of the arm's terms, by what it is to be called.
    """
    designs: dict[int, FloatArray] = {}
    for name, term in terms.items():
        moved: list[FloatArray] = []
        for one, at in zip(seen, np.broadcast_to(center, (len(seen), 3)), strict=True):
            if one.arm_moves is None or not one.carriers.over_robot:
                return {}
            shift, turn = one.arm_moves[:3, term], one.arm_moves[3:, term]
            flange, on_flange = one.base_from_tool0, one.carriers.over_robot < 0
            in_base = flange.apply(at) if on_flange else at
            carried = shift + skew(turn) @ (in_base - flange.translation_mm)  # as if it were on the flange
            moved.append(flange.rotation.T @ carried if on_flange else -carried)
        designs[name] = (by_center @ np.array(moved)[..., None]).reshape(-1, 1)
    return designs


def bumped(
    by_joint: Mapping[int, FloatArray],
    others: Sequence[FloatArray],
    off: FloatArray,
    covariance: FloatArray,
    free: FloatArray | None = None,
) -> Bump | None:
    """Return the joint whose zero explains figures that are off, far likelier than other joints and `others`.

    Parameters
    ----------
    by_joint : mapping to (n, 1)
        A degree.
    others : sequence of (n, m)
        Steps that are believed to be of size one.
    off, covariance : (n,), (n, n)
    free : (n, q), optional
        Steps of any size: what they explain counts for nothing.
    """
    if not by_joint:
        return None
    low = np.linalg.cholesky(covariance)
    rows = np.eye(len(off))
    if free is not None:
        rows = np.linalg.qr(np.linalg.solve(low, free), mode="complete")[0][:, free.shape[1] :].T
    white = rows @ np.linalg.inv(low)
    off = white @ off
    each = {joint: white @ design for joint, design in by_joint.items()}
    likelihood = {joint: _log_likelihood(_BUMPED_DEG * design, off) for joint, design in each.items()}
    best = max(likelihood, key=lambda joint: likelihood[joint])
    against = [0.0, *(one for joint, one in likelihood.items() if joint != best)]
    against += [_log_likelihood(white @ design, off) for design in others]
    own = each[best][:, 0]
    change = float(own @ off / (own @ own))
    left = off - own * change
    if chance_of(float(left @ left), len(off) - 1) <= _EXPLAINED or likelihood[best] < max(against) + _LIKELIER:
        return None
    return Bump(best, change, float(1 / np.linalg.norm(own)))


def _log_likelihood(design: FloatArray, off: FloatArray) -> float:
    """Return by how much whitened figures are likelier with steps (m,), each believed to be of size one."""
    information = design.T @ design + np.eye(design.shape[1])
    pulled = design.T @ off
    return float(pulled @ np.linalg.solve(information, pulled) - np.linalg.slogdet(information)[1]) / 2


def joint_findings(
    cell: Cell, arm: ArmModelFound | None, seen: Observations, sphere: SphereSize, tool: Tool, found: HeldOut
) -> list[Finding]:
    """Return which joint's zero moved since the calibration, where that explains held-out captures of one sphere.

    Nothing where poses are of an arm whose errors were found and are not taken out of them.
    """
    if arm is None or arm.told is None or (arm.worth_it and not arm.applied):
        return []
    off, _, by_center, by_tool, _ = linearised(seen, sphere.radius_mm, found.center_mm, tool)
    terms = [term.name for term in terms_of(cell)]
    each = by_errors_of_arm(seen, found.center_mm, by_center, {place: place for place in range(len(terms))})
    if not each or terms != arm.told.names:
        return []
    of_arm = np.hstack([each[place] for place in range(len(terms))]) * arm.told.believed
    of_tool = by_tool.reshape(off.size, -1)
    covariance = found.spread
    if not arm.applied:  # else it is in the spread
        covariance = (
            covariance + of_arm @ np.linalg.inv(np.array(arm.told.information) + np.eye(len(terms))) @ of_arm.T
        )
    others = [of_tool * [*[TURNED_RAD] * 3, *[SHIFTED_MM] * 3], of_arm]
    zeros = {joint: each[place] for joint, place in places_of_zeros(terms).items()}
    bump = bumped(zeros, others, off.ravel(), covariance, by_center.reshape(off.size, -1))
    if bump is None:
        return []
    return [JOINT_MOVED(joint=bump.joint, deg=bump.change_deg, uncertainty_deg=2 * bump.sigma_deg)]
