"""A frame's noise: of the dark surroundings, and how it grows with the stripe's light."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.frames import FloatArray

ImageArray = NDArray[Any]  # uint8 or uint16


@njit(cache=True, nogil=True, error_model="numpy")
def surroundings_variance(image: ImageArray, samples: int) -> float:
    """Return the variance of the grey values where nothing is seen, from neighbouring pixels' differences."""
    differences = _neighbour_differences(image, samples)
    limit = 4.5 * max(0.5, float(middling(differences)))
    total, count = 0.0, 0
    for difference in differences:
        usual = difference <= limit
        total += float(difference) * float(difference) if usual else 0.0
        count += usual
    return total / count / 2


@njit(cache=True, nogil=True, error_model="numpy")
def middling(values: NDArray[np.int32]) -> int:
    """Return the middling (the upper of two) of whole numbers that are not negative, by halving their range."""
    below, top = -1, np.int32(values.max())
    while top - below > 1:
        guess = np.int32((below + top) // 2)
        count = np.int32(0)
        for value in values:
            count += np.int32(value <= guess)
        if count > values.shape[0] // 2:
            top = guess
        else:
            below = guess
    return int(top)


@njit(cache=True, nogil=True, error_model="numpy")
def _neighbour_differences(image: ImageArray, samples: int) -> NDArray[np.int32]:
    """Return how far pixels (samples,), taken evenly over the image, are from their right neighbours."""
    height, width = image.shape
    differences = np.empty(samples, np.int32)
    usable = height * (width - 1)
    step = max(1, (usable // samples) | 1)
    down, across = step // (width - 1), step % (width - 1)
    i, j = 0, 0
    for n in range(samples):
        differences[n] = abs(np.int32(image[i, j + 1]) - np.int32(image[i, j]))
        i, j = i + down, j + across
        if j >= width - 1:
            i, j = i + 1, j - (width - 1)
        if i >= height:
            i -= height
    return differences


@njit(cache=True, nogil=True, error_model="numpy")
def noise_growth(measured: FloatArray, variance: float, taps: int, mean_shape: float) -> tuple[float, float]:
    """Return by how much the variance grows with the light, and the usual amplitude, of measured peaks (5, S)."""
    amplitude, excess = np.empty(measured.shape[1]), np.empty(measured.shape[1])
    count = 0
    for j in range(measured.shape[1]):
        if np.isfinite(measured[0, j]) and measured[2, j] > 0.0:
            amplitude[count] = measured[2, j]
            excess[count] = (measured[3, j] / (taps - 3) - variance) / measured[2, j]
            count += 1
    if count == 0:
        return 0.0, 1.0
    light = np.median(excess[:count]) / mean_shape
    return max(0.0, light), np.median(amplitude[:count])
