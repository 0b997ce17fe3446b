"""What the unknowns become when each capture is left out, from one linearisation."""

from dataclasses import dataclass

import numpy as np

from calib_core.chain.likelihood import ChainLinearisation, without_pose_errors
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray


@dataclass(frozen=True, eq=False)
class WithoutOne:
    """What the unknowns become when each capture is left out.

    Attributes
    ----------
    steps : (K, P)
        Of the unknowns.
    moved : (K, 3)
        Of where the others expect the capture's sphere, mm.
    spread : (K, 3, 3)
        Covariance of that expectation, mm².
    columns, loss : (K, S, P), (K, S, S)
        By how much the unknowns' covariance grows: columnsᵀ · loss · columns.
    """

    steps: FloatArray
    moved: FloatArray
    spread: FloatArray
    columns: FloatArray
    loss: FloatArray

    def wider(self, rows: FloatArray) -> FloatArray:
        """Return by how much the covariance grows of what depends on the first unknowns by rows (m, n)."""
        seen = self.columns[:, :, : rows.shape[1]] @ rows.T
        grown = np.swapaxes(seen, 1, 2) @ self.loss @ seen
        return (grown + np.swapaxes(grown, 1, 2)) / 2


def without_each(at: ChainLinearisation) -> WithoutOne:
    """Return what the unknowns become without each capture, from the linearisation at the minimum.

    Each capture's rows X with information Λ are taken out of the covariance C by (I − Λ X C Xᵀ)⁻¹ (Woodbury), so
    that the cost grows with the number of captures alone.
    """
    reduced, rest = without_pose_errors(at.information, at.vector, at.gain, at.share)
    rest = rest - np.einsum("kij,kj->ki", reduced[:, :, :3], at.offset)
    covariance = covariance_of(at.hessian)
    count, size = rest.shape
    width = len(covariance)
    columns = np.empty((count, size, width))  # X C
    columns[:, :3] = at.jacobian @ covariance
    columns[:, 3:] = covariance[at.nuisances]
    own = np.concatenate([columns @ np.swapaxes(at.jacobian, 1, 2), columns[:, :, at.nuisances]], axis=2)
    system = (1 + 1e-9) * np.eye(size) - reduced @ own
    answer = np.linalg.solve(
        system, np.concatenate([rest[:, :, None], np.broadcast_to(np.eye(size), own.shape)], 2)
    )
    steps = -np.einsum("kip,ki->kp", columns, answer[:, :, 0])
    spread = (own @ answer[:, :, 1:])[:, :3, :3]
    moved = np.einsum("kip,kp->ki", at.jacobian, steps)
    spread = _positive((spread + np.swapaxes(spread, 1, 2)) / 2)
    return WithoutOne(steps, moved, spread, columns, answer[:, :, 1:] @ reduced)


def _positive(spread: FloatArray) -> FloatArray:
    """Return covariances (K, 3, 3), wide where rounding has made them negative: one capture alone tells that."""
    values, axes = np.linalg.eigh(spread)
    turned = (axes * np.abs(values)[:, None, :]) @ np.swapaxes(axes, 1, 2)
    return np.where(values.min(axis=1)[:, None, None] < 0, turned, spread)
