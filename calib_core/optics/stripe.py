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
from calib_core.optics.stripe_view import Axis, Color, ImageArray, view_of

FloatArray = NDArray[np.float64]

_PHASES = 32
_USUAL_WIDTH_PX = 2.0
_SAMPLED_COLUMNS = 48
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
    """

    axis: Axis | None = None
    color: Color | None = None
    width_px: float | None = None
    saturation: float | None = None
    least_snr: float = 7.0
    rivalry: float = 0.6
    least_centers: int = 12


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
    """

    column_px: FloatArray
    row_px: FloatArray
    sigma_px: FloatArray
    amplitude: FloatArray
    axis: Axis
    width_px: float
    noise: float
    left_out: dict[str, int] = field(default_factory=dict)

    @property
    def pixels(self) -> FloatArray:
        """The centres as (N, 2): column, row."""
        return np.stack([self.column_px, self.row_px], axis=1)

    @property
    def across(self) -> FloatArray:
        """The unit direction (2,) of the error, in column and row."""
        return np.array([0.0, 1.0]) if self.axis == "columns" else np.array([1.0, 0.0])

    def selected(self, keep: NDArray[np.bool_]) -> "StripeCenters":
        """Return the centres of a mask (N,)."""
        return replace(
            self,
            column_px=self.column_px[keep],
            row_px=self.row_px[keep],
            sigma_px=self.sigma_px[keep],
            amplitude=self.amplitude[keep],
        )


@dataclass(frozen=True, eq=False)
class StripeFilters:
    """Filters of one peak width and noise ratio: what `kernels.stripe_frame` takes."""

    width_px: float
    short: NDArray[np.float32]
    whole: NDArray[np.float32]
    tables: NDArray[np.float32]
    figures: FloatArray
    energy: float
    mean_shape: float

    @property
    def taps(self) -> int:
        """How many rows the centring filter reaches over."""
        return int(self.tables.shape[2])

    @property
    def arrays(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], int, float, NDArray[np.float32], FloatArray]:
        """What the kernels take, in their order."""
        return self.short, self.whole, self.taps, self.width_px, self.tables, self.figures


def find_stripe(
    image: ImageArray,
    options: StripeOptions | None = None,
    *,
    axis: Axis | None = None,
    width_px: float | None = None,
    color: Color | None = None,
    dark: ImageArray | None = None,
) -> StripeCenters:
    """Find the laser stripe's centres in a frame.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) in the order red green blue, 8 or 16 bit
        With the stripe alone, or on a lit surface.
    options : StripeOptions, optional
    axis, width_px, color : optional
        Instead of those in `options`.
    dark : like image, optional
        The same view without the laser: taken off first.

    Raises
    ------
    InputError
        If the image is not of 8 or 16 bit or too small.
    MeasurementError
        If no stripe can be measured in it, with the reason.
    """
    chosen = options or StripeOptions()
    if axis or width_px or color:
        chosen = replace(
            chosen, axis=axis or chosen.axis, width_px=width_px or chosen.width_px, color=color or chosen.color
        )
    view = view_of(image, dark, chosen.axis, chosen.color, chosen.saturation)
    box = chosen.width_px or _USUAL_WIDTH_PX
    codes, found = _measure(view.image, view.saturation, chosen, box)
    for _ in range(3):
        if found.width_px <= 1.75 * box:
            break
        box = found.width_px  # the search box was too small for so wide a stripe
        codes, found = _measure(view.image, view.saturation, chosen, box)
    if len(found.column_px) < max(1, chosen.least_centers):
        raise _no_stripe(view.image, view.saturation, codes, chosen)
    if view.axis == "columns":
        return found
    return replace(found, column_px=found.row_px, row_px=found.column_px, axis="rows")


def _measure(
    image: ImageArray,
    saturation: float,
    options: StripeOptions,
    start_width: float,
) -> tuple[NDArray[np.uint8], StripeCenters]:
    """Find one centre per column; return each column's code and the good centres."""
    from calib_core.kernels import stripe_frame as kernel

    filters = filters_of(round(start_width, 2), 0.0)
    height, width = image.shape
    bits, word = (8, np.uint16) if image.dtype == np.uint8 else (16, np.uint32)
    words = (image if width % 2 == 0 else np.ascontiguousarray(image[:, :-1])).view(word)
    rows = max(3, min(round(1.5 * start_width), 60, height // 10))
    step = max(1, int(1.5 * start_width))
    variance, seeds, codes, columns, peaks = kernel.survey(
        image, words, bits, rows, step, options.rivalry, _SAMPLED_COLUMNS, *filters.arrays
    )
    hot = 6.0 * variance**0.5 + 0.02 * saturation
    if not options.width_px and len(columns):
        width_px = _peak_width(image, columns, peaks[0], start_width, hot)
        filters = filters_of(round(width_px, 2), 0.0)
        peaks = kernel.sample(image, columns, seeds[columns], variance, *filters.arrays)
    light, amplitude = kernel.noise_growth(peaks, variance, filters.taps, filters.mean_shape)
    filters = filters_of(filters.width_px, _noise_ratio(light * amplitude / variance))
    least = options.least_snr * (variance / filters.energy) ** 0.5
    limits = np.array([variance, light, hot, saturation, 3.0 * filters.width_px, least])
    centers, counts = kernel.measure(image, seeds, codes, *filters.arrays, limits)
    left_out = {reason: n for reason, n in zip(_REASONS[1:], counts[1:].tolist(), strict=True) if n}
    column, row, sigma, amplitudes = centers
    return codes, StripeCenters(
        column, row, sigma, amplitudes, "columns", filters.width_px, variance**0.5, left_out
    )


def _peak_width(
    image: ImageArray, columns: NDArray[np.int32], centers: FloatArray, start_width_px: float, hot: float
) -> float:
    """Return the width (px) of the peaks of some columns, laid over each other."""
    from calib_core.kernels import stripe as kernel

    reach = int(np.ceil(5.0 * start_width_px)) + 2
    sums, counts = kernel.stack_profile(image, columns, centers, 2, reach, hot)
    return _width_of(sums, counts, reach)


def _width_of(sums: FloatArray, counts: FloatArray, reach: int) -> float:
    """Return the standard deviation of the Gaussian that explains a stacked peak best."""
    widths, shapes = _shapes(reach, len(sums))
    total = counts.sum()
    if not total:
        return float(widths[0])
    weight = counts / total
    profile = sums / np.maximum(counts, 1.0)
    profile = profile - weight @ profile
    means = shapes @ weight
    spread = np.maximum((shapes**2) @ weight - means**2, 1e-30)
    scores = np.nan_to_num((shapes @ (weight * profile)) / np.sqrt(spread), nan=-np.inf)
    best = int(np.argmax(scores))
    if 0 < best < len(widths) - 1:
        low, mid, high = scores[best - 1 : best + 2].tolist()
        if low - 2 * mid + high < 0 and np.isfinite(low + high):
            return float(widths[best]) * 1.06 ** (0.5 * (low - high) / (low - 2 * mid + high))
    return float(widths[best])


@lru_cache(maxsize=16)
def _shapes(reach: int, size: int) -> tuple[FloatArray, FloatArray]:
    """Return candidate widths (K,) px and their Gaussian shapes (K, size) over ±reach."""
    widths = 0.5 * np.power(1.06, np.arange(0.0, 80.0)).astype(np.float64)
    widths = widths[widths < reach / 2]
    u = np.linspace(-reach, reach, size)
    return widths, np.exp(-0.5 * (u / widths[:, None]) ** 2)


def _noise_ratio(ratio: float) -> float:
    """Return a noise ratio rounded to few values, so that the filters of a series of frames are found again.

    Small ratios gain nothing; large ones make a centroid, which a sloping background pulls.
    """
    return min(16.0, 2.0 ** round(float(np.log2(ratio)))) if 0.4 <= ratio < np.inf else 0.0


@lru_cache(maxsize=64)
def filters_of(width_px: float, noise_ratio: float) -> StripeFilters:
    """Return the filters of a Gaussian peak: its standard deviation (px), and its light's noise beside the dark's.

    The centring filter is h = g′/(1 + ρ g), the maximum-likelihood position for variance a (1 + ρ g).
    """
    reach = 2.7 if noise_ratio == 0.0 else 3.2  # the filter that is nearly a centroid has longer arms
    half = int(np.ceil(reach * width_px)) + 1
    phase = np.linspace(-0.5, 0.5, _PHASES + 1)
    u = np.arange(-half, half + 1) - phase[:, None]
    g = np.exp(-0.5 * (u / width_px) ** 2)
    weight = 1.0 / (1.0 + noise_ratio * g)
    h = u * g * weight
    slope = -g * weight * (1.0 - (u / width_px) ** 2 * weight)
    energy = ((g - g.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
    figures = np.stack(
        [g.sum(axis=1), energy, (h**2).sum(axis=1), (h**2 * g).sum(axis=1), -(slope * g).sum(axis=1)], axis=1
    )
    middle = _PHASES // 2  # the centre on a whole row
    turn = u[middle] / width_px**2
    whole = np.stack([h[middle], slope[middle], g[middle], turn * g[middle], (turn**2 - width_px**-2) * g[middle]])
    inner = min(half - 1, int(1.5 * width_px)) | 1  # odd: padded by one zero, its middle is easy to tell
    return StripeFilters(
        width_px,
        _padded(h[middle : middle + 1, half - inner : half + inner + 1]),
        _padded(whole if noise_ratio else whole[:3]),
        np.stack([h, slope, g]).astype(np.float32),
        figures,
        float(energy.mean()),
        float(g.mean()),
    )


def _padded(filters: FloatArray) -> NDArray[np.float32]:
    """Return filters (F, taps) with zeros after their taps up to a multiple of four."""
    return np.pad(filters, ((0, 0), (0, -filters.shape[1] % 4))).astype(np.float32)


def _no_stripe(
    image: ImageArray,
    saturation: float,
    codes: NDArray[np.uint8],
    options: StripeOptions,
) -> MeasurementError:
    """Return the error that says why no stripe was measured."""
    from calib_core.kernels import stripe as kernel

    need = f"a laser stripe with at least {options.least_centers} clean peaks"
    if int(image.max()) == int(image.min()):
        return MeasurementError(
            need, f"a blank frame (every pixel is {int(image.max())})", "Check that laser and exposure are on."
        )
    counts = np.bincount(codes, minlength=len(_REASONS))
    if float(np.mean(image >= saturation)) > 0.3 or counts[kernel.SATURATED] > counts.sum() / 4:
        return MeasurementError(
            need, "a frame that is saturated", "Shorten the exposure or dim the laser or the lamps."
        )
    advice = {
        kernel.DOUBLE: ("two peaks of like brightness in most columns", "Shade reflections and other lasers."),
        kernel.SHAPE: ("peaks that are irregular or too wide", "Focus the camera and dim the room."),
        kernel.ALONE: ("scattered bright pixels that form no line", "Check that the stripe is in view."),
        kernel.WEAK: ("no peak that stands out of the noise", "Lengthen the exposure or dim the room."),
    }
    worst = max(advice, key=lambda code: int(counts[code]))
    return MeasurementError(need, *advice[worst])
