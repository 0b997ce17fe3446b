"""Whether a camera's boards tell the distortion where none was seen: a note where they do, a warning where not."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib_core.findings import Finding
from calib_core.frames import FloatArray
from calib_core.optics.board import BoardView
from calib_core.optics.camera import calibrate_camera
from calib_core.optics.camera_evidence import camera_findings
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.camera_solution import CameraSolution

SIZE = (1280, 960)
MATRIX = np.array([[1300.0, 0, 645], [0, 1300, 475], [0, 0, 1]])
LENS = CameraModel.from_names(MATRIX, {"k1": -0.25, "k2": 0.12, "k3": -0.03}, SIZE)
BOARD = np.array([[x, y, 0.0] for y in range(6) for x in range(8)]) * 8
CORNERS = [(0.12, 0.14), (0.88, 0.14), (0.12, 0.86), (0.88, 0.86), (0.5, 0.5)]
MIDDLE = [(0.4, 0.4), (0.6, 0.4), (0.4, 0.6), (0.6, 0.6), (0.5, 0.5)]


def calibrated(places: Sequence[tuple[float, float]], seed: int, stretched: float = 1.0) -> CameraSolution:
    """Return the camera of 15 views of a board whose middle stands at these places of the image, in turn.

    `stretched`: so many times its pitch along the columns is told.
    """
    rng = np.random.default_rng(seed)
    views: list[BoardView] = []
    while len(views) < 15:
        place = np.array(places[len(views) % len(places)]) * SIZE
        turned = BOARD @ Rotation.from_rotvec(rng.uniform(-0.6, 0.6, 3)).as_matrix().T
        ray = np.append((place - MATRIX[:2, 2]) / 1300, 1.0) * rng.uniform(300, 400)
        pixels: FloatArray = LENS.project(turned - turned.mean(0) + ray)
        if (pixels > 0).all() and (pixels < SIZE).all():
            noisy = pixels + rng.normal(0, 0.05, pixels.shape)
            views.append(BoardView(noisy, BOARD * [1.0, stretched, 1.0], np.arange(len(BOARD)), SIZE, 0.05))
    return calibrate_camera(views, SIZE)


def findings(places: Sequence[tuple[float, float]], seed: int) -> list[Finding]:
    found = camera_findings(calibrated(places, seed))
    return [one for one in found if one.code.startswith("image-")]


@pytest.mark.parametrize("seed", [1, 2])
def test_boards_in_the_corners_tell_the_whole_image_and_those_in_the_middle_do_not(seed: int) -> None:
    (told,) = findings(CORNERS, seed)
    assert (told.code, told.severity) == ("image-covered-in-part", "note")
    # Lenses of two terms, as the middle asks for, state an even ±, and are 20 px off in the corners.
    (warned,) = findings(MIDDLE, seed)
    assert (warned.code, warned.severity) == ("image-not-covered", "warning")
