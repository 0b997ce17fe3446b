"""Where in the image boards were seen: the rule that the live guide and the camera's result share."""

import numpy as np

from calib_core.frames import FloatArray

CELLS = (8, 6)
ENOUGH_COVERED = 0.6


def image_coverage(pixels: FloatArray, image_size: tuple[int, int]) -> np.ndarray:
    """Return how many points (N, 2) fall into each of 8 × 6 cells of the image, as (6, 8)."""
    width, height = image_size
    counts, _, _ = np.histogram2d(
        pixels[:, 1], pixels[:, 0], bins=CELLS[::-1], range=((-0.5, height - 0.5), (-0.5, width - 0.5))
    )
    return counts.astype(np.int64)
