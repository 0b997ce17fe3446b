"""The answer verified: captures of the sphere that were not used for it, seen with its tool."""

from typing import TYPE_CHECKING, ClassVar

from calib_core.cell.found import known_scanner, own_base
from calib_core.graph.stage import SCAN_FIELDS, SPHERE_FIELDS, SPHERE_READS, Stage
from calib_core.stages.raw_frames import rests_on_optics
from calib_core.steps import CaptureStep

if TYPE_CHECKING:
    from calib_core.records import Session


class Verify(Stage):
    """The answer verified by captures of the sphere that were not used for it."""

    name, title, place = "verify", "Verification", 60
    method_revision = 15  # a ball on the one axis that carries every ball told needs no name
    step = CaptureStep(
        "verify",
        "Verification",
        "sphere",
        "Capture the sphere, standing still, from poses that were not used for the TCP.",
        letter="v",
    )
    further_steps = (
        CaptureStep(
            "plate",
            "Flat plate",
            "object",
            "Capture a flat plate, standing still, with the flange turned to all sides.",
            least=4,
        ),
    )
    planned = True
    takes: ClassVar = {"verify": (*SPHERE_FIELDS, "mount"), "plate": SCAN_FIELDS}
    reads = (*SPHERE_READS, "verification")
    settings_field = "verification"
    after = ("camera", "laser-plane", "tcp", "chain")
    guided = ("verify",)
    optional = True
    layers = ("sphere", "captures", "scanner")

    def is_wanted(self, session: "Session") -> bool:
        """Return whether there can be a scanner that the robot's base knows."""
        return own_base(session.cell, session.captures) is None

    def rests_on(self, session: "Session") -> tuple[str, ...]:
        """Return the stage that gives the answer, and what turns raw frames into points."""
        steps = {capture.step for capture in session.captures if not capture.excluded}
        known = session.cell.known
        brought = known_scanner(session.cell) is not None or known.base_from_turntable is not None
        return (
            *rests_on_optics(session, self.takes),
            "chain" if "turntable" in steps and not brought else "tcp",
        )


STAGE = Verify()
