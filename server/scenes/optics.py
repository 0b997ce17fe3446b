"""Camera, boards and plane of light as a scene shows them: where the camera stands, or on a bench beside base."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import Result, Session
from calib_core.records.camera_result import CameraResult
from calib_core.records.laser_plane_result import LaserPlaneResult
from calib_core.stages.hand_eye.record import HandEyeResult

BASE_FROM_CAMERA = RigidTransform.of(
    np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]]), [0.0, -600.0, 300.0], "base", "camera"
)
"""The bench: where the camera stood while it was calibrated is not known, so it looks away from the cell."""


@dataclass(frozen=True, eq=False)
class BoardPlace:
    """Where one capture saw the board, and whether it counts; `with_stripe`: it shows the plane of light too."""

    capture: str
    camera_from_board: RigidTransform
    used: bool
    with_stripe: bool


@dataclass(frozen=True, eq=False)
class OpticsFacts:
    """What is known of camera and plane of light.

    Attributes
    ----------
    camera_matrix : (3, 3) or None
    image_size : (width, height)
    boards : tuple of BoardPlace
    corners_in_board_mm : (N, 3)
    camera_from_laser : RigidTransform or None
    missing : tuple of str
        What cannot be drawn, and why, in sentences.
    base_from_camera : RigidTransform
        Where a camera that stands still is; of any other the bench.
    """

    camera_matrix: FloatArray | None
    image_size: tuple[float, float]
    boards: tuple[BoardPlace, ...]
    corners_in_board_mm: FloatArray
    camera_from_laser: RigidTransform | None
    missing: tuple[str, ...]
    base_from_camera: RigidTransform = BASE_FROM_CAMERA

    @property
    def outline_in_board_mm(self) -> FloatArray:
        """The corners (4, 3) of the rectangle about the board's inner corners."""
        low, high = self.corners_in_board_mm.min(axis=0), self.corners_in_board_mm.max(axis=0)
        return np.array([[low[0], low[1], 0], [high[0], low[1], 0], [high[0], high[1], 0], [low[0], high[1], 0]])

    def corners_in_camera_mm(self, board: BoardPlace) -> FloatArray:
        """Return the corners (N, 3) of the board at one place, in the camera frame."""
        return board.camera_from_board.apply(self.corners_in_board_mm)

    @property
    def depth_mm(self) -> float:
        """How far the boards, or the plane's own origin, lie from the camera."""
        depths = [board.camera_from_board.translation_mm[2] for board in self.boards]
        if self.camera_from_laser is not None:
            depths.append(float(np.linalg.norm(self.camera_from_laser.translation_mm)))
        return float(max(depths, default=300.0))


def plane_patch_mm(optics: OpticsFacts, laser_from_camera: RigidTransform) -> FloatArray:
    """Return the corners (4, 3) in L of a piece of the plane that holds the boards with the stripe."""
    seen = [optics.corners_in_camera_mm(board) for board in optics.boards if board.with_stripe and board.used]
    if not seen or not len(seen[0]):
        half = 0.5 * optics.depth_mm
        low, high = np.array([-half, 0.0, -half]), np.array([half, 0.0, half])
    else:
        corners = laser_from_camera.apply(np.concatenate(seen))
        low, high = corners.min(axis=0), corners.max(axis=0)
    return np.array([[low[0], 0, low[2]], [high[0], 0, low[2]], [high[0], 0, high[2]], [low[0], 0, high[2]]])


def optics_facts(session: Session, results: Mapping[str, Result]) -> OpticsFacts | None:
    """Return what the camera and laser-plane stages found or the user brought; None where there is neither."""
    camera, plane = results.get("camera"), results.get("laser-plane")
    camera = camera if isinstance(camera, CameraResult) else None
    plane = plane if isinstance(plane, LaserPlaneResult) else None
    known = session.cell.known.camera
    if camera is None and plane is None and known is None:
        return None
    matrix = camera.camera_matrix if camera else known.camera_matrix if known else None
    boards = _boards(session, camera, plane)
    size = camera.image_size if camera else (0, 0)
    if matrix is not None and not size[0]:
        # Brought without a size: the middle is near the principal point.
        size = (2 * matrix[0][2], 2 * matrix[1][2])
    return OpticsFacts(
        None if matrix is None else np.array(matrix),
        size,
        boards,
        _corners_mm(session),
        None if plane is None else RigidTransform.from_rounded(plane.camera_from_laser, "camera", "laser"),
        _missing(camera, plane, boards),
        _stands(results.get("hand-eye")),
    )


def _stands(found: Result | None) -> RigidTransform:
    rows = found.base_from_camera if isinstance(found, HandEyeResult) else None
    return BASE_FROM_CAMERA if rows is None else RigidTransform.from_rounded(rows, "base", "camera")


def _boards(
    session: Session, camera: CameraResult | None, plane: LaserPlaneResult | None
) -> tuple[BoardPlace, ...]:
    steps = {capture.id: capture.step for capture in session.captures}
    rejected = {row.capture for row in plane.residuals if not row.used} if plane else set[str]()
    return tuple(
        BoardPlace(
            row.capture,
            RigidTransform.from_rounded(row.camera_from_board, "camera", "board"),
            row.used and row.capture not in rejected,
            plane is not None and steps.get(row.capture) == "laser-plane",
        )
        for row in (camera.residuals if camera else [])
        if row.camera_from_board is not None
    )


def _corners_mm(session: Session) -> FloatArray:
    from calib_core.optics.board import points_in_board_mm

    board = session.cell.board
    return np.zeros((0, 3)) if board is None else points_in_board_mm(board)


def _missing(
    camera: CameraResult | None, plane: LaserPlaneResult | None, boards: tuple[BoardPlace, ...]
) -> tuple[str, ...]:
    sentences: list[str] = []
    if camera is None:
        sentences.append("The camera was not solved here, so the boards' places are not known.")
    elif len(boards) < len(camera.residuals):
        count = len(camera.residuals) - len(boards)
        sentences.append(f"{count} {'view has' if count == 1 else 'views have'} no board and no place.")
    if plane is None:
        sentences.append("The plane of light is not solved yet.")
    return tuple(sentences)
