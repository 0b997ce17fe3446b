"""The camera, from frames of the calibration board."""

from typing import TYPE_CHECKING, ClassVar

from calib_core.graph.stage import FRAME_FIELDS, Stage
from calib_core.steps import CaptureStep

if TYPE_CHECKING:
    from collections.abc import Iterator

    from calib_core.records import Capture, Session
    from calib_core.records.camera_result import CameraResult


_OF_ROBOT = ("pose_convention", "robot.position_sigma_mm", "robot.orientation_sigma_deg")


class Camera(Stage):
    """The camera, from frames of the calibration board."""

    name, title, place = "camera", "Camera", 10
    method_revision = 11  # the contrast about a corner falls off as over the whole board
    step = CaptureStep(
        "camera",
        "Camera",
        "board",
        "Capture the board, tilted differently in each frame, and add the frames to the session.",
        least=3,
        letter="c",
    )
    takes: ClassVar = {"camera": FRAME_FIELDS, "laser-plane": FRAME_FIELDS}
    reads = ("board",)
    known = ("camera",)
    guided = ("camera",)
    settings_field = "board"
    layers = ("camera",)

    @property
    def result(self) -> "type[CameraResult]":
        """The record of its result, which captures of raw frames need too."""
        from calib_core.records.camera_result import CameraResult

        return CameraResult

    def is_wanted(self, session: "Session") -> bool:
        """Return whether the scanner delivers raw frames."""
        from calib_core.captures.raw_frames import uses_frames

        return uses_frames(session)

    def reads_of_cell(self, session: "Session") -> tuple[str, ...]:
        """Return the cell's fields that it reads: of a fixed board the robot's too, whose lengths it compares."""
        from calib_core.cell.carriers import carriers_read

        return (*self.reads, *_OF_ROBOT, *carriers_read(session.cell)) if _is_fixed(session) else self.reads

    def reads_of_captures(self, session: "Session") -> "Iterator[tuple[Capture, tuple[str, ...]]]":
        """Give the captures that it reads, of a fixed board with the robot's pose."""
        fixed = _is_fixed(session)
        for capture, fields in super().reads_of_captures(session):
            with_pose = fixed and not capture.excluded and "pose" not in fields
            yield capture, (*fields, "pose") if with_pose else fields


def _is_fixed(session: "Session") -> bool:
    return session.cell.board is not None and session.cell.board.fixed


STAGE = Camera()
