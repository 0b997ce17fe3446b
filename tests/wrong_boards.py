"""Frames of boards of each kind, and twelve ways to describe each board wrongly."""

from dataclasses import dataclass

import numpy as np

from calib_core.records import Board
from calib_core.simulation.frame_camera import SimulatedCamera
from calib_core.simulation.frame_surfaces import BoardSurface
from calib_core.simulation.frames import Exposure, ImageArray, render
from calib_core.simulation.motion import pose, turn

CAMERA = SimulatedCamera()
RIGHT = {
    "chessboard": Board(kind="chessboard", columns=9, rows=6, pitch_mm=10.0),
    "charuco": Board(kind="charuco", columns=9, rows=7, pitch_mm=12.0, marker_mm=8.4, dictionary="DICT_4X4_100"),
    "circles": Board(kind="circles", columns=8, rows=6, pitch_mm=12.0),
    "asymmetric-circles": Board(kind="asymmetric-circles", columns=4, rows=11, pitch_mm=8.0),
}
# What is told besides the kind itself where another kind is told.
_AS_KIND = {
    "chessboard": {"marker_mm": None, "dictionary": None},
    "charuco": {"marker_mm": 5.0, "dictionary": "DICT_4X4_100"},
    "circles": {"marker_mm": None, "dictionary": None},
    "asymmetric-circles": {"marker_mm": None, "dictionary": None},
}


@dataclass(frozen=True)
class Wrong:
    """A wrong description of a board.

    Attributes
    ----------
    name : str
    told : Board
    says : str
        A pattern that the reason fits.
    mirrored : bool
        Whether the frames are mirrored.
    """

    name: str
    told: Board
    says: str
    mirrored: bool = False


def wrong_descriptions(kind: str) -> list[Wrong]:
    """Return twelve wrong descriptions of a kind of board."""
    right = RIGHT[kind]
    size = f"{right.columns} × {right.rows}"
    counts = {
        "a column more": (1, 0), "a column less": (-1, 0), "a row more": (0, 1), "a row less": (0, -1),
        "squares for corners": (1, 1), "corners for squares": (-1, -1), "two columns more": (2, 0),
    }  # fmt: skip
    found = [
        Wrong(name, right.model_copy(update={"columns": right.columns + c, "rows": right.rows + r}), size)
        for name, (c, r) in counts.items()
    ]
    for other in RIGHT:
        if other != kind:
            told = right.model_copy(update={"kind": other, **_AS_KIND[other]})
            found.append(Wrong(f"told as {other}", told, f"(?i){kind.replace('-', '.')}|{_WORDS[kind]}"))
    exchanged = right.model_copy(update={"columns": right.rows, "rows": right.columns})
    if kind == "charuco":
        found.append(Wrong("exchanged", exchanged, size))
        other = right.model_copy(update={"dictionary": "DICT_6X6_250"})
        return [*found, Wrong("another dictionary", other, "DICT_4X4")]
    if kind == "asymmetric-circles":
        return [
            *found,
            Wrong("exchanged", exchanged, size),
            Wrong("two rows more", right.model_copy(update={"rows": 13}), size),
        ]
    return [
        *found,
        Wrong("two rows more", right.model_copy(update={"rows": right.rows + 2}), size),
        Wrong("two rows less", right.model_copy(update={"rows": right.rows - 2}), size),
    ]


_WORDS = {
    "chessboard": "chessboard",
    "charuco": "ChArUco|markers",
    "circles": "circles",
    "asymmetric-circles": "every second row shifted",
}


def board_frames(board: Board, seed: int, count: int, mirrored: bool = False) -> list[ImageArray]:
    """Return frames of a whole board, near and far, tilted and turned."""
    rng = np.random.default_rng([seed, 431])
    frames: list[ImageArray] = []
    while len(frames) < count:
        rotation = turn(rng.uniform(-1, 1, 3) * [0.5, 0.5, 0.6])
        depth = rng.uniform(170.0, 260.0)
        middle = np.array([*(rng.uniform(-0.12, 0.12, 2) * depth), depth])
        surface = _surface(board, np.eye(4))
        flat = surface.points_on_board_mm()
        place = pose(rotation, middle - rotation @ flat.mean(axis=0))
        edge = np.array([flat.min(0) - 1.3 * board.pitch_mm, flat.max(0) + 1.3 * board.pitch_mm])
        corners = np.array([[x, y, 0.0] for x in edge[:, 0] for y in edge[:, 1]])
        pixels = CAMERA.pixels(corners @ place[:3, :3].T + place[:3, 3])
        if not ((pixels > 6) & (pixels < np.array([CAMERA.width, CAMERA.height]) - 7)).all():
            continue
        frame = render(CAMERA, [_surface(board, place)], None, Exposure(ambient=180.0), rng)
        frames.append(np.ascontiguousarray(frame[:, ::-1]) if mirrored else frame)
    return frames


def _surface(board: Board, place: np.ndarray) -> BoardSurface:
    marked = {} if board.marker_mm is None else {"marker_mm": board.marker_mm, "dictionary": str(board.dictionary)}
    return BoardSurface(place, board.columns, board.rows, board.pitch_mm, board.kind, **marked)
