"""How the merged cloud is looked at: its colours, where it is cut open, and what it is compared with."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

CloudColors = Literal["by height", "by scan", "by deviation"]
CLOUD_COLORS: tuple[CloudColors, ...] = get_args(CloudColors)

Axis = Literal["x", "y", "z"]
AXES: tuple[Axis, ...] = get_args(Axis)


@dataclass(frozen=True)
class Section:
    """A plane across an axis of the cloud's frame that hides what lies beyond it, or before it.

    Attributes
    ----------
    axis : {"x", "y", "z"}
    at_mm : float
    keep : {"below", "above"}
        Which side stays.
    """

    axis: Axis
    at_mm: float
    keep: Literal["below", "above"] = "below"

    @property
    def number(self) -> int:
        """The axis as a column."""
        return AXES.index(self.axis)

    def keeps(self, points_mm: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Return which of the points (N, 3) stay."""
        along = points_mm[:, self.number]
        return along <= self.at_mm if self.keep == "below" else along >= self.at_mm


@dataclass(frozen=True)
class Against:
    """What the cloud is compared with: the reference mesh, or the sphere in it (of this diameter, or best fit)."""

    kind: Literal["mesh", "sphere"] = "mesh"
    diameter_mm: float | None = None


@dataclass(frozen=True)
class CloudView:
    """How the merged cloud is shown."""

    colors: CloudColors = "by height"
    section: Section | None = None
    against: Against = Against()
