"""Rendered boards with a stripe on them, of the kinds that workshops have, with known truth."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib_core.records import Session
from calib_core.simulation.frame_cell import FrameCell, FrameScenario, as_png, build_cell
from calib_core.simulation.frame_surfaces import BoardSurface, Hit
from calib_core.simulation.frames import Exposure, FloatArray, LightSheet, light, sense
from calib_core.simulation.motion import pose, turn

KINDS = (
    "clean", "saturated", "doubled", "faint", "speckled", "broken", "thick-3", "thick-4", "thick-6", "beside",
    "over-black", "pairs-along", "pairs-across", "bent",
)  # fmt: skip
DARK_KINDS = ("clean", "speckled", "pairs-along", "tape", "reflections", "edges")
"""What a board shows without a laser."""
_PX_MM = 0.28  # a pixel on the boards


@dataclass(frozen=True, eq=False)
class TapedBoard(BoardSurface):
    """A board with a strip of tape across, as light as told, with its direction, rad, its place and width, mm."""

    tape: tuple[float, float, float, float] = (0.9, 0.0, 0.0, 3.0)

    def white(self, hit: Hit, blur_px: FloatArray) -> FloatArray:
        """Return the pattern with the tape over it."""
        light, direction, place, width = self.tape
        across = self.on_board(hit) @ [-np.sin(direction), np.cos(direction)] - place
        blur = blur_px * np.hypot(*np.gradient(across))
        over = np.clip((width / 2 - np.abs(across)) / np.maximum(2 * blur, 1e-9) + 0.5, 0, 1)
        return np.asarray(super().white(hit, blur_px) * (1 - over) + light * np.nan_to_num(over))


@dataclass(frozen=True, eq=False)
class StripeSet:
    """A session of boards with a stripe, and the truth."""

    session: Session
    files: dict[str, bytes]
    cell: FrameCell

    def off(self, normal: Any, distance_mm: float) -> tuple[float, float]:
        """Return how far a plane is off, deg and mm."""
        angle = float(np.degrees(np.arccos(min(1.0, float(np.array(normal) @ self.cell.sheet.normal)))))
        return angle, distance_mm - self.cell.sheet.distance_mm


def stripe_set(kind: str, seed: int, boards: int = 8, laser_off: frozenset[int] = frozenset()) -> StripeSet:
    """Return a set of one of the kinds; the camera is told, some boards are taken with the laser off."""
    rng = np.random.default_rng([seed, [*KINDS, *DARK_KINDS[3:]].index(kind), 4711])
    cell = build_cell(FrameScenario(""), rng)
    if kind == "pairs-across":  # the camera turned by a right angle: its stripe runs from top to bottom
        normal = cell.sheet.normal[[1, 0, 2]]
        cell = replace(cell, sheet=LightSheet(normal, cell.sheet.distance_mm, cell.sheet.distance_mm * normal))
    files: dict[str, bytes] = {}
    captures = []
    board = _board(kind, cell, 0, rng)
    for number in range(boards):
        board = _board(kind, cell, number, rng)
        if kind == "tape":  # where it is stuck, on every frame
            strip = np.random.default_rng(seed)
            tape = (
                strip.choice([0.05, 0.6, 1.0]),
                strip.uniform(-0.6, 0.6),
                strip.uniform(0, 45),
                strip.uniform(1, 6),
            )
            board = TapedBoard(**vars(board), tape=tape)
        sheet = None if number in laser_off else _sheet(kind, cell)
        names = _frames(kind, cell, board, sheet, f"l{number + 1:02d}", files, rng)
        captures.append({"id": f"l{number + 1:02d}", "step": "laser-plane", "kind": "frame", "files": names})
    record: dict[str, Any] = {
        "pose_convention": "abb",
        "scanner": {"kind": "frame"},
        "board": {"kind": "chessboard", "columns": board.columns, "rows": board.rows, "pitch_mm": board.pitch_mm},
        "known": {"camera": cell.known_camera()},
    }
    told = {"format": "scancell-session/1", "name": kind, "cell": record, "captures": captures}
    return StripeSet(Session.model_validate(told), files, cell)


def _board(kind: str, cell: FrameCell, number: int, rng: np.random.Generator) -> BoardSurface:
    """Return a board whose middle the light meets, or its sheet beside the squares."""
    pitch = 12.0 if kind.startswith("thick") else 9.0
    columns, rows = (7, 4) if kind.startswith("thick") else (9, 6)
    depth = 215.0 + 90.0 * (number % 5) / 4 + rng.uniform(-5, 5)
    rotation = turn(rng.uniform(-1, 1, 3) * [0.4, 0.4, 0.25])
    size = np.array([columns - 1, rows - 1]) * pitch
    n, d = cell.sheet.normal, cell.sheet.distance_mm
    along = 0 if kind == "pairs-across" else 1  # the image's axis across the stripe
    middle = np.array([0.0, 0.0, depth])
    middle[along] = (d - n[2] * depth) / n[along]  # in the light
    on_board = size / 2 + rng.uniform(-0.3, 0.3, 2) * size
    margin: float | None = None
    if kind == "beside":
        margin = 5 * pitch
        beyond = pitch * (1 + rng.uniform(1.0, 3.0))
        on_board[1] = -beyond if number % 2 else size[1] + beyond
        rotation = turn(rng.uniform(-1, 1, 3) * [0.4, 0.4, 0.05])
    if kind == "over-black":
        on_board[1] = (number % rows) * pitch + 0.5 * pitch
        rotation = turn(rng.uniform(-1, 1, 3) * [0.4, 0.3, 0.02])
    place = pose(rotation, middle - rotation @ [*on_board, 0.0])
    bend = 1.0 if kind == "bent" else 0.0
    return BoardSurface(place, columns, rows, pitch, margin_mm=margin, bend_mm=bend)


def _sheet(kind: str, cell: FrameCell) -> LightSheet:
    width_px = {"thick-3": 3.0, "thick-4": 4.0, "thick-6": 6.0}.get(kind, 1.2)
    brightness = {"saturated": 900.0, "faint": 9.0, "pairs-along": 700.0, "pairs-across": 700.0}.get(kind, 130.0)
    return replace(cell.sheet, thickness_mm=width_px * _PX_MM * 0.6, brightness=brightness)


def _frames(
    kind: str,
    cell: FrameCell,
    board: BoardSurface,
    sheet: LightSheet | None,
    label: str,
    files: dict[str, bytes],
    rng: np.random.Generator,
) -> list[str]:
    speckle = 0.5 if kind == "speckled" else 0.05
    lamp = replace(Exposure(hot_pixels=60), ambient=90.0)
    dark = replace(lamp, ambient=0.0, speckle=speckle)
    room = light(cell.camera, [board], None, lamp, rng)
    if kind == "reflections":
        room = room + _streak(room.shape, rng)
    if kind == "edges":
        room = room * _shadow(room.shape, rng)
    laser = np.zeros_like(room) if sheet is None else light(cell.camera, [board], sheet, dark, rng)
    if sheet is not None and kind == "doubled":
        ghost = replace(sheet, distance_mm=sheet.distance_mm + 2.5, brightness=0.7 * sheet.brightness)
        laser = laser + light(cell.camera, [board], ghost, dark, rng)
    if kind == "broken":
        laser = laser * _gaps(laser.shape, rng)
    if kind.startswith("pairs"):
        colour = (1.0, 0.25, 0.12)  # a red laser in a camera of three channels, which saturates red
        lit = np.stack([sense(room, lamp, rng) for _ in colour], axis=2)
        both = np.stack([sense(room + share * laser, lamp, rng) for share in colour], axis=2)
        files[f"captures/{label}-lit.png"] = as_png(lit[..., ::-1])
        files[f"captures/{label}-stripe.png"] = as_png(both[..., ::-1])
        return [f"captures/{label}-lit.png", f"captures/{label}-stripe.png"]
    files[f"captures/{label}.png"] = as_png(sense(room + laser, lamp, rng))
    return [f"captures/{label}.png"]


def _across(shape: tuple[int, ...], rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return how far pixels lie beside a line somewhere in the frame, and along it, px."""
    down, right = np.mgrid[: shape[0], : shape[1]].astype(float)
    down, right = down - rng.uniform(0.3, 0.7) * shape[0], right - rng.uniform(0.3, 0.7) * shape[1]
    c, s = np.cos(angle := rng.uniform(0, np.pi)), np.sin(angle)
    return c * down - s * right, s * down + c * right


def _streak(shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
    """Return a lamp's light on a board that shines: a streak, as narrow as a laser's line or wider."""
    beside, along = _across(shape, rng)
    width, length = np.exp(rng.uniform(np.log(1.5), np.log(15))), rng.uniform(15, 80)
    return rng.uniform(20, 150) * np.exp(-0.5 * (beside / width) ** 2 - 0.5 * (along / length) ** 2)


def _shadow(shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
    """Return how much room light is left beside and in the shadow of something with a straight edge."""
    beside, _ = _across(shape, rng)
    return 1 - rng.uniform(0.3, 0.8) / (1 + np.exp(-beside / rng.uniform(0.7, 3)))


def _gaps(shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
    """Return light that reaches some columns only: two thirds are shaded, in runs."""
    shaded = np.zeros(shape[1])
    while shaded.mean() < 0.65:
        start = int(rng.integers(shape[1]))
        shaded[start : start + int(rng.integers(10, 45))] = 1.0
    return np.broadcast_to(1.0 - shaded, shape)
