"""What an arm puts into held-out captures together: errors that poses nearby share, and those that are solved."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.arms.alike import REACH_MM, alike_correlation
from calib_core.cell.found import on_flange
from calib_core.chain.observations import SphereObservation
from calib_core.frames import FloatArray, RigidTransform, skew
from calib_core.guidance.arm_share import ArmShare
from calib_core.stages.tcp.record import ToolResult


@dataclass(frozen=True, eq=False)
class ArmScatter:
    """How an arm errs at poses that its calibration has not seen.

    Attributes
    ----------
    position_sigma_mm, orientation_sigma_rad : float
        Of errors that are alike where poses are alike.
    reach : float
        See `arms.alike`.
    lengths_sigma, middle_mm : float, (3,)
        By what share the arm's lengths are off, and from where in base they are compared.
    share : ArmShare or None
        How a tool on the flange erred with them: what it has swallowed cancels. The terms count in full, and so
        does all where the ball is on the flange.
    terms : (p, p) or None
        Covariance of the arm's terms by which poses are corrected, in their own units.
    """

    position_sigma_mm: float
    orientation_sigma_rad: float
    reach: float
    lengths_sigma: float
    middle_mm: FloatArray
    share: ArmShare | None
    terms: FloatArray | None

    @classmethod
    def of(cls, answer: ToolResult) -> "ArmScatter":
        """Return what a stage's answer tells."""
        parts, model, told = answer.variance_components, answer.arm_model, answer.arm_errors
        known = None
        if model is not None and model.applied and model.told is not None:
            believed = np.array(model.told.believed)
            information = np.array(model.told.information) + np.eye(len(believed))
            known = np.asarray(np.linalg.inv(information), dtype=float) * np.outer(believed, believed)
        of_flange = on_flange(answer.mount_from_laser)
        share = ArmShare.of(answer.model_dump(), with_scanner=False, with_table=False)
        return cls(
            parts.alike_position_sigma_mm if told is None else told.position_sigma_mm,
            parts.alike_orientation_sigma_rad if told is None else told.orientation_sigma_rad,
            (parts.reach_mm or REACH_MM) / REACH_MM,
            0.0 if told is None else told.lengths_sigma,
            np.zeros(3) if told is None else np.array(told.middle_mm),
            replace(share, terms=None) if of_flange and share is not None else None,
            known,
        )

    def of_other(self) -> "ArmScatter":
        """Return the same for a scanner of which it is not known how its mount erred with the arm."""
        return replace(self, share=None)

    def covariance(
        self, seen: Sequence[SphereObservation], mount: RigidTransform, centers: FloatArray, by_tool: FloatArray
    ) -> FloatArray:
        """Return the covariance (3K, 3K) that it adds to where K captures see a ball, in L.

        Parameters
        ----------
        seen : K observations
        mount : RigidTransform
            The scanner's.
        centers : (K, 3)
            Where they see the ball's centre, in L.
        by_tool : (3K, 6)
            How that follows the tool.
        """
        count = len(seen)
        moves = np.zeros((count, 3, 6))  # by the place that is reported less the true one, and the turn back to it
        turns = np.zeros((count, 3, 3))
        for k, (one, center) in enumerate(zip(seen, centers, strict=True)):
            if over := float(np.sign(one.carriers.over_robot)):
                base_from_laser = one.base_from_tool0 @ mount if over > 0 else mount
                lever = base_from_laser.apply(center) - one.base_from_tool0.translation_mm
                turns[k] = over * base_from_laser.rotation.T
                moves[k] = turns[k] @ np.hstack([np.eye(3), skew(lever)])
        rotations = np.array([one.base_from_tool0.rotation for one in seen])
        places = np.array([one.base_from_tool0.translation_mm for one in seen])
        sized = moves * ([self.position_sigma_mm] * 3 + [self.orientation_sigma_rad] * 3)
        among = alike_correlation((rotations, places), self.reach)
        found = np.einsum("kia,lja,kl->kilj", sized, sized, among).reshape(3 * count, 3 * count)
        longer = self.lengths_sigma * (turns @ (places - self.middle_mm)[:, :, None]).reshape(-1, 1)
        found = found + longer @ longer.T
        if self.share is not None:
            levers = (rotations @ mount.apply(centers)[:, :, None])[:, :, 0]
            each = zip(rotations, places, levers, turns, strict=True)
            with_tool = [
                self.share.with_answer(r, place[None], lever)[0, :6] @ turn.T for r, place, lever, turn in each
            ]
            both = by_tool @ np.hstack(with_tool)
            found = found - both - both.T
        if self.terms is not None and all(one.arm_moves is not None for one in seen):
            there = moves * [1.0, 1.0, 1.0, -1.0, -1.0, -1.0]
            own = np.concatenate([m @ one.arm_moves for m, one in zip(there, seen, strict=True)])
            found = found + own @ self.terms @ own.T
        return found
