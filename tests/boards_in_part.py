"""Frames of a chessboard that hangs out of the image, with a known camera."""

import numpy as np
from numpy.typing import NDArray

from calib_core.simulation.frame_camera import SimulatedCamera
from calib_core.simulation.frame_surfaces import BoardSurface
from calib_core.simulation.frames import Exposure, ImageArray, render
from calib_core.simulation.motion import pose, turn

CAMERA = SimulatedCamera()
PITCH_MM = 9.0
SHAPE = (9, 6)  # columns, rows
_BORDER_PX = 8.0


def cut_off_views(seed: int, count: int = 12) -> tuple[list[ImageArray], list[NDArray[np.int64]]]:
    """Return frames of boards of which a third is outside the image, about, and which corners are well inside."""
    rng = np.random.default_rng([seed, 43])
    frames: list[ImageArray] = []
    inside: list[NDArray[np.int64]] = []
    while len(frames) < count:
        rotation = turn(rng.uniform(-1, 1, 3) * [0.5, 0.5, 0.4])
        depth, side = rng.uniform(200.0, 320.0), len(frames) % 4
        edge = np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])[side] * [0.33, 0.25] * depth
        middle = np.array([*(edge + rng.uniform(-12, 12, 2)), depth])
        size = (np.array(SHAPE) - 1) * PITCH_MM
        board = BoardSurface(pose(rotation, middle - rotation @ [*size / 2, 0.0]), *SHAPE, PITCH_MM)
        place = board.camera_from_board
        pixels = CAMERA.pixels(board.points_on_board_mm() @ place[:3, :3].T + place[:3, 3])
        last = np.array([CAMERA.width, CAMERA.height]) - _BORDER_PX
        seen = ((pixels > _BORDER_PX) & (pixels < last)).all(axis=1)
        if not 0.5 < seen.mean() < 0.8:
            continue
        frames.append(render(CAMERA, [board], None, Exposure(ambient=180.0), rng))
        inside.append(np.flatnonzero(seen))
    return frames, inside
