"""How an answer errs together with the arm: its lengths, and what it does alike where poses are alike.

Tool and table swallow part of the arm's errors.  Where a workpiece is measured from poses like those of the
calibration, the arm errs there as it did then, and both partly cancel.  An answer that says how it is correlated
with the arm's errors at some poses lets whoever measures count that.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.arms.alike import alike_factor
from calib_core.chain.chain_data import ChainData, Sigmas
from calib_core.frames import FloatArray


@dataclass(frozen=True, eq=False)
class ArmErrors:
    """The arm's errors that captures share, and how an answer's errors are correlated with them.

    A pose that is reported lies off the true one by `position` along base's axes and by the length error times its
    way from the middle; the true orientation is the reported one turned by `orientation` about base's axes.

    Attributes
    ----------
    rotations, translations : (m, 3, 3), (m, 3)
        Poses that stand for all: base_from_tool0, mm.
    middle_mm : (3,)
        From where the arm's lengths are compared, in base.
    with_lengths : (P,)
        Covariance of the answer's errors with the share by which the arm's lengths are off.
    with_poses : (P, m, 6)
        The same with the errors at those poses: position, orientation, mm and rad.
    with_terms : (P, p)
        The same with the errors of the terms by which poses are corrected, in their standard deviations; none
        where they are not.
    term_moves : (m, 6, p)
        How the flange moves in base at those poses by the same.
    of_terms : (p, p)
        Covariance of the same.
    terms_with_lengths, terms_with_poses : (p,), (p, m, 6)
        Of the same, as `with_lengths` and `with_poses` are of the answer.
    position_sigma_mm, orientation_sigma_rad : float
        Of the part that is alike, root mean squares over what the captures leave open of it.
    """

    rotations: FloatArray
    translations: FloatArray
    middle_mm: FloatArray
    with_lengths: FloatArray
    with_poses: FloatArray
    with_terms: FloatArray
    term_moves: FloatArray
    of_terms: FloatArray
    terms_with_lengths: FloatArray
    terms_with_poses: FloatArray
    position_sigma_mm: float
    orientation_sigma_rad: float

    def of(self, moves: FloatArray) -> "ArmErrors":
        """Return the same for what follows the unknowns by a matrix (Q, P)."""
        lengths, terms = moves @ self.with_lengths, moves @ self.with_terms
        poses = np.tensordot(moves, self.with_poses, 1)
        return replace(self, with_lengths=lengths, with_poses=poses, with_terms=terms)

    def held_at(self, covariance: FloatArray, columns: Sequence[int] | np.ndarray) -> "ArmErrors":
        """Return the same for an answer that takes some unknowns for nothing instead of seeking them.

        Parameters
        ----------
        covariance : (P, P)
            Of the unknowns, all of them sought.
        columns
            Those that are taken for nothing: what they are in truth has nothing to do with the arm.
        """
        some = np.array(columns, dtype=int)
        moves = np.eye(len(covariance))
        moves[:, some] -= np.linalg.solve(covariance[np.ix_(some, some)], covariance[some]).T
        return self.of(moves)


@dataclass(frozen=True, eq=False)
class ArmShares:
    """How the arm's errors follow the unknowns with which the likelihood describes them.

    Attributes
    ----------
    data : ChainData
    pivots : (m,)
        Captures whose poses stand for all.
    """

    data: ChainData
    pivots: np.ndarray

    @property
    def terms(self) -> int:
        """How many terms poses are corrected by; the last of the shared unknowns are theirs."""
        return 0 if self.data.arm_means is None else len(self.data.arm_means)

    def by_shared(self, sigmas: Sigmas) -> FloatArray:
        """Return how lengths, errors at the pivots and terms, (1 + 6 m + p), follow the shared unknowns (L)."""
        data, many = self.data, len(self.pivots)
        lengths, drift = int(data.arm_scale_sigma > 0), 3 * int(data.drift_sigma_mm > 0)
        factor = np.empty((data.count, 0))
        if sigmas.is_alike:
            factor = alike_factor(*data.walk.poses, sigmas.reach)
        alike = lengths + drift + 6 * factor.shape[1]
        terms = self.terms
        found = np.zeros((1 + 6 * many + terms, alike + data.of_stops + terms))
        if lengths:
            found[0, 0] = data.arm_scale_sigma
        sizes = np.diag([sigmas.alike_position_mm] * 3 + [sigmas.alike_orientation_rad] * 3)
        found[1 : 1 + 6 * many, lengths + drift : alike] = np.kron(factor[self.pivots], sizes)
        found[1 + 6 * many :, alike + data.of_stops :] = np.eye(terms)
        return found

    def errors(
        self, covariance: FloatArray, of_terms: FloatArray, sigmas: Sequence[Sigmas], weights: FloatArray
    ) -> ArmErrors:
        """Return the arm's errors with those of an answer.

        Parameters
        ----------
        covariance : (P, 1 + 6 m + p)
            Of the unknowns with lengths, errors at the pivots and terms.
        of_terms : (p, 1 + 6 m + p)
            Of the terms with the same.
        sigmas, weights
            What the sigmas may be, and how likely.
        """
        position = weights @ [one.alike_position_mm**2 for one in sigmas]
        orientation = weights @ [one.alike_orientation_rad**2 for one in sigmas]
        data, where, last = self.data, self.pivots, 1 + 6 * len(self.pivots)
        none = np.empty((len(where), 6, 0))
        # What is sought errs by what is found less what is true, and so do the terms, which are sought as well.
        return ArmErrors(
            data.walk.rotations[where],
            data.walk.translations[where],
            data.walk.translations.mean(axis=0),
            -covariance[:, 0],
            -covariance[:, 1:last].reshape(len(covariance), len(where), 6),
            covariance[:, last:],
            none if data.arm_moves is None else data.arm_moves[where],
            of_terms[:, last:],
            -of_terms[:, 0],
            -of_terms[:, 1:last].reshape(len(of_terms), len(where), 6),
            float(np.sqrt(position)),
            float(np.sqrt(orientation)),
        )
