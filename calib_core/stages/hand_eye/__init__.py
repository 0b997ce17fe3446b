"""The board as a second opinion: camera on the flange from frames of a fixed board, beside the sphere's answer."""

from typing import TYPE_CHECKING, ClassVar

from calib_core.stages.stage import FRAME_FIELDS, Stage

if TYPE_CHECKING:
    from calib_core.records import Capture, Session
    from calib_core.stages.given import StageInput
    from calib_core.stages.hand_eye.record import HandEyeResult

_LEAST_FRAMES = 4


class BoardHandEye(Stage):
    """The board as a second opinion: camera on the flange from frames of a fixed board, beside the sphere's."""

    name, title, place = "hand-eye", "Board hand-eye", 57
    takes: ClassVar = {"camera": (*FRAME_FIELDS, "pose"), "laser-plane": (*FRAME_FIELDS, "pose", "board_of")}
    reads = ("board", "pose_convention", "robot.position_sigma_mm", "robot.orientation_sigma_deg")
    after = ("camera", "laser-plane", "tcp", "chain")
    optional = True
    layers = ("scanner",)

    @property
    def result(self) -> "type[HandEyeResult]":
        """The record of its result."""
        from calib_core.stages.hand_eye.record import HandEyeResult

        return HandEyeResult

    def solve(self, given: "StageInput") -> "HandEyeResult":
        """Return its result; raises CalibrationError."""
        from calib_core.stages.hand_eye.solve import solve_hand_eye_stage

        return solve_hand_eye_stage(given)

    def is_wanted(self, session: "Session") -> bool:
        """Return whether a board stands still while the flange moves, in enough frames."""
        board = session.cell.board
        return board is not None and board.fixed and len(_posed(session)) >= _LEAST_FRAMES

    def rests_on(self, session: "Session") -> tuple[str, ...]:
        """Return the camera, the plane of light where there is one, and the stage of the sphere's answer."""
        known = session.cell.known
        steps = {capture.step for capture in session.captures if not capture.excluded}
        found = ["camera"] if known.camera is None else []
        if "laser-plane" in steps and known.laser_plane is None:
            found.append("laser-plane")
        if "tcp" in steps and known.tool0_from_laser is None:
            table = "turntable" in steps and known.base_from_turntable is None
            found.append("chain" if table else "tcp")
        return tuple(found)

    def reads_of_cell(self, session: "Session") -> tuple[str, ...]:
        """Return the cell's fields that it reads: a tool that the user brought too, beside which it stands."""
        return (*self.reads, "known") if session.cell.known.tool0_from_laser is not None else self.reads


def _posed(session: "Session") -> "list[Capture]":
    return [
        c for c in session.captures
        if c.step in ("camera", "laser-plane") and c.kind == "frame" and not c.excluded and c.pose is not None
    ]  # fmt: skip


STAGE = BoardHandEye()
