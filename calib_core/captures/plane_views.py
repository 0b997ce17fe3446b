"""The boards of a session's frames: with the stripe on them, and with the robot's poses."""

from dataclasses import replace
from functools import cached_property

import numpy as np

from calib_core.captures.boards import (
    board_in,
    board_of,
    read_frame,
    relative_pitch_sigma,
    stripe_frames,
    stripe_looks,
    stripe_of,
)
from calib_core.captures.content import pose_of, shows_board
from calib_core.cell.carriers import ball_on_flange
from calib_core.errors import InputError, MeasurementError, MotionError
from calib_core.frames import RigidTransform
from calib_core.messages import message
from calib_core.optics.board import BoardView
from calib_core.optics.board_refusal import BRING_WHOLE, grey_eight_bit
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.hand_eye import HandEye, solve_hand_eye
from calib_core.optics.hand_eye_frames import CameraDoubt
from calib_core.optics.laser_plane_solve import (
    PlaneView,
    board_poses,
    is_plain,
    lines_on_board,
    without_its_board,
)
from calib_core.optics.robot_lengths import camera_doubt
from calib_core.optics.stripe import StripeCenters
from calib_core.optics.stripe_light import light_squares
from calib_core.optics.stripe_looks import look_along
from calib_core.records import Capture, Cell, ReadFile, Session
from calib_core.records.camera_result import CameraResult


def robot_pose(cell: Cell, capture: Capture) -> RigidTransform:
    """Return base_from_tool0 of a frame of a board, or its inverse where the flange holds the board."""
    pose = pose_of(cell, capture)
    return pose.inverse() if ball_on_flange(cell) else pose


class PlaneViews:
    """The boards of a session's frames."""

    def __init__(self, session: Session, camera: CameraModel, read: ReadFile) -> None:
        self._session = session
        self._camera = camera
        self._read = read
        self._board = board_of(session.cell)

    def of(self, capture: Capture) -> PlaneView:
        """Return a capture's board and stripe.

        Raises
        ------
        InputError
            If a file is of no use, or its size is not the camera's.
        MeasurementError
            If the board or the stripe is not seen.
        """
        board = board_in(capture, self._board, self._read)
        lit = grey_eight_bit(read_frame(capture, self._read))
        found = PlaneView(capture.id, board, self._stripe(capture), squares=light_squares(lit, board))
        ((_, lines),) = lines_on_board(self._camera, found, self._board.margin_mm)
        if any(is_plain(line) for line in lines):
            return found
        return self._along_its_lines(replace(found, others=stripe_looks(capture, self._read).stripes), capture)

    def _along_its_lines(self, view: PlaneView, capture: Capture) -> PlaneView:
        """Return a view whose stripes are measured once more, each along the line that it forms on the board.

        Where none is known well, it is looked for without the board's own light, too.
        """
        frame, dark = stripe_frames(capture, self._read)
        again, enough = list[StripeCenters](), False
        for stripe, lines in lines_on_board(self._camera, view, self._board.margin_mm):
            on_line = max((line.on_line for line in lines), key=np.sum, default=None)
            again.append(stripe if on_line is None else look_along(stripe, on_line, frame, dark))
            enough |= any(line.is_enough for line in lines)
        measured = replace(view, stripe=again[0], others=tuple(again[1:]))
        if enough or dark is not None:
            return measured
        return without_its_board(self._camera, measured, frame if frame.ndim == 2 else frame.max(axis=2))

    @cached_property
    def hand_eye(self) -> HandEye:
        """The camera on the flange, the board in the base; raises MotionError where lit frames do not tell."""
        return self._hand_eye(None)

    def hand_eye_within(self, found: CameraResult) -> HandEye:
        """Return the same where the camera is known as its result states; raises as `hand_eye`."""
        views = [view for _, view in self._lit.values() if view.is_numbered]
        if not views:
            return self._hand_eye(None)
        told = found.parameters, np.array(found.covariance, dtype=float), found.inflation
        return self._hand_eye(camera_doubt(self._camera, *told, views))

    def _hand_eye(self, doubt: CameraDoubt | None) -> HandEye:
        robot = self._session.cell.robot
        poses = list(self.frames.values())
        told = robot.position_sigma_mm, robot.orientation_sigma_rad, doubt, relative_pitch_sigma(self._board)
        on_flange = ball_on_flange(self._session.cell)
        found = solve_hand_eye([a for a, _ in poses], [b for _, b in poses], *told, board_on_flange=on_flange)
        if not found.frames_agree and any(view.turn_is_ambiguous for _, view in self._lit.values()):
            raise MotionError(
                "a fixed board with one right way up (a chessboard whose columns + rows is odd, or ChArUco)",
                "one that looks the same turned by 180°, and frames that contradict each other",
                "Take another board, or light it in every frame.",
            )
        return found

    @cached_property
    def frames(self) -> dict[str, tuple[RigidTransform, RigidTransform]]:
        """The robot's pose (`robot_pose`) and camera_from_board by the lit frames; raises as `hand_eye`."""
        lit = {name: (self._pose(c), view) for name, (c, view) in self._lit.items() if view.is_numbered}
        boards, _ = board_poses(self._camera, [view for _, view in lit.values()]) if lit else ([], None)
        return {name: (pose, board) for (name, (pose, _)), board in zip(lit.items(), boards, strict=True)}

    @cached_property
    def without_board(self) -> dict[str, MeasurementError]:
        """Why frames with a robot pose do not count for the hand-eye."""
        return self._looked[1] | {
            name: MeasurementError(
                "a board of which each corner is known",
                "a part of it, and nothing tells which of its corners are seen",
                BRING_WHOLE,
            )
            for name, (_, view) in self._lit.items()
            if not view.is_numbered
        }

    @property
    def _lit(self) -> dict[str, tuple[Capture, BoardView]]:
        """The captures with a robot pose whose frame shows the board."""
        return self._looked[0]

    @cached_property
    def _looked(self) -> tuple[dict[str, tuple[Capture, BoardView]], dict[str, MeasurementError]]:
        """The captures with a robot pose: those whose frame shows the board, and why the others do not."""
        found, failed = dict[str, tuple[Capture, BoardView]](), dict[str, MeasurementError]()
        for capture in self._session.captures:
            if not shows_board(capture) or capture.kind != "frame" or capture.excluded or capture.pose is None:
                continue
            try:
                found[capture.id] = capture, board_in(capture, self._board, self._read)
            except MeasurementError as error:
                failed[capture.id] = error
        return found, failed

    def _stripe(self, capture: Capture) -> StripeCenters:
        frame = read_frame(capture, self._read, -1)
        size = frame.shape[1], frame.shape[0]
        if self._camera.image_size[0] and self._camera.image_size != size:
            raise InputError(
                "a frame of {width}×{height} pixels, as the camera was calibrated with",
                message("{width}×{height} pixels", width=size[0], height=size[1]),
                "Take all frames with one camera and one setting, or remove this capture.",
                capture.id,
                width=self._camera.image_size[0],
                height=self._camera.image_size[1],
            )
        try:
            return stripe_of(capture, self._read)
        except MeasurementError:
            looks = stripe_looks(capture, self._read).stripes
            if not looks:
                raise
            return looks[0]

    def _pose(self, capture: Capture) -> RigidTransform:
        assert capture.pose is not None
        return robot_pose(self._session.cell, capture)
