"""What the boards' disagreement about the plane of light makes of its ±.

Each board gives a line with its own ±.  What lies alike in all of one board's corners and centres (a sheet that is
not flat, light that bleeds at edges) is in none of these: it shows in how the boards' lines miss one plane, and
nowhere else.  So much is added to each line that the boards disagree as they state; boards whose own ± is smallest
then no longer lay the plane alone.  A board belongs to them unless it lies farther off than what scatters the
others explains.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from calib_core.optics.adjust import Adjusted, Adjustment, LaserLines, State, fit_poses

_FIRST_PX, _DOUBLINGS, _HALVINGS = 0.01, 10, 6
_LINE_TERMS, _PLANE_TERMS = 2, 3
_MEANS_ALONE = np.sqrt(2.0)  # slopes may be right, and then half of what the boards tell says nothing
_BELIEVED = 4  # degrees of freedom that the stated ± are worth before any board: those of two


@dataclass(frozen=True, eq=False)
class Boards:
    """Boards whose lines are to lie in one plane.

    Attributes
    ----------
    problem : Adjustment
        Its lines come weighed by the noise within each.
    adjusted : Adjusted
        Its solution.
    start : State
        Where the boards' poses begin.
    """

    problem: Adjustment
    adjusted: Adjusted
    start: State

    @property
    def freedom(self) -> int:
        """How many values tell how the lines scatter."""
        assert self.problem.lines is not None
        return _freedom(self.problem.lines)

    def disagreement(self) -> float:
        """Return how far lines lie off one plane, as a χ² of as many degrees as there is freedom.

        Each board alone could have its corners and its straight line; that they lie in one plane costs something.
        """
        problem, adjusted = self.problem, self.adjusted
        lines = problem.lines
        assert lines is not None
        bands = (problem.band_nears, problem.band_fars)
        shared = replace(self.start, shared=adjusted.state.shared)
        alone = fit_poses(problem.corners, shared, bands, problem.huber).cost
        for first, last in zip(lines.ends[:-1], lines.ends[1:], strict=True):
            if first == last:
                continue
            normed = adjusted.line_residuals[first:last] * lines.weights[first:last]
            along = np.linspace(-1.0, 1.0, last - first)
            within = np.abs(normed - np.polyval(np.polyfit(along, normed, 1), along))
            huber = problem.huber
            alone += float(np.where(within < huber, within**2 / 2, huber * (within - huber / 2)).sum())
        return 2.0 * (adjusted.cost - alone)

    def with_excess(self, excess_px: float) -> Self:
        """Return the same, solved, where the mean of each line is off by so much besides, and its slope alike."""
        lines = self.problem.lines
        assert lines is not None
        squares = np.add.reduceat(
            np.append(lines.weights**2, 0.0), np.minimum(lines.ends[:-1], len(lines.weights))
        )
        squares[np.diff(lines.ends) == 0] = 0.0
        growth = np.sqrt(1.0 + squares * excess_px**2)
        weights = lines.weights / np.repeat(growth, np.diff(lines.ends))
        looser = replace(self.problem, lines=replace(lines, weights=weights))
        return replace(self, problem=looser, adjusted=looser.solve(self.adjusted.state))

    def excess_px(self) -> float:
        """Return what is to be added to each line for its boards to disagree as they state, px."""
        excess_px, most_px = 0.0, _FIRST_PX
        if self.disagreement() <= self.freedom:
            return 0.0
        for _ in range(_DOUBLINGS):
            if self.with_excess(most_px).disagreement() <= self.freedom:
                break
            excess_px, most_px = most_px, 2 * most_px
        for _ in range(_HALVINGS):
            middle_px = (excess_px + most_px) / 2
            if self.with_excess(middle_px).disagreement() <= self.freedom:
                most_px = middle_px
            else:
                excess_px = middle_px
        return _MEANS_ALONE * most_px


def borne_out(boards: Boards) -> tuple[Boards, float]:
    """Return boards that disagree as they state, solved, and what that adds to each line, px."""
    excess_px = boards.excess_px()
    return (boards.with_excess(excess_px), excess_px) if excess_px else (boards, 0.0)


def chance_of_one_more(boards: Boards, with_one: Boards) -> float:
    """Return how often the line of one more board lies as far off by what scatters the others, or farther.

    By Fisher's F of its two terms over the others' freedom, which includes what the stated ± are believed.
    """
    excess_px = boards.excess_px()
    added = with_one.with_excess(excess_px).disagreement() - boards.with_excess(excess_px).disagreement()
    known = boards.freedom + _BELIEVED
    return float((1.0 + max(added, 0.0) / known) ** (-known / _LINE_TERMS))


def student(boards: Boards) -> float:
    """Return by how much the plane's variance is larger as its boards' scatter is known from few boards only.

    The variance of Student's t: of the boards' own freedom, and of what the stated ± are believed.
    """
    known = boards.freedom + _BELIEVED
    return known / (known - 2)


def _freedom(lines: LaserLines) -> int:
    boards = int(np.count_nonzero(np.diff(lines.ends)))
    return max(_LINE_TERMS * boards - _PLANE_TERMS, 1)
