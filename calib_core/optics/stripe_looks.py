"""A frame's stripe looked for in several ways, where the first one met no plain line on the board."""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.errors import MeasurementError
from calib_core.optics.stripe import StripeCenters, StripeOptions, find_stripe
from calib_core.optics.stripe_view import Axis, Color, ImageArray

_AXES: tuple[Axis, ...] = ("columns", "rows")
_COLORS: tuple[Color, ...] = ("red", "green", "blue")
_FAINT_SNR, _RIVALRY = 4.0, 0.98
_NARROW_PX = 15


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
            found += _found(_narrow_alone(image, axis), [replace(options, flanks=False)], None)
    return StripeLooks(tuple(found))


def _found(image: ImageArray, ways: list[StripeOptions], dark: ImageArray | None) -> list[StripeCenters]:
    found: list[StripeCenters] = []
    for options in ways:
        try:
            found.append(find_stripe(image, options, dark=dark))
        except MeasurementError:
            continue
    return found


def _narrow_alone(image: ImageArray, axis: Axis) -> ImageArray:
    """Return a frame without what is wider across the stripe than a line: faint ones stand out of the squares."""
    import cv2

    grey = image if image.ndim == 2 else image.max(axis=2)
    across = (1, _NARROW_PX) if axis == "columns" else (_NARROW_PX, 1)
    wide = cv2.morphologyEx(grey, cv2.MORPH_OPEN, cv2.getStructuringElement(cv2.MORPH_RECT, across))
    return np.ascontiguousarray(grey - wide, dtype=image.dtype)


def _best_of(stripes: list[StripeCenters]) -> StripeCenters:
    """Return at each place the centre that is known best, of all channels; one that saturates is known badly."""
    columns = stripes[0].axis == "columns"
    whole = np.concatenate([s.column_px if columns else s.row_px for s in stripes])
    sigma = np.concatenate([s.sigma_px for s in stripes])
    order = np.lexsort((sigma, whole))
    first = np.concatenate([[True], np.diff(whole[order]) > 0.5])
    chosen = order[first]
    joined = replace(
        min(stripes, key=lambda one: float(np.median(one.sigma_px))),
        column_px=np.concatenate([s.column_px for s in stripes]),
        row_px=np.concatenate([s.row_px for s in stripes]),
        sigma_px=sigma,
        amplitude=np.concatenate([s.amplitude for s in stripes]),
    )
    return replace(
        joined,
        column_px=joined.column_px[chosen],
        row_px=joined.row_px[chosen],
        sigma_px=joined.sigma_px[chosen],
        amplitude=joined.amplitude[chosen],
    )
