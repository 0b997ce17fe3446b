"""The turntable's axis, from the sphere on it."""

from typing import TYPE_CHECKING, ClassVar

from calib_core.graph.stage import SPHERE_FIELDS, SPHERE_READS, Stage
from calib_core.stages.raw_frames import rests_on_optics
from calib_core.steps import CaptureStep

if TYPE_CHECKING:
    from calib_core.records import Session


class Turntable(Stage):
    """The turntable's axis, from the sphere on it."""

    name, title, place = "turntable", "Turntable", 40
    method_revision = 17  # the ± has room for spheres on the other side of the plane of light
    step = CaptureStep(
        "turntable",
        "Turntable",
        "sphere-on-table",
        "Fix the sphere on the table, capture it at 8 angles, and again at a second height.",
        least=4,
        letter="t",
    )
    planned = True
    takes: ClassVar = {"turntable": (*SPHERE_FIELDS, "table_deg", "mount")}
    reads = (
        *SPHERE_READS, "turntable.direction", "turntable.angle_sigma_deg", "turntable.encoder", "turntable.angles",
    )  # fmt: skip
    known = ("base_from_turntable",)
    after = ("camera", "laser-plane", "tcp")
    guided = ("turntable",)
    optional = True
    settings_field = "turntable"
    frames: ClassVar = {"base_from_turntable": "covariance"}
    layers = ("turntable",)

    def is_wanted(self, session: "Session") -> bool:
        """Return whether the cell tells of a table or an axis that carries the object, or has captures of one."""
        from calib_core.cell.axes import moves_object
        from calib_core.stages.turntable.guide import wants_turntable

        return moves_object(session.cell) or wants_turntable(session)

    def rests_on(self, session: "Session") -> tuple[str, ...]:
        """Return the stages that it rests on: the tool, and what turns raw frames into points."""
        return (*rests_on_optics(session, self.takes), "tcp")


STAGE = Turntable()
