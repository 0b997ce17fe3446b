"""A frame's stripe looked for in several ways, where the first one met no plain line on the board."""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.errors import MeasurementError
from calib_core.optics.stripe import StripeCenters, StripeOptions, find_stripe
from calib_core.optics.stripe_view import Axis, Color, ImageArray

_AXES: tuple[Axis, ...] = ("columns", "rows")
_COLORS: tuple[Color, ...] = ("red", "green", "blue")
_FAINT_SNR, _RIVALRY = 4.0, 0.98
_NARROW_PX, _WIDEST_PX = 15, 61
_WHOLE_WIDTHS, _WIDENINGS = 6.0, 3
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
