"""The scanner's pose on the flange, from a sphere that stands still."""

from typing import TYPE_CHECKING, ClassVar

from calib_core.cell.found import SCANNER_FRAMES, own_base, told_by_axes
from calib_core.graph.stage import SPHERE_FIELDS, SPHERE_READS, Stage
from calib_core.stages.raw_frames import rests_on_optics
from calib_core.steps import CaptureStep

if TYPE_CHECKING:
    from calib_core.records import Session


class Tcp(Stage):
    """The scanner's pose on the flange, from a sphere that stands still."""

    name, title, place = "tcp", "Scanner on the flange (TCP)", 30
    step = CaptureStep(
        "tcp", "TCP", "sphere", "Capture the sphere from several robot poses and add them to the session.", least=5
    )
    method_revision = 29  # lengths that only the poses as told need are not held against the workpiece
    planned = True
    takes: ClassVar = {"tcp": (*SPHERE_FIELDS, "device_time_s", "mount")}
    reads = SPHERE_READS
    known = SCANNER_FRAMES
    after = ("camera", "laser-plane")
    guided = ("tcp",)
    is_answer = True
    frames: ClassVar = dict.fromkeys(SCANNER_FRAMES, "covariance")
    layers = ("sphere", "captures", "scanner")

    def is_wanted(self, session: "Session") -> bool:
        """Return whether neither balls on axes tell where the scanner is, nor a table where no base matters."""
        alone = own_base(session.cell, session.captures) is not None
        return not alone and not told_by_axes(session.cell, session.captures)

    def rests_on(self, session: "Session") -> tuple[str, ...]:
        """Return the stages that it rests on: none where the scanner delivers points."""
        return rests_on_optics(session, self.takes)


STAGE = Tcp()
