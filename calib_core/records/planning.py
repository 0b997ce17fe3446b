"""What a cell may say of its room and of what is wanted, so that poses can be planned in it."""

from typing import Annotated

from pydantic import Field, model_validator

from calib_core.messages import message
from calib_core.records.base import Finite, Matrix4, Positive, Record, Vector3, mismatch

_LARGEST_FIELD_MM = 1e5


class FieldOfView(Record):
    """Where the scanner measures: from `near_mm` to `far_mm` away from it, and how wide at both."""

    near_mm: Positive
    far_mm: Positive
    near_width_mm: Positive
    far_width_mm: Positive | None = None

    @model_validator(mode="after")
    def _far_is_farther(self) -> "FieldOfView":
        if self.far_mm <= self.near_mm:
            got = message("{far_mm:g} beside near_mm {near_mm:g}", far_mm=self.far_mm, near_mm=self.near_mm)
            raise mismatch("far_mm beyond near_mm", got, "Give both as distances from the scanner.")
        largest_mm = max(self.far_mm, self.near_width_mm, self.far_width_mm or 0.0)
        if largest_mm > _LARGEST_FIELD_MM:
            raise mismatch("a field of view of at most 100 m", f"{largest_mm:g} mm", "Give it in millimetres.")
        return self


class Box(Record):
    """A box along the axes of the robot's base, mm."""

    low_mm: Vector3
    high_mm: Vector3

    @model_validator(mode="after")
    def _high_is_higher(self) -> "Box":
        if any(high <= low for low, high in zip(self.low_mm, self.high_mm, strict=True)):
            raise mismatch("high_mm above low_mm on every axis", f"{self.high_mm}", "Swap them where needed.")
        return self


class Limits(Record):
    """Where planned poses must stay.

    `reach` holds the flange; `tilt_deg` is how far the scanner may lean from its first orientation and `turn_deg`
    how far it may turn about its own z; flange, scanner and the light between them keep `clearance_mm` from each
    box of `no_go`, and the scanner as much from the sphere.
    """

    reach: Box | None = None
    tilt_deg: Annotated[float, Field(gt=0, le=90)] | None = None
    turn_deg: Annotated[float, Field(gt=0, le=180)] | None = None
    no_go: list[Box] = Field(default_factory=list[Box])
    clearance_mm: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None


class Nominal(Record):
    """About where things are, from a drawing or a tape measure: good enough to plan the first captures.

    `base_from_tool0` is a pose, 4×4, from which the scanner looks at the middle of where it may go;
    `base_from_turntable` about where the table stands.
    """

    tool0_from_laser: Matrix4 | None = None
    tool_sigma_mm: Positive | None = None
    tool_sigma_deg: Positive | None = None
    sphere_center_in_base_mm: Annotated[list[Finite], Field(min_length=3, max_length=3)] | None = None
    base_from_tool0: Matrix4 | None = None
    base_from_turntable: Matrix4 | None = None
