"""What the arm does to a measured point beside what it did to tool and table: its errors that scans share.

The arm erred in the calibration's captures as it errs where a workpiece is measured from poses like those, so that
tool and table have swallowed part of it: at the point that part cancels.  So does what the captures left open of
the arm's own errors, where poses are corrected by these.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib_core.arms.alike import REACH_MM, Poses, alike_correlation, alike_weights
from calib_core.chain.chain_data import Sigmas
from calib_core.frames import FloatArray, RigidTransform, skew
from calib_core.records.results import ArmErrorsFound

_SMOOTH = 2.5  # by which the moves of an arm's errors reach farther than errors that are alike
_STEADY = 1e-3


@dataclass(frozen=True, eq=False)
class ArmShare:
    """How tool, table and scanner err together with the arm.

    Attributes
    ----------
    rotations, translations : (m, 3, 3), (m, 3)
        Poses that stand for all, base_from_tool0.
    reach : float
        See `arms.alike`.
    middle_mm, lengths_sigma : (3,), float
        From where lengths are compared, and by what share they are off.
    with_lengths, with_poses : (12 + n,), (12 + n, m, 6)
        Covariances of tool, table and scanner's errors with the arm's: see `ArmErrorsFound`.
    terms : OpenTerms or None
        What is left open of the errors by which poses are corrected; None where they are not.
    """

    rotations: FloatArray
    translations: FloatArray
    reach: float
    middle_mm: FloatArray
    lengths_sigma: float
    with_lengths: FloatArray
    with_poses: FloatArray
    terms: "OpenTerms | None" = None

    @classmethod
    def of(cls, result: Mapping[str, Any], with_scanner: bool, with_table: bool) -> "ArmShare | None":
        """Return what a result of `chain` or `tcp` has; None for one of before it was told."""
        if result.get("arm_errors") is None:
            return None
        found = ArmErrorsFound.model_validate(result["arm_errors"])
        poses = [RigidTransform.from_rounded(pose, "base", "tool0") for pose in found.poses]
        lengths, shares = [np.array(found.tool_with_lengths)], [_by_member(found.tool_with_poses)]
        if with_table and found.table_with_poses is not None and found.table_with_lengths is not None:
            lengths.append(np.array(found.table_with_lengths))
            shares.append(_by_member(found.table_with_poses))
        else:
            lengths.append(np.zeros(6))
            shares.append(np.zeros((6, len(poses), 6)))
        if with_scanner and found.scanner_with_lengths:
            lengths.append(np.array(found.scanner_with_lengths))
            shares.append(_by_member(found.scanner_with_poses))
        return cls(
            np.array([pose.rotation for pose in poses]).reshape(-1, 3, 3),
            np.array([pose.translation_mm for pose in poses]).reshape(-1, 3),
            float(result["variance_components"]["reach_mm"]) / REACH_MM,
            np.array(found.middle_mm),
            found.lengths_sigma,
            np.concatenate(lengths),
            np.concatenate(shares),
            open_terms(result, sum(len(one) for one in lengths)),
        )

    def with_answer(
        self,
        rotation: FloatArray,
        places_mm: FloatArray,
        arm_in_base_mm: FloatArray,
        moves: FloatArray | None = None,
    ) -> FloatArray:
        """Return how tool, table and scanner err together with the arm at measured points, (P, 12 + n, 3).

        Parameters
        ----------
        rotation, places_mm : (3, 3), (P, 3)
            The flange's orientation and its places in base.
        arm_in_base_mm : (3,)
            From the flange to the point, along base's axes: so do the errors of the points.
        moves : (6, p), optional
            How the flange moves with the terms that are open, where its joints are known.
        """
        pose = rotation, places_mm, arm_in_base_mm
        found = self._with_errors(self.with_lengths, self.with_poses, *pose)
        if self.terms is not None:
            points = self.term_moves(rotation, places_mm, arm_in_base_mm, moves)
            found = found + np.einsum("np,qip->qni", self.terms.with_answer, points)
        return found

    def _with_errors(
        self,
        with_lengths: FloatArray,
        with_poses: FloatArray,
        rotation: FloatArray,
        places_mm: FloatArray,
        arm_in_base_mm: FloatArray,
    ) -> FloatArray:
        """Return how what errs with lengths and at the poses that stand for all errs with points, (P, n, 3)."""
        found = np.einsum("p,qi->qpi", with_lengths, places_mm - self.middle_mm)
        if len(self.rotations) and self.reach > 0:
            turned = np.broadcast_to(rotation, (len(places_mm), 3, 3))
            known = self.rotations, self.translations
            weights = alike_weights(known, (turned, places_mm), self.reach)
            at_pose = np.einsum("qm,pmi->qpi", weights, with_poses)
            found = found + at_pose[:, :, :3] + at_pose[:, :, 3:] @ skew(arm_in_base_mm).T
        return found

    def of_terms(self, rotation: FloatArray, places_mm: FloatArray, arm_in_base_mm: FloatArray) -> FloatArray:
        """Return how the open terms err together with points by the arm's other errors, (P, p, 3)."""
        assert self.terms is not None
        pose = rotation, places_mm, arm_in_base_mm
        return self._with_errors(self.terms.with_lengths, self.terms.with_poses, *pose)

    def by_terms(self, rotation: FloatArray, places_mm: FloatArray, arm_in_base_mm: FloatArray) -> FloatArray:
        """Return what is open of the errors by which the arm is corrected puts into points, (P, 3, 3), mm².

        To be added: with what they have in common with the arm's other errors, mostly less than nothing.
        """
        if self.terms is None:
            return np.zeros((len(places_mm), 3, 3))
        points = self.term_moves(rotation, places_mm, arm_in_base_mm)
        half = points @ self.of_terms(rotation, places_mm, arm_in_base_mm)
        own = points @ self.terms.covariance @ np.swapaxes(points, 1, 2)
        return np.asarray(own + half + np.swapaxes(half, 1, 2))

    def term_moves(
        self,
        rotation: FloatArray,
        places_mm: FloatArray,
        arm_in_base_mm: FloatArray,
        moves: FloatArray | None = None,
    ) -> FloatArray:
        """Return how points move in base with the open terms, (P, 3, p); see `with_answer`."""
        assert self.terms is not None
        if moves is not None:
            each = np.broadcast_to(moves, (len(places_mm), *moves.shape))
        else:
            turned = np.broadcast_to(rotation, (len(places_mm), 3, 3))
            each = self.terms.moves_at((self.rotations, self.translations), (turned, places_mm))
        return np.asarray(each[:, :3] - skew(arm_in_base_mm) @ each[:, 3:])

    def by_lengths(self, places_mm: FloatArray) -> FloatArray:
        """Return the covariances (P, 3, 3), mm², that the arm's lengths put in where the flange stands."""
        away = places_mm - self.middle_mm
        return self.lengths_sigma**2 * away[:, :, None] * away[:, None, :]

    def explained(self, sigmas: Sigmas) -> FloatArray:
        """Return what of the covariance of tool, table and scanner, (12 + n, …), the arm's errors explain."""
        found = np.zeros((len(self.with_lengths), len(self.with_lengths)))
        if self.lengths_sigma > 0:
            found += np.outer(self.with_lengths, self.with_lengths) / self.lengths_sigma**2
        if len(self.rotations) and self.reach > 0:
            own = alike_correlation((self.rotations, self.translations), self.reach)
            sizes = np.array([sigmas.alike_position_mm] * 3 + [sigmas.alike_orientation_rad] * 3)
            scaled = np.moveaxis(self.with_poses / np.maximum(sizes, 1e-12), 1, 0)  # (m, 12 + n, 6)
            solved = np.linalg.solve(own, scaled.reshape(len(own), -1)).reshape(scaled.shape)
            found += np.einsum("mpi,mqi->pq", scaled, solved)
        if self.terms is not None:
            own = self.terms.with_answer
            found += own @ np.linalg.pinv(self.terms.covariance, hermitian=True) @ own.T
        return found


@dataclass(frozen=True, eq=False)
class OpenTerms:
    """What is open of the errors by which the arm's poses are corrected, in their own units.

    Attributes
    ----------
    covariance : (p, p)
    with_answer : (12 + n, p)
        Of tool, table and scanner's errors with theirs.
    moves : (m, 6, p)
        How the flange moves in base with them at the poses that stand for all.
    with_lengths, with_poses : (p,), (p, m, 6)
        Of theirs with the arm's other errors, as of `ArmShare`.
    """

    covariance: FloatArray
    with_answer: FloatArray
    moves: FloatArray
    with_lengths: FloatArray
    with_poses: FloatArray

    def moves_at(self, known: Poses, others: Poses) -> FloatArray:
        """Return how the flange moves at other poses, (P, 6, p): smooth between those that are known."""
        if not len(self.moves):
            return np.zeros((len(others[0]), *self.moves.shape[1:]))
        middle = self.moves.mean(axis=0)
        own = alike_correlation(known, _SMOOTH) + _STEADY * np.eye(len(self.moves))
        weights = np.linalg.solve(own, alike_correlation(known, _SMOOTH, others).T).T
        return np.asarray(middle + np.tensordot(weights, self.moves - middle, 1), dtype=float)


def open_terms(result: Mapping[str, Any], size: int) -> OpenTerms | None:
    """Return what a result leaves open of the arm's errors, beside `size` errors of tool, table and scanner.

    None where poses are not corrected, and for results of before that was told.
    """
    known = (result.get("arm_model") or {}).get("covariance")
    if known is None or result.get("arm_errors") is None:
        return None
    found, count = ArmErrorsFound.model_validate(result["arm_errors"]), len(known)
    if found.tool_with_terms is None or found.term_moves is None or found.terms_with_lengths is None:
        return None
    with_answer = np.zeros((size, count))
    with_answer[:6] = found.tool_with_terms
    if found.table_with_terms is not None:
        with_answer[6:12] = found.table_with_terms
    if size > 12 and found.scanner_with_terms:
        with_answer[12:] = found.scanner_with_terms
    moves = np.array(found.term_moves, dtype=float).reshape(-1, 6, count)
    with_poses = _by_member(found.terms_with_poses or []).reshape(count, -1, 6)
    return OpenTerms(
        np.array(known, dtype=float), with_answer, moves, np.array(found.terms_with_lengths), with_poses
    )


def _by_member(rows: list[list[list[float]]]) -> FloatArray:
    return np.moveaxis(np.array(rows, dtype=float), 0, 1)
