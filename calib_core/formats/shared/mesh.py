"""Triangle meshes: what readers of them give, and how they refuse."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError, TooLargeError
from calib_core.messages import message

MAX_TRIANGLES = 5_000_000


@dataclass(frozen=True, eq=False)
class MeshData:
    """A mesh: corners (C, 3) in mm, triangles (M, 3), counter-clockwise from outside."""

    corners_mm: NDArray[np.floating]
    triangles: NDArray[np.int32]


def require_few(count: int, name: str) -> None:
    """Refuse more than `MAX_TRIANGLES`; raises TooLargeError."""
    if count > MAX_TRIANGLES:
        to_do = message("Export it with a coarser tolerance.")
        need = "at most {max_triangles:,} triangles"
        raise TooLargeError(need, f"{count:,}", to_do, name, max_triangles=MAX_TRIANGLES)


def wrong(name: str, got: str, to_do: str = "Export the mesh again, as STL, PLY or OBJ.") -> InputError:
    """Return the error of a file that holds no whole mesh."""
    return InputError("a whole mesh file", got, to_do, name)
