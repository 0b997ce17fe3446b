"""The scanner's pose on the flange, from a sphere that stands still."""

from typing import TYPE_CHECKING, ClassVar

from calib_core.stages.stage import SPHERE_FIELDS, SPHERE_READS, CaptureStep, Stage, rests_on_optics

if TYPE_CHECKING:
    from calib_core.records import GuideNow, Session
    from calib_core.stages.given import StageInput
    from calib_core.stages.guide import GuideView
    from calib_core.stages.tcp.record import TcpResult


class Tcp(Stage):
    """The scanner's pose on the flange, from a sphere that stands still."""

    name, title, place = "tcp", "Scanner on the flange (TCP)", 30
    step = CaptureStep(
        "tcp", "TCP", "sphere", "Capture the sphere from several robot poses and add them to the session.", least=5
    )
    planned = True
    takes: ClassVar = {"tcp": (*SPHERE_FIELDS, "device_time_s")}
    reads = SPHERE_READS
    known = ("tool0_from_laser",)
    after = ("camera", "laser-plane")
    guided = ("tcp",)
    is_answer = True
    layers = ("sphere", "captures", "scanner")

    @property
    def result(self) -> "type[TcpResult]":
        """The record of its result."""
        from calib_core.stages.tcp.record import TcpResult

        return TcpResult

    def solve(self, given: "StageInput") -> "TcpResult":
        """Return its result; raises CalibrationError."""
        from calib_core.stages.tcp.solve import solve_tcp_stage

        return solve_tcp_stage(given)

    def rests_on(self, session: "Session") -> tuple[str, ...]:
        """Return the stages that it rests on: none where the scanner delivers points."""
        return rests_on_optics(session, [capture for capture in session.captures if capture.step in self.takes])

    def guide(self, view: "GuideView") -> "GuideNow | None":
        """Return what to do now for it, None where it asks for nothing."""
        from calib_core.stages.tcp.guide import tcp_now

        return tcp_now(view)


STAGE = Tcp()
