"""Many guesses of tool and sphere at once: arrays with a leading axis of guesses, refined by robust Gauss–Newton.

A guess is a rotation R_s and six numbers that are linear once it is given: the sphere's centre in base, R_sᵀT_s.
"""

from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray

_SAME_RAD = 0.03
"""Rotations that differ by less are nearly the same."""


@dataclass(frozen=True, eq=False)
class Sought:
    """What N guesses are to agree with: the same captures for all (a leading axis of 1), or each its own.

    Attributes
    ----------
    rotations, translations : (N or 1, K, 3, 3), (N or 1, K, 3)
        base_from_tool0.
    measured : (N or 1, K, 3)
        The captures' own sphere centres in L, mm.
    weight : (N or 1, K, 3)
        Of each of their components.
    """

    rotations: FloatArray
    translations: FloatArray
    measured: FloatArray
    weight: FloatArray

    def chosen(self, which: np.ndarray) -> "Sought":
        """Return captures for each guess by their indices (N, k), of a set that was the same for all."""
        return Sought(
            self.rotations[0, which], self.translations[0, which], self.measured[0, which], self.weight[0, which]
        )

    def misfit(self, rotations: FloatArray, linear: FloatArray) -> FloatArray:
        """Return predicted minus measured centres in L, (N, K, 3), of N guesses (N, 3, 3), (N, 6)."""
        arms = linear[:, None, :3] - self.translations
        in_tool = np.einsum("nkji,nkj->nki", self.rotations, arms)
        return in_tool @ rotations - linear[:, None, 3:] - self.measured

    def linear_unknowns(self, rotations: FloatArray) -> FloatArray:
        """Return the centre and R_sᵀT_s (N, 6) by least squares for each of N rotations (N, 3, 3)."""
        axes = self._axes(rotations)
        right = self.measured + np.einsum("nkci,nki->nkc", axes, self.translations)
        rows = np.concatenate([axes, -np.broadcast_to(np.eye(3), axes.shape)], axis=3).reshape(len(axes), -1, 6)
        weighted = np.swapaxes(rows * self._flat_weight(), 1, 2)
        normal = weighted @ rows
        vector = (weighted @ right.reshape(len(axes), -1, 1))[..., 0]
        scale = np.trace(normal, axis1=1, axis2=2)[:, None, None]
        return np.linalg.solve(normal + 1e-9 * scale * np.eye(6), vector[..., None])[..., 0]

    def refined(
        self, rotations: FloatArray, linear: FloatArray, iterations: int
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Improve N guesses by damped Gauss–Newton with Cauchy's loss; returns them and their residuals."""
        from calib_core.kernels.guesses import refine_guesses

        rotations, linear = np.array(rotations), np.array(linear)
        misfit = np.empty((len(rotations), *self.measured.shape[1:]))
        arms, places = np.ascontiguousarray(self.rotations), np.ascontiguousarray(self.translations)
        measured, weight = np.ascontiguousarray(self.measured), np.ascontiguousarray(self.weight)
        refine_guesses(arms, places, measured, weight, iterations, rotations, linear, misfit)
        return rotations, linear, misfit

    def distances(self, misfit: FloatArray) -> FloatArray:
        """Return the length (N, K), weighted, of residuals (N, K, 3)."""
        return np.sqrt(np.sum(self.weight * misfit**2, axis=2))

    def _axes(self, rotations: FloatArray) -> FloatArray:
        """Return the axes of L in base for N guesses and K captures, (N, K, 3 axes, 3)."""
        return np.swapaxes(self.rotations @ rotations[:, None], 2, 3)

    def _flat_weight(self) -> FloatArray:
        return self.weight.reshape(len(self.weight), -1, 1)


def random_rotations(count: int) -> FloatArray:
    """Return rotations (count, 3, 3) spread evenly, the same every time."""
    from scipy.spatial.transform import Rotation

    return Rotation.random(count, rng=np.random.default_rng(2010)).as_matrix()


def apart(rotations: FloatArray, most: int) -> list[int]:
    """Return the numbers of the first rotations, so many at most, that are not nearly the same as one before."""
    flat = rotations.reshape(-1, 9)
    kept: list[int] = []
    for number, one in enumerate(flat):
        if not kept or (flat[kept] @ one).max() <= 1 + 2 * np.cos(_SAME_RAD):  # traces of the turns between
            kept.append(number)
        if len(kept) == most:
            break
    return kept


def random_few(guesses: int, shares: FloatArray, few: int) -> np.ndarray:
    """Return for every guess the indices (guesses, few) of different captures, drawn the same every time.

    A capture comes as often as its share (K,) says, so that few of one pose are drawn together.
    """
    captures = len(shares)
    draws = np.random.default_rng(captures).random((guesses, captures))
    if np.any(shares < 1):
        draws = -np.log1p(-draws) / shares  # the first of exponential waiting times
    return np.argpartition(draws, few - 1, axis=1)[:, :few]
