"""Whether a calibration still holds: some of its poses captured again, the sphere still in its place."""

from typing import TYPE_CHECKING, ClassVar

from calib_core.graph.stage import SPHERE_FIELDS, SPHERE_READS, Stage
from calib_core.stages.raw_frames import rests_on_optics
from calib_core.steps import CaptureStep

if TYPE_CHECKING:
    from calib_core.records import Session


class Recheck(Stage):
    """Whether a calibration still holds: some of its poses captured again, the sphere still in its place."""

    name, title, place = "recheck", "Recheck", 65
    method_revision = 5  # narrow arcs that tell their radius to 1 % count
    step = CaptureStep(
        "recheck",
        "Recheck",
        "sphere",
        "Leave the sphere in its place and capture it again from three poses of the calibration.",
        letter="r",
    )
    takes: ClassVar = {"recheck": (*SPHERE_FIELDS, "mount"), "tcp": (*SPHERE_FIELDS, "mount")}
    reads = SPHERE_READS
    after = ("camera", "laser-plane", "tcp", "chain")
    optional = True
    needs_every_step = True
    layers = ("sphere", "captures", "scanner")

    def rests_on(self, session: "Session") -> tuple[str, ...]:
        """Return the stage that gives the answer, and what turns raw frames into points."""
        steps = {capture.step for capture in session.captures if not capture.excluded}
        table = "turntable" in steps and session.cell.known.base_from_turntable is None
        return (*rests_on_optics(session, self.takes), "chain" if table else "tcp")


STAGE = Recheck()
