"""What an arm puts into held-out captures together: errors that poses nearby share, and those that are solved."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.arms.alike import REACH_MM, alike_correlation
from calib_core.chain.observations import SphereObservation
from calib_core.frames import FloatArray, RigidTransform, skew
from calib_core.guidance.arm_share import ArmShare
from calib_core.stages.tcp.record import ToolResult

_OF_TABLE = range(6, 12)


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
        How the scanner's place erred with them: what it has swallowed cancels. None: not known.
    terms : (p, p) or None
        Covariance of all of the arm's terms where poses are corrected, in their own units: counts without a share.
    corrected : (q,) int
        Which of these the poses are corrected by.
    """

    position_sigma_mm: float
    orientation_sigma_rad: float
    reach: float
    lengths_sigma: float
    middle_mm: FloatArray
    share: ArmShare | None
    terms: FloatArray | None
    corrected: np.ndarray

    @classmethod
    def of(cls, answer: ToolResult) -> "ArmScatter":
        """Return what a stage's answer tells."""
        parts, model, told = answer.variance_components, answer.arm_model, answer.arm_errors
        known, corrected = None, np.empty(0, dtype=int)
        if model is not None and model.applied and model.told is not None:
            corrected = np.array([model.told.names.index(name) for name in model.names])
            believed = np.array(model.told.believed)
            information = np.array(model.told.information) + np.eye(len(believed))
            known = np.asarray(np.linalg.inv(information), dtype=float) * np.outer(believed, believed)
        return cls(
            parts.alike_position_sigma_mm if told is None else told.position_sigma_mm,
            parts.alike_orientation_sigma_rad if told is None else told.orientation_sigma_rad,
            (parts.reach_mm or REACH_MM) / REACH_MM,
            0.0 if told is None else told.lengths_sigma,
            np.zeros(3) if told is None else np.array(told.middle_mm),
            ArmShare.of(answer.model_dump(), with_scanner=True, with_table=False),
            known,
            corrected,
        )

    def of_other(self) -> "ArmScatter":
        """Return the same for a scanner of which it is not known how its mount erred with the arm."""
        return replace(self, share=None)

    def covariance(
        self, seen: Sequence[SphereObservation], mount: RigidTransform, centers: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return what it adds to where K captures see a ball, in L, and how tool and scanner err with that.

        Parameters
        ----------
        seen : K observations
        mount : RigidTransform
            The scanner's.
        centers : (K, 3)
            Where they see the ball's centre, in L.

        Returns
        -------
        (3K, 3K), (6 + n, 3K)
            The tool's six and what the result has of the scanner; no rows where nothing is known of that.
        """
        at = _Poses.of(seen, mount, centers)
        sized = at.moves * ([self.position_sigma_mm] * 3 + [self.orientation_sigma_rad] * 3)
        among = alike_correlation((at.rotations, at.places), self.reach)
        size = 3 * len(seen)
        found = np.einsum("kia,lja,kl->kilj", sized, sized, among).reshape(size, size)
        longer = self.lengths_sigma * (at.turns @ (at.places - self.middle_mm)[:, :, None]).reshape(-1, 1)
        found = found + longer @ longer.T
        known = [one.arm_moves for one in seen if one.arm_moves is not None]
        by_terms = None
        if self.terms is not None and len(known) == len(seen):
            by_terms = at.moves * [1.0, 1.0, 1.0, -1.0, -1.0, -1.0] @ np.array(known)
        share = self.share
        if share is None or (share.terms is None) != (by_terms is None):
            if by_terms is not None and self.terms is not None:
                own = by_terms.reshape(size, -1)
                found = found + own @ self.terms @ own.T
            return found, np.zeros((0, size))
        alone, terms = replace(share, terms=None), share.terms
        each = [alone.with_answer(r, t[None], lever)[0] @ turn.T for r, t, lever, turn in at.each()]
        with_answer = np.delete(np.hstack(each), _OF_TABLE, axis=0)
        if by_terms is not None and terms is not None:
            own = by_terms[:, :, self.corrected].reshape(size, -1)
            each = [share.of_terms(r, t[None], lever)[0] @ turn.T for r, t, lever, turn in at.each()]
            half = own @ np.hstack(each)
            found = found + own @ terms.covariance @ own.T + half + half.T
            with_answer = with_answer + np.delete(terms.with_answer, _OF_TABLE, axis=0) @ own.T
        return found, with_answer


@dataclass(frozen=True, eq=False)
class _Poses:
    """Flanges of K captures, levers from there to the ball in base, and turns into L.

    `moves` (K, 3, 6): of the ball, by the place that is reported less the true one, and the turn back to it.
    """

    rotations: FloatArray
    places: FloatArray
    levers: FloatArray
    turns: FloatArray
    moves: FloatArray

    @classmethod
    def of(cls, seen: Sequence[SphereObservation], mount: RigidTransform, centers: FloatArray) -> "_Poses":
        count = len(seen)
        moves, turns, levers = np.zeros((count, 3, 6)), np.zeros((count, 3, 3)), np.zeros((count, 3))
        for k, (one, center) in enumerate(zip(seen, centers, strict=True)):
            if over := float(np.sign(one.carriers.over_robot)):
                base_from_laser = one.base_from_tool0 @ mount if over > 0 else mount
                levers[k] = base_from_laser.apply(center) - one.base_from_tool0.translation_mm
                turns[k] = over * base_from_laser.rotation.T
                moves[k] = turns[k] @ np.hstack([np.eye(3), skew(levers[k])])
        rotations = np.array([one.base_from_tool0.rotation for one in seen])
        places = np.array([one.base_from_tool0.translation_mm for one in seen])
        return cls(rotations, places, levers, turns, moves)

    def each(self) -> Iterator[tuple[FloatArray, FloatArray, FloatArray, FloatArray]]:
        return zip(self.rotations, self.places, self.levers, self.turns, strict=True)
