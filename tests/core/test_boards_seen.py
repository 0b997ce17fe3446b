"""Which way boards face is told live, before there is a camera, and the guide asks for the side that misses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib_core.records import Measured
from calib_core.stages.boards_seen import boards_seen
from calib_core.stages.camera.guide import next_view

SIZE = (1280, 1024)
FOCAL_PX = 3100.0  # a narrow lens: no guess by the image's size


def view(name: str, right_deg: float, down_deg: float, distance_mm: float = 900.0) -> Measured:
    """A board whose face is turned so far to the right and to the lower edge of the image, filling its middle."""
    facing = np.radians([right_deg, down_deg])
    # The board's z points away from the camera: turned about y by minus an angle it faces right, about x, down.
    turn = Rotation.from_rotvec([facing[1], -facing[0], 0.0]).as_matrix()
    camera = np.array([[FOCAL_PX, 0, (SIZE[0] - 1) / 2], [0, FOCAL_PX, (SIZE[1] - 1) / 2], [0, 0, 1.0]])
    middle = turn @ [150.0, 120.0, 0.0]
    pose = np.column_stack([turn[:, :2], [0.0, 0.0, distance_mm] - middle])
    pixel_from_board = camera @ pose
    corners = np.array([[x, y, 1.0] for x in range(0, 301, 30) for y in range(0, 241, 30)]) @ pixel_from_board.T
    pixels = corners[:, :2] / corners[:, 2:]
    return Measured(
        capture=name, kind="frame", verdict="pass", image_size=SIZE, board_px=pixels.tolist(),
        pitch_px=30 * FOCAL_PX / distance_mm, pixel_from_board=pixel_from_board.tolist(),
    )  # fmt: skip


TURNS = {"a": (0.0, 0.0), "b": (30.0, 0.0), "c": (0.0, -25.0), "d": (-20.0, 15.0)}


def test_tilts_are_told_without_a_camera() -> None:
    views = [view(name, *turn, 900.0 if name < "c" else 600.0) for name, turn in TURNS.items()]
    seen = boards_seen("camera", views)
    assert seen is not None
    for one in seen.facing:
        assert np.degrees(one.facing_rad) == pytest.approx(TURNS[one.capture], abs=1e-6)
        assert one.nearness == pytest.approx(2 / 3 if one.capture < "c" else 1.0)


def test_boards_that_all_face_the_camera_tell_no_tilt() -> None:
    seen = boards_seen("camera", [view("a", 0.0, 0.0), view("b", 0.0, 0.0, 500.0)])
    assert seen is not None
    assert seen.facing == []


@pytest.mark.parametrize(
    ("missing", "asked"),
    [((-1, 0), "left edge"), ((1, 0), "right edge"), ((0, -1), "upper edge"), ((0, 1), "lower edge"), (None, "")],
)
def test_the_side_that_no_view_shows_is_asked_for(missing: tuple[int, int] | None, asked: str) -> None:
    sides = [(-1, 0), (1, 0), (0, -1), (0, 1)]
    views = [
        view(f"{side}", 25.0 * side[0], 25.0 * side[1], 700.0 + 100.0 * k)
        for k, side in enumerate(sides)
        if side != missing
    ]
    words = next_view(views)
    assert asked in (words or "")
    assert (words is None) == (missing is None)
