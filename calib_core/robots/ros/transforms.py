"""A tree of transforms as /tf builds it: from the base to the flange wherever the way is known."""

from collections.abc import Collection

import numpy as np

from calib_core.errors import InputError
from calib_core.frames import FloatArray
from calib_core.poses.numbers import parse_pose

_DEEPEST = 60


class Tree:
    """The newest transform of each frame in its parent."""

    def __init__(self, base: Collection[str], flange: Collection[str]) -> None:
        self._base, self._flange = base, flange
        self._edges: dict[str, tuple[str, FloatArray]] = {}

    def put(self, parent: str, child: str, numbers: tuple[float, ...]) -> None:
        """Set one edge; raises ValueError with a phrase where it is no transform."""
        try:
            matrix = parse_pose("ros", numbers).matrix
        except InputError as error:
            raise ValueError(f"{error.got}") from None
        self._edges[child.lstrip("/")] = (parent.lstrip("/"), matrix)

    def frames(self) -> list[str]:
        """Return the names of all frames."""
        return sorted({*self._edges, *(parent for parent, _ in self._edges.values())})

    def above(self, names: Collection[str]) -> set[str]:
        """Return all frames on the way from these upwards."""
        found = {frame for frame in self._edges if frame.lower() in names}
        for _ in range(_DEEPEST):
            found |= {self._edges[frame][0] for frame in found if frame in self._edges}
        return found

    def from_base(self, frame: str) -> tuple[str, FloatArray] | None:
        """Return the base's name and the matrix from a frame into it; None for the base, and without a way."""
        matrix: FloatArray = np.eye(4)
        for _ in range(_DEEPEST):
            edge = self._edges.get(frame)
            if frame.lower() in self._base or edge is None:
                return None
            frame, matrix = edge[0], edge[1] @ matrix
            if frame.lower() in self._base:
                return frame, matrix
        return None

    def base_from_flange(self) -> tuple[str, str, FloatArray] | None:
        """Return the names of base and flange and the matrix between them; None where there is no way."""
        for child in [name for name in self._edges if name.lower() in self._flange]:
            matrix: FloatArray = np.eye(4)
            frame = child
            best: tuple[str, str, FloatArray] | None = None
            for _ in range(_DEEPEST):
                edge = self._edges.get(frame)
                if edge is None:
                    break
                frame, matrix = edge[0], edge[1] @ matrix
                if frame.lower() in self._base:
                    best = (frame, child, matrix)
                    if frame.lower() == "base":
                        return best
            if best is not None:
                return self._in_controllers_base(*best)
        return None

    def _in_controllers_base(self, root: str, child: str, matrix: FloatArray) -> tuple[str, str, FloatArray]:
        """Return the way from the controller's own base, where the recording says how it stands in `base_link`."""
        edge = self._edges.get("base")
        if edge is None or edge[0] != root or "base" not in self._base:
            return root, child, matrix
        return "base", child, np.linalg.inv(edge[1]) @ matrix
