"""The simulated cell with a board that stands still in the base: frames of it, and with the stripe on it."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib_core.records import Session
from calib_core.simulation.frame_cell import (
    TOOL0_FROM_CAMERA,
    FrameCell,
    FrameScenario,
    as_png,
    board_views,
    build_cell,
    cell_record,
    exposure_for,
)
from calib_core.simulation.frame_surfaces import BoardSurface
from calib_core.simulation.frames import FloatArray, LightSheet, render
from calib_core.simulation.motion import back, pose, turn
from calib_core.simulation.profile_cell import pose_numbers, rounded_pose

_BASE_FROM_BOARD = pose(turn([0.1, 3.0, 0.2]), [850.0, -120.0, 35.0])


@dataclass(frozen=True)
class FixedBoardScenario:
    """A session in which the scanner moves about a fixed board.

    Parameters
    ----------
    lit : int
        Frames of the lit board, each from its own robot pose.
    striped : int
        Lit boards followed by their stripe, from robot poses of their own.
    position_sigma_mm, orientation_sigma_rad : float
        The robot's pose errors.
    """

    lit: int
    striped: int
    position_sigma_mm: float = 0.03
    orientation_sigma_rad: float = 0.0001


def simulate_fixed_board(
    options: FixedBoardScenario, name: str, seed: int
) -> tuple[Session, dict[str, bytes], dict[str, Any]]:
    """Return the session record, its files and the truth of a scenario."""
    rng = np.random.default_rng([seed, 27_182])
    frames = FrameScenario(name)
    cell = build_cell(frames, rng)
    files: dict[str, bytes] = {}
    captures: list[dict[str, Any]] = []
    for index, wanted in enumerate(board_views(options.lit + options.striped, rng)):
        reported, board = _taken(wanted, options, rng)
        step = "camera" if index < options.lit else "laser-plane"
        label = f"{step[0]}{index + 1:02d}"
        shown = {f"captures/{label}.png": _frame(cell, board, 190.0, None, rng)}
        if step == "laser-plane":
            shown[f"captures/{label}-stripe.png"] = _frame(cell, board, 0.0, cell.sheet, rng)
        files |= shown
        captures.append(
            {"id": label, "step": step, "kind": "frame", "files": [*shown], "pose": pose_numbers(reported)}
        )
    record = cell_record(cell, frames)
    record["board"]["fixed"] = True
    record["robot"] = {
        "position_sigma_mm": options.position_sigma_mm,
        "orientation_sigma_deg": float(np.rad2deg(options.orientation_sigma_rad)),
    }
    data = {"format": "scancell-session/1", "name": f"simulated {name}, seed {seed}", "cell": record}
    truth = {**cell.truth(), "seed": seed, "scenario": name, "base_from_board": _BASE_FROM_BOARD.tolist()}
    truth["tool0_from_camera"] = TOOL0_FROM_CAMERA.tolist()
    return Session.model_validate({**data, "captures": captures}), files, truth


def _taken(
    wanted: BoardSurface, options: FixedBoardScenario, rng: np.random.Generator
) -> tuple[FloatArray, BoardSurface]:
    """Return the pose that the robot reports, and the board as the camera then has it before it."""
    reported = rounded_pose(_BASE_FROM_BOARD @ back(TOOL0_FROM_CAMERA @ wanted.camera_from_board))
    actual = pose(
        reported[:3, :3] @ turn(rng.normal(0, options.orientation_sigma_rad, 3)),
        reported[:3, 3] + rng.normal(0, options.position_sigma_mm, 3),
    )
    return reported, replace(wanted, camera_from_board=back(actual @ TOOL0_FROM_CAMERA) @ _BASE_FROM_BOARD)


def _frame(
    cell: FrameCell, board: BoardSurface, ambient: float, sheet: LightSheet | None, rng: np.random.Generator
) -> bytes:
    exposure = exposure_for(FrameScenario("", hot_pixels=80), cell, ambient)
    return as_png(render(cell.camera, [board], sheet, exposure, rng))
