"""What is kept of a capture once it was looked at, beside boards and stripes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.sphere.arc import ArcFit
from calib_core.sphere.cloud import SphereFit


@dataclass(frozen=True, eq=False)
class Seen:
    """The points of one capture, and the circle or sphere fitted to them."""

    points: FloatArray
    on_sphere: NDArray[np.bool_]
    fit: ArcFit | SphereFit
    without_ray: int = 0


@dataclass(frozen=True)
class Doubts:
    """Why a file should be looked at before it is used."""

    sentences: list[str]
