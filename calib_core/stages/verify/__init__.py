"""The answer verified: captures of the sphere that were not used for it, seen with its tool."""

from typing import TYPE_CHECKING, ClassVar

from calib_core.stages.stage import SCAN_FIELDS, SPHERE_FIELDS, SPHERE_READS, CaptureStep, Stage, rests_on_optics

if TYPE_CHECKING:
    from calib_core.records import GuideNow, Session
    from calib_core.stages.given import StageInput
    from calib_core.stages.guide import GuideView
    from calib_core.stages.verify.record import VerifyResult


class Verify(Stage):
    """The answer verified by captures of the sphere that were not used for it."""

    name, title, place = "verify", "Verification", 60
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

    @property
    def result(self) -> "type[VerifyResult]":
        """The record of its result."""
        from calib_core.stages.verify.record import VerifyResult

        return VerifyResult

    def solve(self, given: "StageInput") -> "VerifyResult":
        """Return its result; raises CalibrationError."""
        from calib_core.stages.verify.solve import solve_verify_stage

        return solve_verify_stage(given)

    def rests_on(self, session: "Session") -> tuple[str, ...]:
        """Return the stage that gives the answer, and what turns raw frames into points."""
        own = [capture for capture in session.captures if capture.step in self.takes]
        steps = {capture.step for capture in session.captures if not capture.excluded}
        known = session.cell.known
        brought = known.tool0_from_laser is not None or known.base_from_turntable is not None
        return (
            *rests_on_optics(session, own),
            "chain" if {"tcp", "turntable"} <= steps and not brought else "tcp",
        )

    def guide(self, view: "GuideView") -> "GuideNow | None":
        """Return what to do now for it, None where it asks for nothing."""
        from calib_core.stages.verify.guide import verify_now

        return verify_now(view)


STAGE = Verify()
