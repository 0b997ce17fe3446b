"""What the boards' disagreement about the plane of light makes of its ±.

Each board gives a line with its own ±.  What lies alike in all of one board's corners and centres (a sheet that is
not flat, light that bleeds at edges) is in none of these: it shows in how the boards' lines miss one plane, and
nowhere else.  So much is added to each line that the boards disagree as they state; boards whose own ± is smallest
then no longer lay the plane alone.  A board left out because it disagrees is part of that evidence, unless it lies
far beyond what scatters the others.
"""

from dataclasses import replace

import numpy as np

from calib_core.optics.adjust import Adjusted, Adjustment, LaserLines, State, fit_poses
from calib_core.optics.laser_plane import BoardLine, PlaneFit

_FIRST_PX, _DOUBLINGS, _HALVINGS = 0.01, 10, 6
_LINE_TERMS, _PLANE_TERMS = 2, 3
_MEANS_ALONE = np.sqrt(2.0)  # slopes may be right, and then half of what the boards tell says nothing
_BELIEVED = 4  # degrees of freedom that the stated ± are worth before any board: those of two
_GROSS_RATIO = 20.0  # no board lies so far off by what scatters the others: it was moved, or its line is another


def tells_of_scatter(line: BoardLine, fit: PlaneFit) -> bool:
    """Return whether a line left out as off the plane of the others tells how boards' lines scatter."""
    off = line.points_in_camera_mm @ fit.normal - fit.distance_mm
    usual = float(np.sqrt(np.mean(np.square(fit.line_rms_mm))))
    return float(np.sqrt(np.mean(off**2))) < _GROSS_RATIO * usual


def borne_out(
    problem: Adjustment, adjusted: Adjusted, start: State, least_px: float = 0.0
) -> tuple[Adjustment, Adjusted, float]:
    """Return the problem whose boards disagree as they state, its solution, and what it adds to each line, px.

    Parameters
    ----------
    problem : Adjustment
        Its lines come weighed by the noise within each.
    adjusted : Adjusted
        Its solution.
    start : State
        Where the boards' poses begin.
    least_px : float
        What is added at least, as boards that were left out tell.
    """
    excess_px = max(_excess_px(problem, adjusted, start), least_px)
    if excess_px == 0:
        return problem, adjusted, 0.0
    return *_with_excess(problem, adjusted, excess_px), excess_px


def _excess_px(problem: Adjustment, adjusted: Adjusted, start: State) -> float:
    """Return what is to be added to each line for its boards to disagree as they state, px."""
    excess_px, most_px = 0.0, _FIRST_PX
    if tension(problem, adjusted, start) <= 1:
        return 0.0
    for _ in range(_DOUBLINGS):
        if tension(*_with_excess(problem, adjusted, most_px), start) <= 1:
            break
        excess_px, most_px = most_px, 2 * most_px
    for _ in range(_HALVINGS):
        middle_px = (excess_px + most_px) / 2
        if tension(*_with_excess(problem, adjusted, middle_px), start) <= 1:
            most_px = middle_px
        else:
            excess_px = middle_px
    return _MEANS_ALONE * most_px


def student(problem: Adjustment) -> float:
    """Return by how much the plane's variance is larger as its boards' scatter is known from few boards only.

    The variance of Student's t: of the boards' own freedom, and of what the stated ± are believed.
    """
    assert problem.lines is not None
    known = _freedom(problem.lines) + _BELIEVED
    return known / (known - 2)


def tension(problem: Adjustment, adjusted: Adjusted, start: State) -> float:
    """Return how much more the boards disagree about the plane than corners and centres say (variance ratio).

    Each board alone could have its corners and its straight line; that they lie in one plane costs something, and
    it should cost one for each of 2 B − 3 degrees of freedom.
    """
    lines = problem.lines
    assert lines is not None
    bands = (problem.band_nears, problem.band_fars)
    alone = fit_poses(problem.corners, replace(start, shared=adjusted.state.shared), bands, problem.huber).cost
    for first, last in zip(lines.ends[:-1], lines.ends[1:], strict=True):
        if first == last:
            continue
        normed = adjusted.line_residuals[first:last] * lines.weights[first:last]
        along = np.linspace(-1.0, 1.0, last - first)
        within = np.abs(normed - np.polyval(np.polyfit(along, normed, 1), along))
        huber = problem.huber
        alone += float(np.where(within < huber, within**2 / 2, huber * (within - huber / 2)).sum())
    return 2.0 * (adjusted.cost - alone) / _freedom(lines)


def _freedom(lines: LaserLines) -> int:
    boards = int(np.count_nonzero(np.diff(lines.ends)))
    return max(_LINE_TERMS * boards - _PLANE_TERMS, 1)


def _with_excess(problem: Adjustment, adjusted: Adjusted, excess_px: float) -> tuple[Adjustment, Adjusted]:
    """Return the problem, solved, where the mean of each line is off by so much besides, and its slope alike."""
    lines = problem.lines
    assert lines is not None
    squares = np.add.reduceat(np.append(lines.weights**2, 0.0), np.minimum(lines.ends[:-1], len(lines.weights)))
    squares[np.diff(lines.ends) == 0] = 0.0
    growth = np.sqrt(1.0 + squares * excess_px**2)
    weights = lines.weights / np.repeat(growth, np.diff(lines.ends))
    looser = replace(problem, lines=replace(lines, weights=weights))
    return looser, looser.solve(adjusted.state)
