"""The laser stripe in a frame: sub-pixel centres per column or row, each with its standard deviation.

A box search finds where each column is brightest.  The centre is the zero of the response of a filter h(u), u
being the distance from the centre: for even noise the derivative of the peak's Gaussian shape g, which gives its
maximum-likelihood position; where noise grows with the light, h = g′/(1 + ρ g), the same for that noise.  Width
and noise come from the frame itself.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.messages import message
from calib_core.optics.stripe_flanks import flank_centers
from calib_core.optics.stripe_narrow import NARROW_PX, narrow_sigmas
from calib_core.optics.stripe_view import Axis, Color, ImageArray, StripeView, view_of

_USUAL_WIDTH_PX = 2.0
_REASONS: tuple[str, ...] = ("used", "weak", "saturated", "double", "irregular", "isolated")


@dataclass(frozen=True)
class StripeOptions:
    """How the stripe is looked for; everything may be left to the frame.

    Parameters
    ----------
    axis : {"columns", "rows"} or None
        One centre per column (the stripe runs left to right) or per row; None: as it runs.
    color : {"grey", "red", "green", "blue"} or None
        The line's colour in a colour frame; None: the channel in which it stands out most.
    width_px : float or None
        The peak's standard deviation; None: estimated.
    saturation : float or None
        Grey value of a saturated pixel; None: the largest of the frame's type.
    least_snr : float
        Peaks weaker than this many standard deviations of their amplitude are left out.
    rivalry : float
        A column is double where a second peak rises above this fraction of the first.
    least_centers : int
        Fewer centres than this are no stripe.
    flanks : bool
        Whether saturated columns are measured by their flanks, instead of being left out.
    """

    axis: Axis | None = None
    color: Color | None = None
    width_px: float | None = None
    saturation: float | None = None
    least_snr: float = 7.0
    rivalry: float = 0.6
    least_centers: int = 12
    flanks: bool = False


_USUAL = StripeOptions()


@dataclass(frozen=True, eq=False)
class StripeCenters:
    """Where the stripe's middle is.

    Parameters
    ----------
    column_px, row_px : (N,)
        Pixel coordinates, (0, 0) at the middle of the top-left pixel.  One of the two is a whole number.
    sigma_px : (N,)
        Standard deviation across: of the row for axis "columns", of the column for axis "rows".
    amplitude : (N,)
        Grey values above the surroundings.
    axis : {"columns", "rows"}
    width_px : float
        Standard deviation of the peak's shape.
    noise : float
        Standard deviation of the dark surroundings' grey values.
    left_out : dict
        How many columns (rows) were left out, by reason: weak, saturated, double, irregular, isolated.
    ground, lever_px : (N,), or None where they are not known
        Grey value of the surroundings, and by how much surroundings that rise by one a pixel draw a centre.
    together : int
        Of how many columns (rows) beside each other a centre is.
    blind_px : float
        How near to a square's edge nothing was looked at.
    """

    column_px: FloatArray
    row_px: FloatArray
    sigma_px: FloatArray
    amplitude: FloatArray
    axis: Axis
    width_px: float
    noise: float
    left_out: dict[str, int] = field(default_factory=dict)
    ground: FloatArray | None = None
    lever_px: FloatArray | None = None
    together: int = 1
    blind_px: float = 0.0

    @property
    def pixels(self) -> FloatArray:
        """The centres as (N, 2): column, row."""
        return np.stack([self.column_px, self.row_px], axis=1)

    @property
    def across(self) -> FloatArray:
        """The unit direction (2,) of the error, in column and row."""
        return np.array([0.0, 1.0]) if self.axis == "columns" else np.array([1.0, 0.0])

    def selected(self, keep: NDArray[np.bool_] | NDArray[np.int64]) -> "StripeCenters":
        """Return the centres of a mask (N,), or at places."""
        return replace(
            self,
            column_px=self.column_px[keep],
            row_px=self.row_px[keep],
            sigma_px=self.sigma_px[keep],
            amplitude=self.amplitude[keep],
            ground=None if self.ground is None else self.ground[keep],
            lever_px=None if self.lever_px is None else self.lever_px[keep],
        )

    def shifted(self, across_px: FloatArray) -> "StripeCenters":
        """Return the centres moved across the stripe by (N,) px."""
        if self.axis == "columns":
            return replace(self, row_px=self.row_px + across_px)
        return replace(self, column_px=self.column_px + across_px)


def find_stripe(
    image: ImageArray, options: StripeOptions | None = None, *, dark: ImageArray | None = None
) -> StripeCenters:
    """Find the laser stripe's centres in a frame.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) in the order red green blue, 8 or 16 bit
        With the stripe alone, or on a lit surface.
    options : StripeOptions, optional
    dark : like image, optional
        The same view without the laser: taken off first.

    Raises
    ------
    InputError
        If the image is not of 8 or 16 bit or too small.
    MeasurementError
        If no stripe can be measured in it, with the reason.
    """
    chosen = options or _USUAL
    given_px = chosen.width_px or 0.0
    view = view_of(image, dark, chosen.axis, chosen.color, chosen.saturation)
    box = given_px or _USUAL_WIDTH_PX
    codes, found = _measure(view, chosen, given_px, box)
    for _ in range(3):
        if found.width_px <= 1.75 * box:
            break
        box = found.width_px  # the search box was too small for so wide a stripe
        codes, found = _measure(view, chosen, given_px, box)
    if chosen.flanks:
        found = _with_flanks(found, view.image, view.saturation)
    if len(found.column_px) < max(1, chosen.least_centers):
        raise _no_stripe(view.image, view.saturation, codes, chosen)
    if view.axis == "columns":
        return found
    return replace(found, column_px=found.row_px, row_px=found.column_px, axis="rows")


def _measure(
    view: StripeView, options: StripeOptions, width_px: float, box_width_px: float
) -> tuple[NDArray[np.uint8], StripeCenters]:
    """Find one centre per column; return each column's code and the good centres."""
    from calib_core.kernels.stripe_frame import find

    image, width = view.image, view.image.shape[1]
    word = np.uint16 if image.itemsize == 1 else np.uint32
    words = (image if width % 2 == 0 else np.ascontiguousarray(image[:, :-1])).view(word)
    codes, centers = np.empty(width, np.uint8), np.empty((6, width))
    width_px, variance, counts = find(
        image, words, box_width_px, width_px, view.saturation, options.least_snr, options.rivalry,
        *_shapes(box_width_px), codes, centers,
    )  # fmt: skip
    n = counts[0]
    if n and width_px < NARROW_PX:
        centers[2, :n] = narrow_sigmas(image, centers[0, :n], centers[1, :n], width_px, variance)
    left_out = (
        {_REASONS[code]: counts[code] for code in range(1, len(_REASONS)) if counts[code]} if n < width else {}
    )
    return codes, StripeCenters(
        centers[0, :n],
        centers[1, :n],
        centers[2, :n],
        centers[3, :n],
        "columns",
        width_px,
        variance**0.5,
        left_out,
        centers[4, :n] - view.zero,
        centers[5, :n],
    )


def _with_flanks(found: StripeCenters, image: ImageArray, saturation: float) -> StripeCenters:
    """Return the centres with those of saturated columns, which their flanks tell."""
    columns, rows, sigma, width_px = flank_centers(image, saturation, found.noise)
    new = ~np.isin(columns, found.column_px)
    if not new.any() or found.ground is None or found.lever_px is None:
        return found
    none = np.zeros(int(new.sum()))
    order = np.argsort(np.concatenate([found.column_px, columns[new]]), kind="stable")
    mostly = int(new.sum()) > len(found.column_px)
    return replace(
        found,
        column_px=np.concatenate([found.column_px, columns[new].astype(float)])[order],
        row_px=np.concatenate([found.row_px, rows[new]])[order],
        sigma_px=np.concatenate([found.sigma_px, sigma[new]])[order],
        amplitude=np.concatenate([found.amplitude, np.full(int(new.sum()), saturation)])[order],
        ground=np.concatenate([found.ground, none])[order],
        lever_px=np.concatenate([found.lever_px, none])[order],
        width_px=width_px if mostly else found.width_px,
    )


@lru_cache(maxsize=16)
def _shapes(box_width_px: float) -> tuple[FloatArray, FloatArray]:
    """Return candidate widths (K,) px and their Gaussian shapes (K, size), see `stripe_width.peak_width`."""
    from calib_core.kernels.stripe_width import BINS_PER_PX

    reach = int(np.ceil(5.0 * box_width_px)) + 2
    widths = 0.5 * np.power(1.06, np.arange(0.0, 80.0)).astype(np.float64)
    widths = widths[widths < reach / 2]
    u = np.linspace(-reach, reach, 2 * reach * BINS_PER_PX + 1)
    return widths, np.exp(-0.5 * (u / widths[:, None]) ** 2)


def _no_stripe(
    image: ImageArray, saturation: float, codes: NDArray[np.uint8], options: StripeOptions
) -> MeasurementError:
    """Return the error that says why no stripe was measured."""
    from calib_core.kernels import stripe as kernel

    need = message("a laser stripe with at least {least_centers} clean peaks", least_centers=options.least_centers)
    if int(image.min()) >= saturation:
        to_do = "Shorten the exposure or dim the laser or the lamps."
        return MeasurementError(need, "a saturated frame, white all over", to_do)
    if int(image.max()) == int(image.min()):
        to_do = "Check that laser and exposure are on."
        return MeasurementError(need, "a blank frame (every pixel is {image})", to_do, image=int(image.max()))
    counts = np.bincount(codes, minlength=len(_REASONS))
    if float(np.mean(image >= saturation)) > 0.3 or counts[kernel.SATURATED] > counts.sum() / 4:
        to_do = "Shorten the exposure or dim the laser or the lamps."
        return MeasurementError(need, "a frame that is saturated", to_do)
    advice = {
        kernel.DOUBLE: ("two peaks of like brightness in most columns", "Shade reflections and other lasers."),
        kernel.SHAPE: ("peaks that are irregular or too wide", "Focus the camera and dim the room."),
        kernel.ALONE: ("scattered bright pixels that form no line", "Check that the stripe is in view."),
        kernel.WEAK: ("no peak that stands out of the noise", "Lengthen the exposure or dim the room."),
    }
    worst = max(advice, key=lambda code: int(counts[code]))
    return MeasurementError(need, *advice[worst])
