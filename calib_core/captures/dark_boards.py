"""Frames that show the stripe alone: where the dark board stands, another frame or the robot's pose tells."""

from dataclasses import replace
from functools import cached_property

import numpy as np

from calib_core.captures.boards import (
    board_in,
    board_of,
    read_frame,
    relative_pitch_sigma,
    shows_stripe_alone,
    stripe_looks,
    stripe_of,
)
from calib_core.captures.content import shows_board
from calib_core.errors import InputError, MeasurementError, MotionError
from calib_core.frames import RigidTransform
from calib_core.optics.board import BoardView, points_in_board_mm
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.hand_eye import HandEye, solve_hand_eye
from calib_core.optics.hand_eye_frames import CameraDoubt
from calib_core.optics.laser_plane_solve import PlaneView, board_poses, has_plain_line, view_of_known_board
from calib_core.optics.robot_lengths import camera_doubt
from calib_core.optics.stripe import StripeCenters
from calib_core.poses.numbers import parse_pose
from calib_core.records import Capture, Session
from calib_core.records.callbacks import ReadFile
from calib_core.records.camera_result import CameraResult


class PlaneViews:
    """The boards with the stripe of a session, dark ones too.

    Attributes
    ----------
    lent : set of str
        Captures whose board counts for another one's stripe.
    """

    def __init__(self, session: Session, camera: CameraModel, read: ReadFile) -> None:
        self._session = session
        self._camera = camera
        self._read = read
        self._board = board_of(session.cell)
        self.lent: set[str] = set()

    def of(self, capture: Capture) -> PlaneView:
        """Return a capture's board and stripe.

        Raises
        ------
        InputError
            If a file is of no use, or its size is not the camera's.
        MeasurementError
            If the stripe is not seen, or nothing tells where the board stands.
        """
        found = self._view_of(capture)
        if has_plain_line(self._camera, found, self._board.margin_mm):
            return found
        return replace(found, others=stripe_looks(capture, self._read).stripes)

    def _view_of(self, capture: Capture) -> PlaneView:
        if capture.board_of is not None:
            return self._beside(capture, self._named(capture))
        try:
            view = board_in(capture, self._board, self._read)
        except MeasurementError as error:
            if not shows_stripe_alone(self._session.cell, capture, self._read):
                raise
            return self._dark(capture, error)
        return PlaneView(capture.id, view, self._stripe(capture))

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
        found = solve_hand_eye([a for a, _ in poses], [b for _, b in poses], *told)
        if not found.frames_agree and any(view.turn_is_ambiguous for _, view in self._lit.values()):
            raise MotionError(
                "a fixed board with one right way up (a chessboard whose columns + rows is odd, or ChArUco)",
                "one that looks the same turned by 180°, and frames that contradict each other",
                "Take another board, or light it in every frame.",
            )
        return found

    @cached_property
    def frames(self) -> dict[str, tuple[RigidTransform, RigidTransform]]:
        """base_from_tool0 and camera_from_board by the lit frames that have a pose; raises as `hand_eye`."""
        lit = {name: (self._pose(c), view) for name, (c, view) in self._lit.items() if view.is_numbered}
        boards, _ = board_poses(self._camera, [view for _, view in lit.values()]) if lit else ([], None)
        return {name: (pose, board) for (name, (pose, _)), board in zip(lit.items(), boards, strict=True)}

    @cached_property
    def _lit(self) -> dict[str, tuple[Capture, BoardView]]:
        """The captures with a robot pose whose frame shows the board."""
        found: dict[str, tuple[Capture, BoardView]] = {}
        for capture in self._session.captures:
            if not shows_board(capture) or capture.kind != "frame" or capture.excluded or capture.pose is None:
                continue
            try:
                found[capture.id] = capture, board_in(capture, self._board, self._read)
            except MeasurementError:
                continue
        return found

    def _dark(self, capture: Capture, error: MeasurementError) -> PlaneView:
        here = [name for name, (other, _) in self._lit.items() if other.pose == capture.pose]
        if len(here) > 1 and not self._board.fixed:
            raise MeasurementError(
                "one frame of the lit board at this robot pose",
                f"{len(here)}: {', '.join(here)}",
                "Name in `board_of` the capture whose frame shows the board as it stands here.",
            )
        if here:
            return self._beside(capture, self._lit[here[0]][0])
        if not self._board.fixed:
            raise error.adding(
                "Where the board is dark, take it lit at the same robot pose or name that frame in `board_of`; "
                "or set cell.board.fixed where it stands still in the base."
            )
        stripe = self._stripe(capture)
        try:
            known = self.hand_eye.predict(self._pose(capture))
        except MotionError as why:
            raise MeasurementError(why.need, why.got, why.to_do) from None
        return view_of_known_board(capture.id, self._camera, known, points_in_board_mm(self._board), stripe)

    def _beside(self, capture: Capture, other: Capture) -> PlaneView:
        view = board_in(other, self._board, self._read)
        self.lent.add(other.id)
        return PlaneView(capture.id, view, self._stripe(capture))

    def _named(self, capture: Capture) -> Capture:
        for other in self._session.captures:
            if other.id == capture.board_of and shows_board(other) and other.kind == "frame":
                return other
        raise InputError(
            "in `board_of` the id of a camera or laser-plane capture that shows the board",
            f"'{capture.board_of}'",
            "Correct it, or leave it out.",
            capture.id,
        )

    def _stripe(self, capture: Capture) -> StripeCenters:
        frame = read_frame(capture, self._read, -1)
        size = frame.shape[1], frame.shape[0]
        if self._camera.image_size[0] and self._camera.image_size != size:
            raise InputError(
                "frames of {width}×{height} pixels, as the camera was calibrated with",
                "{width_other}×{height_other} pixels",
                "Take all frames with one camera and one setting, or remove this capture.",
                capture.id,
                width=self._camera.image_size[0],
                height=self._camera.image_size[1],
                width_other=size[0],
                height_other=size[1],
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
        return parse_pose(self._session.cell.pose_convention, capture.pose, capture.id)
