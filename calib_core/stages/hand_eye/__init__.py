"""The board as a second opinion: where the camera is by frames of a fixed board, beside the sphere's answer."""

from typing import TYPE_CHECKING, ClassVar

from calib_core.cell.carriers import carriers_read
from calib_core.cell.found import known_scanner
from calib_core.graph.stage import FRAME_FIELDS, Stage

if TYPE_CHECKING:
    from collections.abc import Iterator

    from calib_core.records import Capture, Session

_LEAST_FRAMES = 4


class BoardHandEye(Stage):
    """The board as a second opinion: where the camera is by frames of a fixed board, beside the sphere's."""

    name, title, place = "hand-eye", "Board hand-eye", 57
    takes: ClassVar = {"camera": (*FRAME_FIELDS, "pose"), "laser-plane": (*FRAME_FIELDS, "pose")}
    reads = ("board", "pose_convention", "robot.position_sigma_mm", "robot.orientation_sigma_deg")
    after = ("camera", "laser-plane", "tcp", "chain")
    frames: ClassVar = {
        **dict.fromkeys(("tool0_from_camera", "base_from_camera"), "covariance"),
        **dict.fromkeys(("base_from_board", "tool0_from_board"), "board_covariance"),
    }
    optional = True
    is_second_opinion = True
    method_revision = 5  # the contrast about a corner falls off as over the whole board
    layers = ("scanner",)

    def is_wanted(self, session: "Session") -> bool:
        """Return whether a board stands still, in enough frames of a flange that turns enough."""
        board = session.cell.board
        return board is not None and board.fixed and _turns_enough(session)

    def rests_on(self, session: "Session") -> tuple[str, ...]:
        """Return the camera, the plane of light where there is one, and the stage of the sphere's answer."""
        if not self.is_wanted(session):
            return ()
        known = session.cell.known
        steps = {capture.step for capture in session.captures if not capture.excluded}
        found = ["camera"] if known.camera is None else []
        if "laser-plane" in steps and known.laser_plane is None:
            found.append("laser-plane")
        if "tcp" in steps and known_scanner(session.cell) is None:
            table = "turntable" in steps and known.base_from_turntable is None
            found.append("chain" if table else "tcp")
        return tuple(found)

    def reads_of_captures(self, session: "Session") -> "Iterator[tuple[Capture, tuple[str, ...]]]":
        """Give the captures that it reads; none where it is not wanted."""
        if self.is_wanted(session):
            yield from super().reads_of_captures(session)

    def reads_of_cell(self, session: "Session") -> tuple[str, ...]:
        """Return the cell's fields that it reads: a tool that the user brought too, beside which it stands."""
        if not self.is_wanted(session):
            return ()
        reads = (*self.reads, *carriers_read(session.cell))
        return (*reads, "known") if known_scanner(session.cell) is not None else reads


def _turns_enough(session: "Session") -> bool:
    """Return whether the poses of the frames determine it, as `optics.hand_eye` requires."""
    posed = _posed(session)
    if len(posed) < _LEAST_FRAMES:
        return False
    from calib_core.errors import CalibrationError
    from calib_core.optics.hand_eye import require_two_axes
    from calib_core.poses.numbers import parse_pose

    try:
        poses = [parse_pose(session.cell.pose_convention, c.pose or [], c.id) for c in posed]
        require_two_axes(poses)
    except CalibrationError:
        return False
    return True


def _posed(session: "Session") -> "list[Capture]":
    return [
        c for c in session.captures
        if c.step in BoardHandEye.takes and c.kind == "frame" and not c.excluded and c.pose is not None
    ]  # fmt: skip


STAGE = BoardHandEye()
