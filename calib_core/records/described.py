"""A cell that does not stand yet, by its edges: what planning and simulating it go by."""

from typing import Literal

from pydantic import Field

from calib_core.records.base import Finite, Identifier, Positive, Record, Vector3
from calib_core.records.planning import FieldOfView
from calib_core.records.topology import CellAxis, MountedScanner, Sphere

Machine = Literal["arm", "scara", "gantry", "linear"]


class DescribedSphere(Sphere):
    """A ball of a cell that does not stand yet: about where, in base as all axes read zero, or on the flange."""

    center_mm: Vector3 | None = None


class DescribedAxis(CellAxis):
    """An axis of a cell that does not stand yet: between which readings it moves, about where it lies in base."""

    low: Finite | None = None
    high: Finite | None = None
    axis_direction: Vector3 | None = None
    axis_point_mm: Vector3 | None = None

    def ways(self, rotary_deg: float, linear_mm: float) -> tuple[float, float]:
        """Return between which readings it moves, by what an axis of its kind does where nothing is told."""
        low = 0.0 if self.kind == "linear" else -rotary_deg
        high = linear_mm if self.kind == "linear" else rotary_deg
        return low if self.low is None else self.low, high if self.high is None else self.high


class DescribedEdges(Record):
    """What a cell will be made of, by the names that its session will have; what is left out is the plain cell's.

    `machine` is what moves the flange: an arm of six axes, a SCARA, three translations, or one.
    """

    arrangement: Literal["scanner-on-robot", "sphere-on-robot"] | None = None
    scanners: dict[Identifier, MountedScanner] | None = None
    spheres: list[DescribedSphere] | None = None
    axes: list[DescribedAxis] | None = None
    machine: Machine = "arm"

    @property
    def has_edges(self) -> bool:
        """Whether it is another cell than one scanner on the flange of an arm and one still ball."""
        told = (self.arrangement == "sphere-on-robot", self.scanners, self.spheres, self.axes)
        return any(told) or self.machine != "arm"


class DescribedCell(DescribedEdges):
    """A cell to be simulated, as `plan` takes it; lengths in mm."""

    scanner: FieldOfView | None = None
    point_sigma_mm: Positive = 0.02
    sphere_diameter_mm: Positive = 40.0
    kind: Literal["profile", "cloud", "center"] = "profile"
    scans: int = Field(default=0, ge=0, le=100)
