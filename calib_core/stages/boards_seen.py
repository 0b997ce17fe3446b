"""Where boards were seen so far: what the guide asks the next view by, and the page shows while frames come in."""

from collections.abc import Sequence

import numpy as np

from calib_core.errors import MotionError
from calib_core.frames import FloatArray
from calib_core.optics.camera_start import centred_camera, poses_from_homographies
from calib_core.optics.coverage_cells import CELLS, image_coverage
from calib_core.records import BoardFacing, BoardsSeen, Measured, Session

_SIZES_APART = 1.25  # the largest board over the smallest: less is one distance


def usable(session: Session, measured: Sequence[Measured], step: str) -> list[Measured]:
    """Return what was seen in the step's captures, without the refused and the excluded ones."""
    seen = {m.capture: m for m in measured}
    found = [
        seen.get(c.id, Measured(capture=c.id, kind=c.kind, verdict="pass"))
        for c in session.captures
        if c.step == step and not c.excluded
    ]
    return [m for m in found if m.verdict != "fail"]


def seen_cells(views: Sequence[Measured]) -> np.ndarray:
    """Return which cells of the image (6, 8) have a corner of a board in any of the views."""
    cells = np.zeros(CELLS[::-1], dtype=bool)
    for view in views:
        if view.image_size and (pixels := view.board_px or view.preview):
            cells |= image_coverage(np.array(pixels), view.image_size) > 0
    return cells


def boards_seen(step: str, views: Sequence[Measured]) -> BoardsSeen | None:
    """Return what a step's views cover together; None where none shows a board."""
    shown = [view for view in views if view.board_px or view.preview]
    if not shown:
        return None
    sizes = [one.pitch_px or _extent_px(one) for one in shown]
    ratio = max(sizes) / max(min(sizes), 1e-9)
    covered = float(seen_cells(shown).mean())
    return BoardsSeen(
        step=step,
        frames=len(shown),
        covered=covered,
        depth_ratio=ratio,
        one_distance=ratio < _SIZES_APART,
        facing=_facing(shown, np.array(sizes) / max(sizes)),
    )


def _facing(views: Sequence[Measured], nearness: FloatArray) -> list[BoardFacing]:
    """Return which way the boards face by the focal length that they agree on, none where they say none."""
    told = [(view, near) for view, near in zip(views, nearness, strict=True) if view.pixel_from_board]
    size = next((view.image_size for view in views if view.image_size), None)
    if not told or size is None:
        return []
    pixel_from_board = np.array([view.pixel_from_board for view, _ in told])
    try:
        camera_from_board = poses_from_homographies(pixel_from_board, centred_camera(pixel_from_board, size))[0]
    except MotionError:
        return []
    normals = camera_from_board[:, :, 2]
    toward = -normals * np.sign(normals[:, 2:])
    across = np.hypot(*toward[:, :2].T)
    turns = toward[:, :2] * (np.arcsin(np.minimum(across, 1.0)) / np.maximum(across, 1e-12))[:, None]
    return [
        BoardFacing(capture=view.capture, facing_rad=(float(x), float(y)), nearness=float(near))
        for (view, near), (x, y) in zip(told, turns, strict=True)
    ]


def coverage_so_far(session: Session, measured: Sequence[Measured]) -> list[BoardsSeen]:
    """Return what the boards of every step cover whose frames show some."""
    steps = dict.fromkeys(c.step for c in session.captures)
    found = ((step, [one for one in usable(session, measured, step) if one.board_px]) for step in steps)
    return [told for step, views in found if (told := boards_seen(step, views)) is not None]


def _extent_px(view: Measured) -> float:
    return float(np.sqrt(np.prod(np.ptp(np.array(view.board_px or view.preview), axis=0))))
