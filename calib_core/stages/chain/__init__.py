"""Scanner and turntable from all captures together."""

from typing import TYPE_CHECKING, ClassVar

from calib_core.cell.found import SCANNER_FRAMES, own_base, told_by_axes
from calib_core.graph.stage import SPHERE_FIELDS, SPHERE_READS, Stage
from calib_core.stages.raw_frames import rests_on_optics

if TYPE_CHECKING:
    from calib_core.records import Session


class Chain(Stage):
    """Scanner and turntable from all captures together."""

    name, title, place = "chain", "Whole chain", 50
    takes: ClassVar = {"tcp": (*SPHERE_FIELDS, "mount"), "turntable": (*SPHERE_FIELDS, "table_deg", "mount")}
    reads = (
        *SPHERE_READS, "turntable.direction", "turntable.angle_sigma_deg", "turntable.encoder", "turntable.angles",
    )  # fmt: skip
    known = (*SCANNER_FRAMES, "base_from_turntable")
    method_revision = 30  # lengths that only the poses as told need are not held against the workpiece
    after = ("camera", "laser-plane", "tcp", "turntable")
    answers = ("tcp", "turntable")
    is_answer = True
    frames: ClassVar = {
        **dict.fromkeys(SCANNER_FRAMES, "covariance"),
        "base_from_turntable": "turntable_covariance",
    }
    optional = True
    needs_every_step = True

    def has_captures(self, session: "Session") -> bool:
        """Return whether it has captures of both kinds, or of balls on axes by which it finds scanners, too."""
        return super().has_captures(session) or told_by_axes(session.cell, session.captures)

    def is_wanted(self, session: "Session") -> bool:
        """Return whether anything ties the captures of the table to those of the still sphere."""
        return own_base(session.cell, session.captures) is None

    def rests_on(self, session: "Session") -> tuple[str, ...]:
        """Return the stages that it begins at, and what turns raw frames into points."""
        return (*rests_on_optics(session, self.takes), "tcp", "turntable")


STAGE = Chain()
