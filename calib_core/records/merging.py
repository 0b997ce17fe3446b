"""How scans are merged, and what the merged part is compared with."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from calib_core.records.base import Matrix4, Positive, Vector3, WrittenRecord, mismatch, require_inside


class Datum(WrittenRecord):
    """A plane or a sphere of the nominal, in its own frame, that is found among the merged points.

    A plane has a `point_mm`, reaches `radius_mm` about it, and has the nominal's own `normal` there where none is
    told.  A sphere has its radius and `center_mm`; or `point_mm` on it, where the nominal's mesh says the centre.
    """

    kind: Literal["plane", "sphere"]
    point_mm: Vector3 | None = None
    center_mm: Vector3 | None = None
    normal: Vector3 | None = None
    radius_mm: Positive

    @model_validator(mode="after")
    def _told_where(self) -> Self:
        if self.point_mm is None and (self.kind == "plane" or self.center_mm is None):
            raise mismatch("'point_mm' of a datum, or a sphere's 'center_mm'", "none", "Tell where it is.")
        if self.normal is not None and not any(self.normal):
            raise mismatch("a 'normal' that points somewhere", "0 0 0", "Leave it out to take the nominal's.")
        return self


class PartAlignment(WrittenRecord):
    """How the nominal part is laid into the merged cloud, to compare them.

    `best-fit` finds it from all points, `3-2-1` lets it touch them at six `datum_points_mm` of its own frame
    (three on the first surface, two on the second, one on the third; points within `datum_radius_mm` count as one
    touch), `datums` lays its planes and spheres on those of the points, `matrix` takes `base_from_reference` as
    told, `none` takes the nominal as it lies in the cloud's frame.
    """

    method: Literal["none", "best-fit", "3-2-1", "datums", "matrix"] = "best-fit"
    base_from_reference: Matrix4 | None = None
    datum_points_mm: Annotated[list[Vector3], Field(min_length=6, max_length=6)] | None = None
    datum_radius_mm: Positive = 2.0
    datums: list[Datum] | None = None

    @model_validator(mode="before")
    @classmethod
    def _named_alone(cls, value: Any) -> Any:
        return {"method": value} if isinstance(value, str) else value

    @model_validator(mode="after")
    def _told_what_it_needs(self) -> Self:
        if self.method == "matrix" and self.base_from_reference is None:
            raise mismatch("'base_from_reference' with the method 'matrix'", "none", "Tell where the part lies.")
        if self.method == "3-2-1" and self.datum_points_mm is None:
            raise mismatch("six 'datum_points_mm' with the method '3-2-1'", "none", "Pick them on the nominal.")
        if self.method == "datums" and not self.datums:
            raise mismatch("'datums' with the method 'datums'", "none", "Pick planes and spheres of the nominal.")
        return self


class MergeSettings(WrittenRecord):
    """How scans are merged; all may be left out.  Voxels beyond `memory_mb` go to the disk meanwhile.

    `voxel_mm` left out is 0.5, or how far the scans' points lie apart where that is much more.
    `registration` may move each scan, `self_calibration` tool and table alone, by what the scans' overlap says.
    `holes` of the Poisson mesh are left where they are left out, `fill` makes it watertight; with
    `mesh_tolerance_mm` it has fewer triangles, none farther off than that.
    `reference` names a mesh file of the session, the part as it should be; `alignment` says how it is laid into
    the cloud (best fit where it is left out), and `tolerance_mm` how far the part may lie off it.
    """

    voxel_mm: Positive | None = None
    mesh: Literal["poisson", "grid", "none"] = "poisson"
    holes: Literal["leave", "fill"] | None = None
    mesh_tolerance_mm: Positive | None = None
    registration: bool = False
    self_calibration: bool = False
    memory_mb: Positive = 1000.0
    reference: str | None = None
    alignment: PartAlignment | None = None
    tolerance_mm: Positive | None = None

    @model_validator(mode="after")
    def _one_surface_alone_is_closed(self) -> Self:
        if self.holes == "fill" and self.mesh == "grid":
            raise mismatch(
                "'mesh' 'poisson' with 'holes' 'fill'", "'grid'", "Sheets of scans overlap; take poisson."
            )
        return self

    @field_validator("reference")
    @classmethod
    def _reference_stays_inside(cls, name: str | None) -> str | None:
        if name is not None:
            require_inside(name)
        return name
