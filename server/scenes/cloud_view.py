"""How the merged cloud is looked at: its colours, where it is cut open, and what it is compared with."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError
from calib_core.frames import FloatArray

CloudColors = Literal["by height", "by scan", "by intensity", "by deviation"]
CLOUD_COLORS: tuple[CloudColors, ...] = get_args(CloudColors)

Axis = Literal["x", "y", "z"]
AXES: tuple[Axis, ...] = get_args(Axis)

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Section:
    """A plane in the cloud's frame that hides what lies beyond it, or before it.

    Attributes
    ----------
    axis : {"x", "y", "z"}
        What the plane lies across, where no normal is given.
    at_mm : float
        How far from zero, along axis or normal.
    keep : {"below", "above"}
        Which side stays.
    normal : (3,), optional
        Unit vector of a plane that lies across no axis.
    """

    axis: Axis
    at_mm: float
    keep: Literal["below", "above"] = "below"
    normal: Vector | None = None

    @property
    def directions(self) -> FloatArray:
        """Unit vectors of the two axes in the plane and of its normal, as rows (3, 3).

        Across an axis the other two, in their order; else one that is level, and one that rises most.
        """
        if self.normal is None:
            number = AXES.index(self.axis)
            return np.eye(3)[[*(other for other in range(3) if other != number), number]]
        normal = np.array(self.normal)
        level = np.array([-normal[1], normal[0], 0.0])
        if np.linalg.norm(level) < 1e-6:
            level = np.array([1.0, 0.0, 0.0])
        level = level - normal * (level @ normal)
        level /= np.linalg.norm(level)
        rising = np.cross(normal, level)
        turned = -1.0 if rising[2] < 0 else 1.0
        return np.stack([turned * level, turned * rising, normal])

    def along_mm(self, points_mm: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return how far the points (N, 3) lie along the normal."""
        return points_mm[:, AXES.index(self.axis)] if self.normal is None else points_mm @ np.array(self.normal)

    def keeps(self, points_mm: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Return which of the points (N, 3) stay."""
        along = self.along_mm(points_mm)
        return along <= self.at_mm if self.keep == "below" else along >= self.at_mm


def section_of(
    axis: Axis, at_mm: float, keep: Literal["below", "above"] = "below", normal: list[float] | None = None
) -> Section:
    """Return a section across an axis or, where one is told, a normal; InputError where it is zero."""
    if normal is None:
        return Section(axis, at_mm, keep)
    length = float(np.linalg.norm(normal))
    if not (np.isfinite(length) and length > 1e-9):
        raise InputError("a normal that points somewhere", "0 0 0", "Pick three points not in a line.", "normal")
    x, y, z = (np.array(normal) / length).tolist()
    return Section(axis, at_mm, keep, (x, y, z))


@dataclass(frozen=True)
class Against:
    """What the cloud is compared with: the reference mesh, or the sphere in it (of this diameter, or best fit)."""

    kind: Literal["mesh", "sphere"] = "mesh"
    diameter_mm: float | None = None


@dataclass(frozen=True)
class CloudView:
    """How the merged cloud is shown; `picked_mm` are points that are marked on it."""

    colors: CloudColors = "by height"
    section: Section | None = None
    against: Against = Against()
    picked_mm: tuple[Vector, ...] = ()
