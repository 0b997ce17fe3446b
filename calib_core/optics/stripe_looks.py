"""A frame's stripe looked for in several ways, where the first one met no plain line on the board."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.optics.board_ground import EDGE_PX, SATURATED, SCALE
from calib_core.optics.stripe import StripeCenters, StripeOptions, find_stripe
from calib_core.optics.stripe_view import SMALLEST_PX, Axis, Color, ImageArray

_AXES: tuple[Axis, ...] = ("columns", "rows")
_COLORS: tuple[Color, ...] = ("red", "green", "blue")
_FAINT_SNR, _RIVALRY = 4.0, 0.98
_NARROW_PX, _WIDEST_PX = 15, 61
_WHOLE_WIDTHS, _WIDENINGS = 6.0, 3
_TOGETHER, _LEAST_TOGETHER, _SLOPES = 4, 8, tuple(np.arange(-3, 4) / 9)
_LINE_DEGREE, _BESIDE_PX, _LEAST_CENTERS = 2, 20, 12
_SAME_LINE, _NEAR_PX = 0.85, 3.0  # of a line's centres are there again, and so near, when less is taken off


@dataclass(frozen=True, eq=False)
class StripeLooks:
    """What was found, one way each; whoever knows where the board is chooses."""

    stripes: tuple[StripeCenters, ...]


def look_again(image: ImageArray, dark: ImageArray | None = None) -> StripeLooks:
    """Return what is found along both axes: in each channel of a colour frame, and in the best one at each place.

    Faint peaks count, of two like ones the brighter one, and saturated ones by their flanks: chance is for the
    board's line to tell.

    Parameters
    ----------
    image : (H, W) or (H, W, 3)
    dark : like image, optional
        The same view without the laser.
    """
    found: list[StripeCenters] = []
    for axis in _AXES:
        options = StripeOptions(axis, least_snr=_FAINT_SNR, rivalry=_RIVALRY, flanks=True)
        colors = _COLORS if image.ndim == 3 else (None,)
        here = [*_found(image, [replace(options, color=color) for color in colors], dark)]
        if len(here) > 1:
            found.append(_best_of(here))
        found += here
        if dark is None:
            found += _among_wider(image, replace(options, flanks=False))
    return StripeLooks(tuple(found))


def look_along(
    stripe: StripeCenters, on_line: NDArray[np.bool_], image: ImageArray, dark: ImageArray | None = None
) -> StripeCenters:
    """Return a stripe whose centres on a line are measured again, by what stands along that line alone.

    Where most of a frame's peaks are the board's pattern, the stripe's width and its noise are the pattern's too:
    a filter as wide as that reaches over edges that lie far beside the line and is drawn by them.

    Parameters
    ----------
    stripe : StripeCenters
    on_line : (N,)
        Which of its centres form the line.
    image : (H, W) or (H, W, 3)
        In which it was found.
    dark : like image, optional
        The same view without the laser.
    """
    columns = stripe.axis == "columns"
    along, across = (stripe.column_px, stripe.row_px) if columns else (stripe.row_px, stripe.column_px)
    frames = [one if columns else one.swapaxes(0, 1) for one in (image, dark) if one is not None]
    places = np.rint(along[on_line]).astype(int)
    middle = np.polynomial.Polynomial.fit(places, across[on_line], _LINE_DEGREE)(places)
    first = np.rint(middle).astype(int) - _BESIDE_PX
    inside = (first >= 0) & (first + 2 * _BESIDE_PX < len(frames[0]))
    which = np.flatnonzero(on_line)[inside]
    if len(which) < _LEAST_CENTERS:
        return stripe
    several = np.arange(max(len(which), SMALLEST_PX)) % len(which)
    rows, beside = first[inside][several] + np.arange(2 * _BESIDE_PX + 1)[:, None], places[inside][several]
    strips = [np.ascontiguousarray(one[rows, beside]) for one in frames]
    options = StripeOptions("columns", least_snr=_FAINT_SNR, rivalry=_RIVALRY, flanks=True)
    try:
        again = find_stripe(strips[0], options, dark=strips[1] if dark is not None else None)
    except MeasurementError:
        return stripe
    taken = again.column_px < len(which)
    again = again.selected(taken & (np.abs(again.row_px - _BESIDE_PX) < _NEAR_PX))
    if len(again.row_px) < _SAME_LINE * len(which):
        return stripe  # what stands out most along the line is another peak
    at = which[np.rint(again.column_px).astype(int)]
    back = again.row_px + first[inside][np.rint(again.column_px).astype(int)]
    pixels = stripe.pixels.copy()
    pixels[at, 1 if columns else 0] = back
    kept = ~on_line
    kept[at] = True
    both = replace(
        stripe,
        column_px=pixels[:, 0],
        row_px=pixels[:, 1],
        sigma_px=_with(stripe.sigma_px, at, again.sigma_px),
        amplitude=_with(stripe.amplitude, at, again.amplitude),
        ground=None if stripe.ground is None or again.ground is None else _with(stripe.ground, at, again.ground),
        lever_px=None
        if stripe.lever_px is None or again.lever_px is None
        else _with(stripe.lever_px, at, again.lever_px),
        width_px=again.width_px,
        noise=again.noise,
    )
    return both.selected(kept)


def look_without_board(left: NDArray[np.uint16]) -> list[StripeCenters]:
    """Return what is found along both axes in what is left of a frame without its board, see `board_ground`."""
    found: list[StripeCenters] = []
    for axis in _AXES:
        ways = [_look_together(left if axis == "columns" else left.T, slope) for slope in _SLOPES]
        best = max((one for one in ways if one is not None), key=lambda one: len(one.row_px), default=None)
        if best is not None:
            turned = replace(best, column_px=best.row_px, row_px=best.column_px, axis=axis)
            found.append(best if axis == "columns" else turned)
    return found


def _look_together(left: NDArray[np.uint16], slope: float) -> StripeCenters | None:
    """Return what is found where columns beside each other are taken together along a slope, rows a column."""
    width = left.shape[1] // _TOGETHER * _TOGETHER
    down = np.rint(slope * (np.arange(width) - width / 2)).astype(int)
    rows = np.clip(np.arange(len(left))[:, None] + down, 0, len(left) - 1)
    mean = left[rows, np.arange(width)].reshape(len(left), -1, _TOGETHER).mean(axis=2)
    options = StripeOptions("columns", None, None, SATURATED, _FAINT_SNR, _RIVALRY, _LEAST_TOGETHER)
    for one in _found(np.rint(mean).astype(np.uint16), [options], None):
        middle = down.reshape(-1, _TOGETHER).mean(axis=1)[one.column_px.astype(int)]
        return replace(
            one,
            column_px=_TOGETHER * one.column_px + (_TOGETHER - 1) / 2,
            row_px=one.row_px + middle,
            amplitude=one.amplitude / SCALE,
            noise=one.noise / SCALE,
            ground=np.zeros(len(one.row_px)),
            together=_TOGETHER,
            blind_px=EDGE_PX,
        )
    return None


def _with(values: FloatArray, at: NDArray[np.int64], others: FloatArray) -> FloatArray:
    """Return values (N,) with others (M,) at places (M,)."""
    changed = values.copy()
    changed[at] = others
    return changed


def _found(image: ImageArray, ways: list[StripeOptions], dark: ImageArray | None) -> list[StripeCenters]:
    found: list[StripeCenters] = []
    for options in ways:
        try:
            found.append(find_stripe(image, options, dark=dark))
        except MeasurementError:
            continue
    return found


def _among_wider(image: ImageArray, options: StripeOptions) -> list[StripeCenters]:
    """Return what is found where all that is wider across than a line is taken off: faint ones stand out so.

    A thick line loses its flanks with it: more is left then, and what is found so comes first.
    """
    import cv2

    grey = image if image.ndim == 2 else image.max(axis=2)
    found: list[StripeCenters] = []
    most_px = _NARROW_PX
    for _ in range(_WIDENINGS):
        across = (1, most_px) if options.axis == "columns" else (most_px, 1)
        wider = cv2.morphologyEx(grey, cv2.MORPH_OPEN, cv2.getStructuringElement(cv2.MORPH_RECT, across))
        looked = _found(np.ascontiguousarray(grey - wider, dtype=image.dtype), [options], None)
        if found and not any(_same_line(found[0], one) for one in looked):
            break  # what comes up then is the ground
        for one in looked:
            under = wider[np.rint(one.row_px).astype(int), np.rint(one.column_px).astype(int)]
            found.insert(0, replace(one, ground=under.astype(float)))
        needed_px = min(round(_WHOLE_WIDTHS * found[0].width_px) | 1, _WIDEST_PX) if found else 0
        if needed_px <= most_px:
            break
        most_px = needed_px
    return found


def _same_line(one: StripeCenters, other: StripeCenters) -> bool:
    """Return whether nearly all centres of one are there in another, and hardly any beside them."""
    (here, across), (there, beside) = (
        (s.column_px, s.row_px) if s.axis == "columns" else (s.row_px, s.column_px) for s in (one, other)
    )
    at = dict(zip(np.rint(there).astype(int).tolist(), beside.tolist(), strict=True))
    near = [abs(at.get(k, np.inf) - x) < _NEAR_PX for k, x in zip(np.rint(here).astype(int), across, strict=True)]
    return sum(near) > _SAME_LINE * max(len(here), len(there))


def _best_of(stripes: list[StripeCenters]) -> StripeCenters:
    """Return at each place the centre that is known best, of all channels; one that saturates is known badly."""
    columns = stripes[0].axis == "columns"
    whole = np.concatenate([s.column_px if columns else s.row_px for s in stripes])
    sigma = np.concatenate([s.sigma_px for s in stripes])
    grounds = [s.ground for s in stripes if s.ground is not None]
    levers = [s.lever_px for s in stripes if s.lever_px is not None]
    order = np.lexsort((sigma, whole))
    first = np.concatenate([[True], np.diff(whole[order]) > 0.5])
    chosen = order[first]
    joined = replace(
        min(stripes, key=lambda one: float(np.median(one.sigma_px))),
        column_px=np.concatenate([s.column_px for s in stripes]),
        row_px=np.concatenate([s.row_px for s in stripes]),
        sigma_px=sigma,
        amplitude=np.concatenate([s.amplitude for s in stripes]),
        ground=np.concatenate(grounds) if len(grounds) == len(stripes) else None,
        lever_px=np.concatenate(levers) if len(levers) == len(stripes) else None,
    )
    return joined.selected(chosen)
