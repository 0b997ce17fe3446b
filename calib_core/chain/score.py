"""Score tests: by how much a few unknowns more make all captures likelier, by the normal equations alone."""

from dataclasses import dataclass

import numpy as np

from calib_core.chain.likelihood import without_pose_errors
from calib_core.chain.model import off_known_tool
from calib_core.chain.rejection import Judged
from calib_core.estimation import covariance_of, f_chance_of
from calib_core.frames import FloatArray

_LEAST_LEFT = 0.1  # of the scatter: estimated sigmas have swallowed no more of what is sought


@dataclass(frozen=True, eq=False)
class Scores:
    """What every capture says of where its sphere is expected, at the answer.

    Attributes
    ----------
    information, rest : (K, 3, 3), (K, 3)
        Λ and η of each capture, pose errors integrated out, about where the answer expects its sphere.
    by_all : (K, 3, P)
        Λ times the expectation's derivative by all unknowns.
    covariance : (P, P)
        Of all unknowns.
    misfit : float
        χ² of all captures, with what is believed of shared errors and of the scanner.
    freedom : int
    """

    information: FloatArray
    rest: FloatArray
    by_all: FloatArray
    covariance: FloatArray
    misfit: float
    freedom: int

    @classmethod
    def of(cls, judged: Judged) -> "Scores":
        """Return those of a fit."""
        at, state, data = judged.fit.minimum.at, judged.fit.state, judged.data
        reduced, rest = without_pose_errors(at.information, at.vector, at.gain, at.share)
        own = rest[:, :3] - np.einsum("kij,kj->ki", reduced[:, :3, :3], at.offset)
        by_all = reduced[:, :3, :3] @ at.jacobian
        by_all[:, :, at.nuisances] += reduced[:, :3, 3:]
        inverse = np.linalg.pinv(reduced[:, :3, :3], hermitian=True)
        misfit = float(np.einsum("ki,kij,kj->", own, inverse, own))
        if state.shared is not None:
            misfit += float(np.sum(data.unlikely(state.shared) ** 2))
        if data.tool_prior is None:
            misfit += float(np.sum((state.scanner[data.active] / data.nuisance_sigmas[data.active]) ** 2))
        else:
            off = off_known_tool(data.tool_prior, state)
            misfit += float(off @ data.tool_prior.information @ off)
        freedom = max(3 * int(judged.used.sum()) - data.free_unknowns, 1)
        return cls(reduced[:, :3, :3], own, by_all, covariance_of(at.hessian), misfit, freedom)

    def gained(self, rows: FloatArray, far: float) -> tuple[float, FloatArray, FloatArray]:
        """Return twice the log-likelihood that unknowns with these rows gain, their values (W,), and by how much
        all unknowns move with them (P,).

        Parameters
        ----------
        rows : (K, 3, W)
            How each capture's sphere is expected elsewhere.
        far : float
            The standard deviation that is believed of each.
        """
        turned = np.swapaxes(rows, 1, 2)
        score = np.einsum("kpi,ki->p", turned, self.rest)
        square = (turned @ self.information @ rows).sum(axis=0) + np.eye(rows.shape[2]) / far**2
        cross = (turned @ self.by_all).sum(axis=0)
        size = np.linalg.solve(square - cross @ self.covariance @ cross.T, score)
        return float(score @ size), size, -self.covariance @ cross.T @ size

    def chance(self, gain: float, unknowns: int) -> float:
        """Return how often so much comes of chance, whatever the sigmas (an F test)."""
        freedom = max(self.freedom - unknowns, 1)
        left = max(self.misfit - gain, _LEAST_LEFT * self.misfit) / freedom
        return f_chance_of(gain / left, unknowns, freedom)


def more_than_chance(gain: float, unknowns: int) -> float:
    """Return how much of a step's square is more than chance, 0 … 1, after James and Stein."""
    return max(0.0, 1 - unknowns / max(gain, 1e-12))
