"""A camera's image as a file without loss, written as fast as a camera exposes: nothing is packed.

PNG of 1280×1024 takes 40 ms to write and 17 ms to read; these take less than one.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def lossless(image: NDArray[Any], number: int) -> tuple[str, bytes]:
    """Return the name and content of image `number`: BMP, or TIFF where it has 16 bits.

    Parameters
    ----------
    image : (H, W) or (H, W, 3), uint8 or uint16
        Blue first where it has colours.
    """
    import cv2

    if image.dtype == np.uint16:
        content = cv2.imencode(".tif", image, [cv2.IMWRITE_TIFF_COMPRESSION, 1])[1]
        return f"{number:012d}.tif", content.tobytes()
    return f"{number:012d}.bmp", cv2.imencode(".bmp", image)[1].tobytes()
