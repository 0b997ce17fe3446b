"""What a cell's chain is made of: scanners, balls and axes by name, and frames that are known of it."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from calib_core.records.base import (
    Finite,
    Identifier,
    Kind,
    Matrix4,
    NotNegative,
    OpenRows,
    OpenVector3,
    Positive,
    Record,
    WrittenRecord,
    mismatch,
)
from calib_core.records.planning import FieldOfView

Row6 = Annotated[list[Finite], Field(min_length=6, max_length=6)]


class Scanner(WrittenRecord):
    """What kind of data the scanner delivers and how noisy it is.

    `errors`: what becomes of a scale, shear or bow that is found with the tool: `cover` (left out) solves the tool
    for the files as they are, `apply` solves it for points from which the errors are taken out.

    `field_of_view` and `pitch_mm` (between points along the stripe) are for planning alone.
    """

    kind: Kind | None = None
    point_sigma_mm: Positive | None = None
    z_axis: Literal["away", "toward"] | None = None
    errors: Literal["cover", "apply"] | None = None
    field_of_view: FieldOfView | None = None
    pitch_mm: Positive | None = None


class MountedScanner(Scanner):
    """One of several scanners: it is on the flange, or stands still in the robot's base."""

    on: Literal["tool0", "base"] = "tool0"


class Sphere(WrittenRecord):
    """One of several balls; what is left out is the cell's sphere's, and where it is the captures tell.

    `on` is what carries it: `base`, `tool0` or the name of an axis.
    """

    name: Identifier
    diameter_mm: Positive | None = None
    diameter_sigma_mm: NotNegative | None = None
    on: Identifier | None = None


class SphereDistance(WrittenRecord):
    """A distance between the centres of two balls of the cell that is known: a measurement."""

    between: Annotated[list[Identifier], Field(min_length=2, max_length=2)]
    mm: Positive
    sigma_mm: NotNegative | None = None


class CellAxis(WrittenRecord):
    """An axis that turns or shifts the object, or the robot's own base.

    It stands on the axis before it in the list that carries the same, the first one on base; `on` says otherwise.
    `direction` is 1 where a rotary axis counts right-handed about the end that points up in base.  With `encoder`
    left out, its scale (a gear ratio) is an unknown where the captures leave no doubt that it is off.
    """

    name: Identifier
    kind: Literal["rotary", "linear"]
    carries: Literal["object", "robot"] = "object"
    on: Identifier | None = None
    direction: Literal[1, -1] | None = None
    sigma_deg: NotNegative | None = None
    sigma_mm: NotNegative | None = None
    encoder: Literal["exact", "scale"] | None = None

    @model_validator(mode="after")
    def _sigma_is_of_its_kind(self) -> "CellAxis":
        wrong = "sigma_mm" if self.kind == "rotary" else "sigma_deg"
        if getattr(self, wrong) is not None:
            right = "sigma_deg" if self.kind == "rotary" else "sigma_mm"
            raise mismatch(f"{right} of the {self.kind} axis '{self.name}'", wrong, f"Give {right}.")
        return self


class KnownFrame(WrittenRecord):
    """A transform `into` `outof` that the user brings; a covariance that is left out is not told, not zero."""

    into: Identifier
    outof: Identifier
    scanner: Identifier | None = None
    matrix: Matrix4
    covariance: Annotated[list[Row6], Field(min_length=6, max_length=6)] | None = None


class _Carried(Record):
    """What was found in the frame of what carries it: the field `in`."""

    model_config = ConfigDict(serialize_by_alias=True, validate_by_name=True, validate_by_alias=True)

    name: str
    carrier: str = Field(alias="in")


class FoundSphere(_Carried):
    """Where a ball's centre is `in` what carries it, its covariance (3, 3) in mm², and who saw it."""

    center_mm: OpenVector3
    covariance: OpenRows
    captures: list[str] = Field(default_factory=list[str])


class FoundAxis(_Carried):
    """An axis `in` base, as it stands there where all axes read zero.

    What it carries is moved by its reading times `direction` and `scale`, from where it is at zero: turned about
    `axis_direction` through `axis_point_mm`, or shifted along it (there is no point then).  An axis that stands on
    another is moved by that one after.  `covariance` (6, 6) is of rx ry rz tx ty tz of the axis's frame, whose z
    lies along it.
    """

    kind: Literal["rotary", "linear"]
    axis_direction: OpenVector3
    axis_point_mm: OpenVector3 | None = None
    direction: Literal[1, -1] = 1
    scale: float = 1.0
    scale_sigma: float | None = None
    covariance: OpenRows


class TopologyFields(Record):
    """All balls and axes that a stage found, by name."""

    spheres: list[FoundSphere] = Field(default_factory=list[FoundSphere])
    axes: list[FoundAxis] = Field(default_factory=list[FoundAxis])
