"""The width of a stripe's peak, from the peaks of some columns laid over each other."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.kernels.stripe import gather_clean

ImageArray = NDArray[Any]  # uint8 or uint16

BINS_PER_PX = 2


@njit(cache=True, nogil=True, error_model="numpy")
def peak_width(
    image: ImageArray,
    columns: NDArray[np.int32],
    centers: FloatArray,
    hot: float,
    widths: FloatArray,
    shapes: FloatArray,
) -> float:
    """Return the standard deviation (px) of the Gaussian that explains the peaks of some columns best.

    Parameters
    ----------
    image : (H, W)
    columns, centers : (N,)
    hot : float
        Grey value by which a hot pixel stands out of its neighbours.
    widths : (K,)
        Candidates, in equal ratios.
    shapes : (K, 2 reach BINS_PER_PX + 1)
        Their Gaussians over ±reach.
    """
    sums, counts = stack_profile(image, columns, centers, (shapes.shape[1] - 1) // (2 * BINS_PER_PX), hot)
    if not counts.any():
        return widths[0]
    scores = _likeness(sums, counts, shapes)
    best = int(np.argmax(scores))
    if 0 < best < len(widths) - 1:
        low, mid, high = scores[best - 1], scores[best], scores[best + 1]
        if low - 2 * mid + high < 0 and np.isfinite(low + high):
            return widths[best] * (widths[1] / widths[0]) ** (0.5 * (low - high) / (low - 2 * mid + high))
    return widths[best]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz", "arcp"})
def _likeness(sums: FloatArray, counts: FloatArray, shapes: FloatArray) -> FloatArray:
    """Return each shape's likeness (K,) to a profile, its bins weighted by their counts."""
    weight = counts / counts.sum()
    profile = sums / np.maximum(counts, 1.0)
    profile -= (weight * profile).sum()
    scores = np.empty(shapes.shape[0])
    for k in range(shapes.shape[0]):
        shape = shapes[k]
        mean = square = match = 0.0
        for i in range(shape.shape[0]):
            weighted = shape[i] * weight[i]
            mean += weighted
            square += weighted * shape[i]
            match += weighted * profile[i]
        score = match / np.sqrt(max(square - mean * mean, 1e-30))
        scores[k] = score if np.isfinite(score) else -np.inf
    return scores


@njit(cache=True, nogil=True, error_model="numpy")
def stack_profile(
    image: ImageArray, columns: NDArray[np.int32], centers: FloatArray, reach: int, hot: float
) -> tuple[FloatArray, FloatArray]:
    """Lay the peaks of several columns over each other.

    Returns
    -------
    sums, counts : (2 reach BINS_PER_PX + 1,)
        Grey values by their distance from the centre, each column's added up as it is.
    """
    size = 2 * reach * BINS_PER_PX + 1
    sums, counts = np.zeros(size), np.zeros(size)
    window = np.empty(2 * reach, dtype=np.float32)
    for n in range(columns.shape[0]):
        center = centers[n]
        if not np.isfinite(center):
            continue
        top = int(np.ceil(center - reach))
        if top < 0 or top + 2 * reach + 1 > image.shape[0]:
            continue
        gather_clean(image, top, columns[n], hot, window)
        first = int(np.floor((top - center + reach) * BINS_PER_PX + 0.5))
        for k in range(2 * reach):
            sums[first + BINS_PER_PX * k] += window[k]
            counts[first + BINS_PER_PX * k] += 1.0
    return sums, counts
