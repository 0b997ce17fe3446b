"""Whether a calibration still holds: some of its poses captured again, the sphere still in its place."""

from typing import TYPE_CHECKING, ClassVar

from calib_core.stages.stage import SPHERE_FIELDS, SPHERE_READS, CaptureStep, Stage, rests_on_optics

if TYPE_CHECKING:
    from calib_core.records import GuideNow, Session
    from calib_core.stages.given import StageInput
    from calib_core.stages.guide import GuideView
    from calib_core.stages.recheck.record import RecheckResult


class Recheck(Stage):
    """Whether a calibration still holds: some of its poses captured again, the sphere still in its place."""

    name, title, place = "recheck", "Recheck", 65
    step = CaptureStep(
        "recheck",
        "Recheck",
        "sphere",
        "Leave the sphere in its place and capture it again from three poses of the calibration.",
        letter="r",
    )
    takes: ClassVar = {"recheck": SPHERE_FIELDS, "tcp": SPHERE_FIELDS}
    reads = SPHERE_READS
    after = ("camera", "laser-plane", "tcp", "chain")
    optional = True
    needs_every_step = True
    layers = ("sphere", "captures", "scanner")

    @property
    def result(self) -> "type[RecheckResult]":
        """The record of its result."""
        from calib_core.stages.recheck.record import RecheckResult

        return RecheckResult

    def solve(self, given: "StageInput") -> "RecheckResult":
        """Return its result; raises CalibrationError."""
        from calib_core.stages.recheck.solve import solve_recheck_stage

        return solve_recheck_stage(given)

    def rests_on(self, session: "Session") -> tuple[str, ...]:
        """Return the stage that gives the answer, and what turns raw frames into points."""
        own = [capture for capture in session.captures if capture.step in self.takes]
        steps = {capture.step for capture in session.captures if not capture.excluded}
        table = "turntable" in steps and session.cell.known.base_from_turntable is None
        return (*rests_on_optics(session, own), "chain" if table else "tcp")

    def guide(self, view: "GuideView") -> "GuideNow | None":
        """Return what to do now for it, None where nobody began it."""
        from calib_core.stages.recheck.guide import recheck_now

        return recheck_now(view)


STAGE = Recheck()
