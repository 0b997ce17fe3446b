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
_NOISE_SAMPLES = 512
_QUANTISATION_VARIANCE = 1 / 12
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
class _Filters:
    """Tabulated filters of one peak width and noise ratio: what `kernels.stripe.measure_columns` takes."""

    tables: NDArray[np.float32]
    figures: FloatArray
    energy: float
    mean_shape: float

    @property
    def taps(self) -> int:
        return int(self.tables.shape[2])


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
    from calib_core.kernels import stripe as kernel

    variance = _surroundings_variance(image)
    seeds, codes = _seeds(image, start_width, variance, options)
    columns = np.arange(image.shape[1])
    good = np.flatnonzero(codes == kernel.OK)
    width, rows = start_width, np.empty((image.shape[1], 5))
    if len(good):
        sample = good[:: max(1, len(good) // _SAMPLED_COLUMNS)]
        look = _Look(image, variance, saturation, options)
        width, light, amplitude = _peak_shape(look, sample, seeds[sample], start_width)
        filters = _filters(round(width, 2), _noise_ratio(light * amplitude / variance))
        rows = look.measure(columns, seeds, codes, filters, light, width)
    counts = kernel.mark_alone(rows[:, 0], codes, 5, 3).tolist()
    left_out = {reason: n for reason, n in zip(_REASONS[1:], counts[1:], strict=True) if n}
    good = np.flatnonzero(codes == kernel.OK)
    kept = rows[good].T.copy()
    return codes, StripeCenters(
        good.astype(float), kept[0], kept[1], kept[2], "columns", width, variance**0.5, left_out
    )


def _seeds(
    image: ImageArray, width_px: float, variance: float, options: StripeOptions
) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    """Return each column's row to start from, (W,), and its code, (W,)."""
    from calib_core.kernels import stripe as kernel

    height, width = image.shape
    bits = 8 * image.dtype.itemsize
    word = np.uint16 if bits == 8 else np.uint32
    words = (image if width % 2 == 0 else np.ascontiguousarray(image[:, :-1])).view(word)
    rows = max(3, min(round(1.5 * width_px), 60, height // 10))
    band = max(32, 2 * rows)
    bands = -(-height // (2 * band))
    ring = np.empty((2 * rows + 3, words.shape[1]), dtype=word)
    best = np.empty((bands, words.shape[1]), dtype=word)
    place = np.empty((bands, words.shape[1]), dtype=np.uint16)
    kernel.seed_columns(words, bits, rows, band, ring, best, place)
    least_rise = 4.0 * float(np.sqrt(4.0 * rows * variance))
    return kernel.choose_seeds(best, place, least_rise, 2 * rows + 1, options.rivalry, 5, width)


@dataclass(frozen=True, eq=False)
class _Look:
    """An image with what is known of its noise."""

    image: ImageArray
    variance: float
    saturation: float
    options: StripeOptions

    @property
    def hot(self) -> float:
        """By how much a hot pixel stands out of its neighbours, grey values."""
        return 6.0 * float(np.sqrt(self.variance)) + 0.02 * self.saturation

    def measure(
        self,
        columns: NDArray[np.int64],
        seeds: NDArray[np.int64],
        codes: NDArray[np.uint8],
        filters: _Filters,
        light: float,
        width_px: float,
        first_look: bool = False,
    ) -> FloatArray:
        """Return the rows (N, 5) of `kernels.stripe.measure_columns`, which writes to `codes` too."""
        from calib_core.kernels import stripe as kernel

        least = self.options.least_snr * float(np.sqrt(self.variance / filters.energy))
        saturated = 1e9 if first_look else 3.0 * width_px
        limits = np.array(
            [self.variance, light, self.hot, self.saturation, saturated, least, 1.0 if first_look else 0.0]
        )
        out = np.empty((len(columns), 5))
        kernel.measure_columns(self.image, columns, seeds, filters.tables, filters.figures, limits, out, codes)
        return out


def _peak_shape(
    look: _Look, columns: NDArray[np.int64], seeds: NDArray[np.int64], start_width_px: float
) -> tuple[float, float, float]:
    """Return the peak's width (px), the noise's growth with the light (grey), and the usual amplitude."""
    from calib_core.kernels import stripe as kernel

    width = start_width_px
    filters = _filters(round(width, 2), 0.0)
    rows = look.measure(columns, seeds, np.zeros(len(seeds), np.uint8), filters, 0.0, width, first_look=True)
    if not look.options.width_px:
        reach = int(np.ceil(5.0 * width)) + 2
        sums, counts = kernel.stack_profile(look.image, columns, rows[:, 0], 2, reach, look.hot)
        width = _width_of(sums, counts, reach)
        filters = _filters(round(width, 2), 0.0)
        rows = look.measure(columns, seeds, np.zeros(len(seeds), np.uint8), filters, 0.0, width, first_look=True)
    fine = np.isfinite(rows[:, 0])
    fine[fine] = rows[fine, 2] > 0
    if not fine.any():
        return width, 0.0, 1.0
    excess = rows[fine, 3] / (filters.taps - 3) - look.variance
    light = float(np.median(excess / rows[fine, 2])) / filters.mean_shape
    return width, max(0.0, light), float(np.median(rows[fine, 2]))


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
    scores = (shapes @ (weight * profile)) / np.sqrt((shapes**2) @ weight - means**2)
    best = int(np.argmax(scores))
    if 0 < best < len(widths) - 1:
        low, mid, high = scores[best - 1 : best + 2].tolist()
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
    return 0.0 if ratio < 0.4 else min(16.0, 2.0 ** round(float(np.log2(ratio))))


@lru_cache(maxsize=64)
def _filters(width_px: float, noise_ratio: float) -> _Filters:
    reach = 2.7 if noise_ratio == 0.0 else 3.2  # the filter that is nearly a centroid has longer arms
    half = int(np.ceil(reach * width_px)) + 1
    phase = np.linspace(-0.5, 0.5, _PHASES + 1)
    u = np.arange(-half, half + 1) - phase[:, None]
    g = np.exp(-0.5 * (u / width_px) ** 2)
    weight = 1.0 / (1.0 + noise_ratio * g)
    h = u * g * weight
    slope = -g * weight * (1.0 - (u / width_px) ** 2 * weight)
    energy = ((g - g.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
    figures = [g.sum(axis=1), energy, (h**2).sum(axis=1), (h**2 * g).sum(axis=1), -(slope * g).sum(axis=1)]
    return _Filters(
        np.stack([h, slope, g]).astype(np.float32),
        np.ascontiguousarray(np.stack(figures, axis=1)),
        float(energy.mean()),
        float(g.mean()),
    )


def _surroundings_variance(image: ImageArray) -> float:
    """Return the variance of the grey values where nothing is seen, from neighbouring pixels' differences."""
    from calib_core.kernels import stripe as kernel

    differences = np.abs(kernel.neighbour_differences(image, _NOISE_SAMPLES))
    limit = 4.5 * max(0.5, float(np.partition(differences, _NOISE_SAMPLES // 2)[_NOISE_SAMPLES // 2]))
    usual = differences[differences <= limit]
    return float(usual @ usual / len(usual)) / 2 + _QUANTISATION_VARIANCE


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
