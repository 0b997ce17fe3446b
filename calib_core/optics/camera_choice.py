"""Which camera model the data asks for: the plainest whose error on held-out views none beats significantly."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from calib_core.frames import FloatArray
from calib_core.kernels.bundle import SHAPE_TERMS
from calib_core.optics.adjust import Corners, State, fit_poses
from calib_core.optics.camera_model import Model

if TYPE_CHECKING:
    from calib_core.optics.camera_layout import Layout

_LEAST_GAIN = 0.03  # of the mean squared error; less is not worth a parameter
# Sheets sag, bow and twist: that is quadratic.  Where that says nothing, what a cubic gains is by errors of print
# and localisation that lie alike in all views, unless it gains much.
QUADRATIC = 3
_LEAST_GAIN_OF_CUBIC_ALONE = 0.2
_SIGNIFICANT = 2.5  # standard errors of the views' mean gain


@dataclass(frozen=True)
class Candidate:
    """A model and how it did.

    Attributes
    ----------
    model : str
    parameters : int
    held_out_rms_px : float
        Of the corners of views that had no part in the fit, their poses alone fitted to them.
    shape_terms : int
        By how many of its shape's terms the board may be bent.
    """

    model: Model
    parameters: int
    held_out_rms_px: float
    shape_terms: int = 0

    @property
    def bent(self) -> bool:
        """Whether the board may be bent."""
        return self.shape_terms > 0


def choose_layout(
    corners: Corners, state: State, layouts: "Sequence[Layout]", folds: int, bent: bool | None = False
) -> "tuple[Layout, tuple[Candidate, ...]]":
    """Return the chosen layout, and all candidates with their held-out errors.

    Parameters
    ----------
    corners, state
        The plain model's, of the views of use.
    layouts : sequence of Layout
        From the plainest on, which must be there; a later one must beat those before it.
    folds : int
    bent : bool or None
        Whether the board may be bent; None: the plainest and the best of the flat ones are tried with it, too,
        first quadratically, then cubically.
    """
    if bent:
        layouts = [layout.with_bent_board() for layout in layouts]
    best = layouts[0]
    tried: dict[Layout, FloatArray] = {}
    best = _best_of(corners, state, layouts, folds, best, tried)
    if bent is None:
        also = {layouts[0].model: layouts[0], best.model: best}.values()
        quadratic, cubic = ([one.with_bent_board(terms) for one in also] for terms in (QUADRATIC, SHAPE_TERMS))
        best = _best_of(corners, state, quadratic, folds, best, tried)
        least = _LEAST_GAIN if best.bends else _LEAST_GAIN_OF_CUBIC_ALONE
        best = _best_of(corners, state, cubic, folds, best, tried, least)
    return best, tuple(
        Candidate(one.model, len(one.free), float(np.sqrt(np.mean(errors))), one.shape_terms)
        for one, errors in tried.items()
    )


def _best_of(
    corners: Corners,
    state: State,
    layouts: "Sequence[Layout]",
    folds: int,
    best: "Layout",
    tried: "dict[Layout, FloatArray]",
    least: float = _LEAST_GAIN,
) -> "Layout":
    """Return the plainest that none beats, of `best` and others; what was tried is added with its errors."""
    for layout in layouts:
        found = held_out_errors(corners, state, layout, folds)
        if found is None:
            continue
        tried[layout], settled = found
        # Views that do not determine a model's coefficients are no reason to take it.
        if settled and best in tried and _beats(tried[layout], tried[best], least):
            best = layout
    return best


def _beats(squares: FloatArray, others: FloatArray, least: float) -> bool:
    """Whether views are foretold significantly better, by their mean squared errors (V,)."""
    # By their logarithms, so that the few views that gain most do not blur what all of them say.
    gain = np.log(others / squares)
    mean, deviation = float(gain.mean()), float(gain.std(ddof=1) / np.sqrt(len(gain)))
    better_in_all = squares.mean() < (1 - least) * others.mean()
    return bool(better_in_all and mean > _LEAST_GAIN and mean > _SIGNIFICANT * deviation)


def held_out_errors(
    corners: Corners, state: State, layout: "Layout", folds: int
) -> tuple[FloatArray, bool] | None:
    """Return each view's mean squared error (V,), px², when it is left out, and whether all folds' fits settled.

    None if a fold cannot be solved.

    Views are dealt to the folds by their depth in turn, so that every fold spans the depths.
    """
    from calib_core.optics.camera_layout import restart

    order = np.argsort(state.translations[:, 2], kind="stable")
    folds = max(2, min(folds, corners.views // 2))
    squares = np.full(corners.views, np.nan)
    start, settled = restart(state, layout), True
    for fold in range(folds):
        out = np.sort(order[fold::folds])
        kept = np.setdiff1d(np.arange(corners.views), out)
        if 2 * int((corners.take(kept).weights > 0).sum()) < len(layout.free) + 6 * len(kept) + 10:
            return None
        shared = start.shared
        if len(layout.free):
            try:
                trained = layout.adjustment(corners.take(kept)).solve(start.take(kept), 1e-3)
            except np.linalg.LinAlgError:
                return None
            shared, settled = trained.state.shared, settled and trained.converged
        left = corners.take(out)
        there = start.take(out)
        end = fit_poses(left, State(shared, there.rotations, there.translations), layout.bands, np.inf)
        each = (end.corner_residuals**2).sum(axis=1) * (left.weights > 0)
        counts = np.add.reduceat((left.weights > 0).astype(float), left.ends[:-1])
        squares[out] = np.add.reduceat(each, left.ends[:-1]) / np.maximum(counts, 1)
    return (squares, settled) if np.isfinite(squares).all() else None
