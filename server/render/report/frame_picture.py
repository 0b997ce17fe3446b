"""A capture's frame as it stands in a report, which needs no other file."""

from base64 import b64encode
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import CalibrationError
from calib_core.formats.shared.images import decode_image
from calib_core.records.callbacks import ReadFile

_WIDEST_PX = 480


def address_of(read: ReadFile | None) -> Callable[[str], str]:
    """Return what gives a frame's picture as an address with all of it, "" where it cannot be read."""

    def address(name: str) -> str:
        if read is None:
            return ""
        try:
            image = decode_image(read(name), name)
        except CalibrationError:  # the report goes out without it
            return ""
        return f"data:image/jpeg;base64,{b64encode(_small_jpeg(image)).decode()}"

    return address


def _small_jpeg(image: NDArray[Any]) -> bytes:
    import cv2

    by = min(1.0, _WIDEST_PX / image.shape[1])
    small = cv2.resize(image, None, fx=by, fy=by, interpolation=cv2.INTER_AREA)
    shown = small[..., ::-1] if small.ndim == 3 else small
    shown = shown if image.dtype == np.uint8 else (shown // 256).astype(np.uint8)
    return cv2.imencode(".jpg", np.ascontiguousarray(shown))[1].tobytes()
