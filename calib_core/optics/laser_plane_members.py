"""Which boards' lines lay the plane of light, and which of their centres."""

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.optics.laser_plane import BoardLine, PlaneFit, fit_plane
from calib_core.optics.laser_plane_borne_out import Boards, chance_of_one_more

LeftOut = Literal["no-line", "off-plane"]
"""Why a view is left out: no line is seen on its board, or one off the plane of the others."""

_SPOILED_RMS_RATIO = 6.0
_RARE = 1e-4  # by what scatters the others no line lies farther off: it is another's, or its board moved
_ANOTHERS = 100.0  # times what the others miss the plane by: no line of theirs lies so far off, a reflection does
_STRAY_SIGMAS = 4.0
_ROUNDS, _BISQUARE = 5, 4.685


def members(
    lines: Sequence[BoardLine], agreeing: Sequence[int], together: Callable[[Sequence[int], PlaneFit], Boards]
) -> tuple[list[LeftOut | None], PlaneFit]:
    """Return why each view is left out, None where it is used, and the plane through the lines of those.

    A robust plane rests on the lines that agree best, however few: one that lies off it comes back where the
    others scatter so much that it may belong to them.

    Parameters
    ----------
    lines : sequence of BoardLine
    agreeing : sequence of int
        Places of those that alone lay the plane at first; none told: all do.
    together : callable
        Gives the boards at some places about a plane, solved.
    """
    fit = fit_plane(lines, agreeing)
    reasons = _reasons(lines, fit, agreeing or range(len(lines)))
    used = [i for i, reason in enumerate(reasons) if reason is None]
    if len(used) < len(lines):
        fit = fit_plane([lines[i] for i in used])
    far_mm = _ANOTHERS * fit.rms_mm
    off = [i for i, reason in enumerate(reasons) if reason == "off-plane" and _rms(lines[i], fit) < far_mm]
    for nearest in sorted(off, key=lambda i: _rms(lines[i], fit)):
        every = sorted([*used, nearest])
        if chance_of_one_more(together(used, fit), together(every, fit)) < _RARE:
            break
        used, reasons[nearest] = every, None
        fit = fit_plane([lines[i] for i in used])
    return reasons, fit


def on_own_line(line: BoardLine, fit: PlaneFit) -> NDArray[np.bool_]:
    """Return which points (N,) of a board lie on the straight line that they form, wherever the plane is."""
    points = line.points_in_camera_mm
    off = points @ fit.normal - fit.distance_mm
    middle = points.mean(axis=0)
    along = (points - middle) @ np.linalg.svd(points - middle, full_matrices=False)[2][0]
    basis = np.column_stack([np.ones(len(along)), along / max(float(np.abs(along).max()), 1e-9)])
    weight, left = np.ones(len(off)), off
    for _ in range(_ROUNDS):
        left = off - basis @ np.linalg.lstsq(basis * weight[:, None], off * weight, rcond=None)[0]
        weight = np.clip(1.0 - (left / (_BISQUARE * _scale(left))) ** 2, 0.0, None)
    return np.asarray(np.abs(left) <= _STRAY_SIGMAS * _scale(left))


def _scale(values: FloatArray) -> float:
    return 1.4826 * float(np.median(np.abs(values))) + 1e-9


def _rms(line: BoardLine, fit: PlaneFit) -> float:
    return float(np.sqrt(np.mean((line.points_in_camera_mm @ fit.normal - fit.distance_mm) ** 2)))


def _reasons(lines: Sequence[BoardLine], fit: PlaneFit, agreeing: Sequence[int]) -> list[LeftOut | None]:
    """Return why a view is left out, or None; those that agree tell how far off the plane a line usually lies."""
    usual = float(np.median([fit.line_rms_mm[i] for i in agreeing if lines[i].is_enough] or [np.inf]))
    limit = _SPOILED_RMS_RATIO * max(usual, fit.rms_mm)
    reasons: list[LeftOut | None] = []
    for line, rms, inlier in zip(lines, fit.line_rms_mm, fit.inliers, strict=True):
        reason: LeftOut | None = None
        if not line.is_enough:
            reason = "no-line"
        elif rms > limit or inlier.mean() < 0.3:
            reason = "off-plane"
        reasons.append(reason)
    return reasons
