"""Boards of every kind, rendered with known truth; and every frame that must be refused with its own sentence."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from calib_core.errors import InputError, MeasurementError
from calib_core.optics.board import find_board, points_in_board_mm
from calib_core.optics.board_lattice import lattices
from calib_core.optics.board_partial import seen_chessboard
from calib_core.records import Board

SIZE = (640, 480)
TILTED = np.array([[3.0, -0.35, 150.0], [0.25, 2.8, 110.0], [0.0004, -0.0006, 1.0]])  # px from mm
CHESS = Board(kind="chessboard", columns=9, rows=6, pitch_mm=10.0)
CHARUCO = Board(kind="charuco", columns=9, rows=7, pitch_mm=12.0, marker_mm=9.0, dictionary="DICT_5X5_100")
CIRCLES = Board(kind="circles", columns=8, rows=6, pitch_mm=12.0)
ASYMMETRIC = Board(kind="asymmetric-circles", columns=4, rows=11, pitch_mm=9.0)


CHESS_IDS = np.arange(54)


def chess_ink(board: Board, x: NDArray, y: NDArray) -> NDArray:
    p = board.pitch_mm
    column, row = np.floor(x / p).astype(int), np.floor(y / p).astype(int)
    on_board = (column >= -1) & (column < board.columns) & (row >= -1) & (row < board.rows)
    return on_board & ((column + row) % 2 == 0)


def circle_ink(board: Board, x: NDArray, y: NDArray) -> NDArray:
    ink = np.zeros(x.shape, bool)
    for cx, cy, _ in points_in_board_mm(board):
        ink |= (x - cx) ** 2 + (y - cy) ** 2 < (0.28 * board.pitch_mm) ** 2
    return ink


def charuco_ink(board: Board, x: NDArray, y: NDArray) -> NDArray:
    pixels_per_mm = 10
    pattern = cv2.aruco.CharucoBoard(
        (board.columns, board.rows), board.pitch_mm, board.marker_mm or 0,
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100),
    )  # fmt: skip
    shape = (int(board.columns * board.pitch_mm * pixels_per_mm), int(board.rows * board.pitch_mm * pixels_per_mm))
    picture = pattern.generateImage(shape, marginSize=0)
    u, v = np.floor(x * pixels_per_mm).astype(int), np.floor(y * pixels_per_mm).astype(int)
    inside = (u >= 0) & (u < shape[0]) & (v >= 0) & (v < shape[1])
    ink = np.zeros(x.shape, bool)
    ink[inside] = picture[v[inside], u[inside]] < 128
    return ink


def render(
    board: Board, px_from_mm: NDArray = TILTED, noise: float = 1.5, blur_px: float = 0.7, seed: int = 0
) -> NDArray[np.uint8]:
    """Four samples a pixel of the board's ink, 40 on 210."""
    fine = (np.arange(SIZE[0] * 2) + 0.5) / 2 - 0.5, (np.arange(SIZE[1] * 2) + 0.5) / 2 - 0.5
    u, v = np.meshgrid(*fine)
    m = np.linalg.inv(px_from_mm)
    w = m[2, 0] * u + m[2, 1] * v + m[2, 2]
    x, y = (m[0, 0] * u + m[0, 1] * v + m[0, 2]) / w, (m[1, 0] * u + m[1, 1] * v + m[1, 2]) / w
    ink = {"chessboard": chess_ink, "charuco": charuco_ink}.get(board.kind, circle_ink)(board, x, y)
    grey = 210 - 170 * ink.reshape(SIZE[1], 2, SIZE[0], 2).mean(axis=(1, 3))
    grey = cv2.GaussianBlur(grey, (0, 0), blur_px) if blur_px else grey
    return np.clip(grey + np.random.default_rng(seed).normal(0, noise, grey.shape), 0, 255).astype(np.uint8)


def truth(board: Board, px_from_mm: NDArray = TILTED) -> NDArray:
    p = points_in_board_mm(board) @ np.diag([1, 1, 0]) + [0, 0, 1]
    q = p @ px_from_mm.T
    return q[:, :2] / q[:, 2:]


@pytest.mark.parametrize("board", [CHESS, CIRCLES, ASYMMETRIC], ids=lambda b: b.kind)
@pytest.mark.parametrize("inverted", [False, True], ids=["dark on bright", "bright on dark"])
def test_points_are_found_to_a_tenth_of_a_pixel(board: Board, inverted: bool) -> None:
    image = render(board)
    view = find_board(255 - image if inverted else image, board)
    expected = truth(board)
    if inverted and board.kind == "chessboard":
        expected = expected[::-1]  # with its colours exchanged the board stands on its head
    error = view.points_px - expected
    assert np.sqrt((error**2).mean()) < 0.1
    np.testing.assert_array_equal(view.points_in_board_mm, points_in_board_mm(board))
    assert view.image_size == SIZE
    assert 0 < view.corner_sigma_px < 0.2


@pytest.mark.parametrize("board", [CIRCLES, ASYMMETRIC], ids=lambda b: b.kind)
def test_circles_seen_aslant_are_found_at_their_own_centres(board: Board) -> None:
    steep = np.array([[5.0, -0.35, 60.0], [0.25, 4.6, 60.0], [0.0034, 0.0012, 1.0]])
    view = find_board(render(board, steep), board)
    off = (view.points_px - truth(board, steep)).mean(axis=0)
    assert np.abs(off).max() < 0.02  # the middles of the ellipses lie 0.12 and 0.07 px beside


def test_charuco_whole_and_in_part() -> None:
    image = render(CHARUCO)
    view = find_board(image, CHARUCO)
    assert len(view.ids) == 8 * 6
    h = TILTED
    q = (view.points_in_board_mm @ np.diag([1, 1, 0]) + [0, 0, 1]) @ h.T
    assert np.sqrt(((view.points_px - q[:, :2] / q[:, 2:]) ** 2).mean()) < 0.15  # markers crowd its corners
    image[:, 330:] = 128
    part = find_board(image, CHARUCO)
    assert 6 <= len(part.ids) < 40
    whole = {int(i): p for i, p in zip(view.ids, view.points_px, strict=True)}
    for i, p in zip(part.ids, part.points_px, strict=True):
        assert np.linalg.norm(whole[int(i)] - p) < 0.3


def test_a_chessboard_turned_upside_down_is_the_same_board() -> None:
    half_turn = np.array([[-1.0, 0, SIZE[0] - 1], [0, -1, SIZE[1] - 1], [0, 0, 1]])
    view = find_board(render(CHESS, half_turn @ TILTED), CHESS)
    assert not view.turn_is_ambiguous
    assert np.sqrt(((view.points_px - truth(CHESS, half_turn @ TILTED)) ** 2).mean()) < 0.1


def test_a_board_that_looks_the_same_turned_says_so() -> None:
    even = Board(kind="chessboard", columns=8, rows=6, pitch_mm=10.0)
    view = find_board(render(even), even)
    assert view.turn_is_ambiguous


def test_sixteen_bit_and_colour() -> None:
    image = render(CHESS)
    reference = find_board(image, CHESS).points_px
    twelve_bit = find_board(image.astype(np.uint16) * 16, CHESS)
    assert np.abs(twelve_bit.points_px - reference).max() < 0.1
    colour = find_board(np.dstack([image, image, image]), CHESS)
    assert colour.in_colour
    assert not twelve_bit.in_colour
    assert np.abs(colour.points_px - reference).max() < 0.1


def test_large_frames_are_searched_small_and_measured_large() -> None:
    large = cv2.resize(render(CHESS), None, fx=4, fy=4, interpolation=cv2.INTER_CUBIC)
    view = find_board(large, CHESS)
    assert view.image_size == (2560, 1920)
    error = view.points_px - ((truth(CHESS) + 0.5) * 4 - 0.5)
    assert np.sqrt((error**2).mean()) < 0.6  # 0.15 pixels of the frame it was made from


def half_seen() -> NDArray[np.uint8]:
    image = render(CHESS)
    image[:, :260] = 210
    return image


def two_boards() -> NDArray[np.uint8]:
    small = np.array([[1.6, 0, 90], [0, 1.6, 60], [0, 0, 1]])
    low = np.array([[1.0, 0, 0], [0, 1, 240], [0, 0, 1]])
    return np.minimum(render(CHESS, small), render(CHESS, low @ small))


BAD_FRAMES = {
    "black": (lambda: np.full((480, 640), 3, np.uint8), "black frame"),
    "blank": (lambda: np.full((480, 640), 128, np.uint8), "blank frame"),
    "white": (lambda: np.full((480, 640), 255, np.uint8), "saturated"),
    "saturated": (lambda: np.clip(render(CHESS).astype(int) * 7, 0, 255).astype(np.uint8), "saturated"),
    "dark": (lambda: np.random.default_rng(2).integers(0, 40, (480, 640)).astype(np.uint8), "too dark"),
    "blurred": (lambda: render(CHESS, blur_px=14.0, noise=1.0), "blurred"),
    "no board": (lambda: np.random.default_rng(1).integers(60, 200, (480, 640)).astype(np.uint8), "no board"),
    "two": (two_boards, "two boards"),
}


@pytest.mark.parametrize("name", BAD_FRAMES)
def test_a_bad_frame_is_refused_by_its_own_sentence(name: str) -> None:
    make, sentence = BAD_FRAMES[name]
    image = make()
    with pytest.raises(MeasurementError, match=sentence) as caught:
        find_board(image, CHESS)
    assert caught.value.to_do.endswith(".")


@pytest.mark.parametrize(("columns", "rows"), [(8, 5), (9, 7), (10, 6), (10, 7), (11, 6), (7, 6)])
def test_a_board_of_another_size_is_counted_from_edge_to_edge(columns: int, rows: int) -> None:
    told = Board(kind="chessboard", columns=columns, rows=rows, pitch_mm=10.0)
    with pytest.raises(MeasurementError, match=r"9 × 6 inner corners from edge to edge.*Correct columns and rows"):
        find_board(render(CHESS), told)
    if rows != 6:
        with pytest.raises(MeasurementError, match=r"got 6 inner corners from edge to edge"):
            find_board(np.ascontiguousarray(render(CHESS)[:, 170:]), told)


def moved(across_px: float, down_px: float, turn_rad: float) -> NDArray:
    """The view from farther aside: its middle turned and moved."""
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    u, v = SIZE[0] / 2, SIZE[1] / 2
    move = np.array([[c, -s, u - c * u + s * v + across_px], [s, c, v - s * u - c * v + down_px], [0, 0, 1]])
    return move @ TILTED


@pytest.mark.parametrize(
    ("across_px", "down_px", "turn_rad", "least"),
    [(-150, 0, 0, 48), (300, 0, 0, 40), (0, -150, 0.1, 36), (-150, -130, 0.3, 37), (-100, 100, 4, 40)],
)
def test_a_board_half_outside_is_seen_in_part(
    across_px: float, down_px: float, turn_rad: float, least: int
) -> None:
    view = find_board(render(CHESS, moved(across_px, down_px, turn_rad)), CHESS)
    assert view.is_numbered
    assert least <= len(view.ids) == len(CHESS_IDS) - view.unseen
    expected = truth(CHESS, moved(across_px, down_px, turn_rad))[view.ids]
    assert np.sqrt(((view.points_px - expected) ** 2).mean()) < 0.03
    np.testing.assert_array_equal(view.points_in_board_mm, points_in_board_mm(CHESS)[view.ids])


@pytest.mark.thorough
def test_a_covered_board_is_seen_around_what_covers_it() -> None:
    for across, down in (
        (slice(200, 330), slice(250, 400)),
        (slice(100, 160), slice(None)),
        (slice(None), slice(260)),
    ):
        image = render(CHESS)
        image[across, down] = 150
        view = find_board(image, CHESS)
        assert view.is_numbered
        assert np.sqrt(((view.points_px - truth(CHESS)[view.ids]) ** 2).mean()) < 0.05


def test_corners_that_may_be_several_are_right_to_one_another() -> None:
    onto = moved(250, 0, 2.8)
    view = find_board(render(CHESS, onto), CHESS)
    assert not view.is_numbered
    # Some turn and shift on the board: from the told places to the image there is one homography.
    homography, _ = cv2.findHomography(view.points_in_board_mm[:, :2], view.points_px)
    again = cv2.perspectiveTransform(view.points_in_board_mm[None, :, :2].astype(float), homography)[0]
    assert np.abs(again - view.points_px).max() < 0.15
    assert np.linalg.det(homography) > 0  # never a mirror image


@pytest.mark.parametrize("seed", range(20))
def test_rubbish_is_no_part_of_a_board(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes = np.full((480, 640), 128, np.uint8)
    for _ in range(200):
        corner, size = rng.integers(0, [600, 440]), rng.integers(8, 60, 2)
        cv2.rectangle(boxes, corner.tolist(), (corner + size).tolist(), int(rng.integers(256)), -1)
    assert seen_chessboard(boxes, lattices(boxes), 9) is None


def test_a_chessboard_that_is_found_without_its_size_alone_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = False, None
    monkeypatch.setattr(cv2, "findChessboardCornersSB", lambda *_args, **_options: nothing)
    monkeypatch.setattr(cv2, "findChessboardCorners", lambda *_args, **_options: nothing)
    view = find_board(render(CHESS, TILTED), CHESS)
    assert np.sqrt(((view.points_px - truth(CHESS, TILTED)) ** 2).mean()) < 0.1


@pytest.mark.parametrize(
    "told",
    [(9, 6), (9, 5), (9, 8), (8, 7), (10, 7), (7, 9), (8, 6), (10, 8)],
    ids=lambda told: f"{told[0]}x{told[1]}",
)
@pytest.mark.parametrize("view", ["whole", "in part"])
def test_a_charuco_of_other_squares_is_told_by_its_markers_numbers(told: tuple[int, int], view: str) -> None:
    image = render(CHARUCO)
    if view == "in part":
        image[:, 430:] = 128
    with pytest.raises(MeasurementError, match="one of 9 × 7 squares, by its markers"):
        find_board(image, CHARUCO.model_copy(update={"columns": told[0], "rows": told[1]}))


def test_a_charuco_of_which_upper_or_lower_rows_alone_are_seen_is_not_accused() -> None:
    image = render(CHARUCO)
    for hidden in (*(slice(top, None) for top in range(230, 330, 8)), slice(None, 200)):
        for grey in (20, 128, 220):
            part = image.copy()
            part[hidden] = grey
            assert len(find_board(part, CHARUCO).ids) >= 6
    below = np.array([[1, 0, 0], [0, 1, 170], [0, 0, 1]]) @ TILTED
    assert len(find_board(render(CHARUCO, below), CHARUCO).ids) >= 6


@pytest.mark.parametrize("dictionary", ["DICT_4X4_100", "DICT_6X6_250", "DICT_7X7_50"])
def test_markers_of_another_dictionary_are_named(dictionary: str) -> None:
    with pytest.raises(MeasurementError, match=f"{dictionary}, as cell.board says, got markers of DICT_5X5_50"):
        find_board(render(CHARUCO), CHARUCO.model_copy(update={"dictionary": dictionary}))


def test_a_mirrored_charuco_is_named() -> None:
    with pytest.raises(MeasurementError, match="mirror"):
        find_board(np.ascontiguousarray(render(CHARUCO)[:, ::-1]), CHARUCO)


def test_records_that_lack_something() -> None:
    image = render(CHARUCO)
    with pytest.raises(InputError, match="marker_mm"):
        find_board(image, CHARUCO.model_copy(update={"marker_mm": None}))
    with pytest.raises(InputError, match="DICT_4X4_50"):
        find_board(image, CHARUCO.model_copy(update={"dictionary": "6x9"}))
    with pytest.raises(InputError, match="8 or 16 bit"):
        find_board(image.astype(np.float32), CHARUCO)


def test_a_line_over_corners_makes_no_two_boards_of_one() -> None:
    rows, columns = np.mgrid[0:480, 0:640].astype(float)
    rng = np.random.default_rng(6)
    for _ in range(25):
        onto = np.float32([[40, 60], [600, 20], [560, 440], [-30, 400]]) + np.float32(rng.uniform(-60, 60, (4, 2)))
        place = cv2.getPerspectiveTransform(onto, np.float32([[-1, -1], [10, -1], [10, 7], [-1, 7]]))
        on_board = np.stack([columns, rows, np.ones_like(rows)], axis=-1) @ place.T
        u, v = on_board[..., 0] / on_board[..., 2], on_board[..., 1] / on_board[..., 2]
        is_dark = (u > -1) & (u < 10) & (v > -1) & (v < 7) & ((np.floor(u) + np.floor(v)) % 2 == 0)
        light = np.where(is_dark, 20.0, 110.0)
        away = rows - 240 - rng.uniform(-80, 80) - rng.uniform(-0.3, 0.3) * (columns - 320)
        light += (40 + light) * np.exp(-0.5 * (away / rng.uniform(2, 5)) ** 2)
        grids = lattices(np.clip(cv2.GaussianBlur(light, (0, 0), 1.5), 0, 255).astype(np.uint8))
        corners = np.concatenate([grid[np.isfinite(grid[..., 0])] for grid in grids])
        assert len(np.unique(corners.round(3), axis=0)) == len(corners) > 40
