"""Stripe centres: as exact as the noise allows, and nothing where there is no clean stripe."""

import numpy as np
import pytest

from calib_core.errors import InputError, MeasurementError
from calib_core.optics.stripe import StripeCenters, StripeOptions, find_stripe

HEIGHT, WIDTH = 1024, 1280


def curve(width: int = WIDTH) -> np.ndarray:
    x = np.arange(width)
    return 500 + 60 * np.sin(x / 200) + 0.05 * x


def light(
    center: np.ndarray, amplitude: float = 140.0, width_px: float = 2.0, dark: float = 10.0, height: int = HEIGHT
) -> np.ndarray:
    rows = np.arange(height)[:, None]
    return dark + amplitude * np.exp(-0.5 * ((rows - center) / width_px) ** 2)


def frame(mean: np.ndarray, seed: int, read_noise: float = 4.0, gain: float = 0.0, hot: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    image = mean + rng.standard_normal(mean.shape) * np.sqrt(read_noise**2 + gain * mean)
    if hot:
        rows, columns = rng.integers(0, mean.shape[0], hot), rng.integers(0, mean.shape[1], hot)
        image[rows, columns] += rng.uniform(60, 250, hot)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def bound(center: np.ndarray, amplitude: float, width_px: float, read_noise: float, gain: float) -> np.ndarray:
    """The Cramér–Rao bound of each column: 1/σ² = Σ (∂I/∂c)² / (read² + gain I + 1/12)."""
    u = np.arange(HEIGHT)[:, None] - center
    peak = amplitude * np.exp(-0.5 * (u / width_px) ** 2)
    variance = read_noise**2 + gain * (peak + 10.0) + 1 / 12
    return 1 / np.sqrt(((peak * u / width_px**2) ** 2 / variance).sum(axis=0))


def errors(found: StripeCenters, center: np.ndarray) -> np.ndarray:
    return found.row_px - center[found.column_px.astype(int)]


@pytest.mark.parametrize(
    ("amplitude", "width_px", "read_noise", "gain"),
    [(140, 2.0, 4.0, 0.0), (140, 2.0, 0.5, 0.025), (140, 3.5, 4.0, 0.0), (60, 2.0, 2.0, 0.0)],
)
def test_centres_reach_the_bound_despite_hot_pixels(
    amplitude: float, width_px: float, read_noise: float, gain: float
) -> None:
    center = curve()
    ratios, gross, count = [], 0, 0
    for seed in range(4):
        found = find_stripe(frame(light(center, amplitude, width_px), seed, read_noise, gain, hot=300))
        limit = bound(center, amplitude, width_px, read_noise, gain)[found.column_px.astype(int)]
        ratio = errors(found, center) / limit
        gross += int((np.abs(ratio) > 6).sum())
        count += len(ratio)
        ratios.append(ratio[np.abs(ratio) <= 6])
    assert count > 0.995 * 4 * WIDTH
    assert gross < 0.001 * count
    # 5100 columns: the RMS itself is known to 1 %, so that 1.05 leaves the estimator 4 %.
    assert np.sqrt(np.mean(np.concatenate(ratios) ** 2)) <= 1.05


def test_stated_sigmas_are_true() -> None:
    center = curve()
    for read_noise, gain in ((4.0, 0.0), (1.0, 0.04)):
        found = find_stripe(frame(light(center), 3, read_noise, gain))
        normed = errors(found, center) / found.sigma_px
        assert 0.9 < np.sqrt(np.mean(normed**2)) < 1.1


@pytest.mark.parametrize("width_px", [0.85, 0.95, 2.0, 6.0])
def test_narrow_and_wide_peaks_state_true_sigmas(width_px: float) -> None:
    center = curve()
    found = find_stripe(frame(light(center, width_px=width_px), 4))
    assert len(found.row_px) > 0.99 * WIDTH
    assert 0.9 < np.sqrt(np.mean((errors(found, center) / found.sigma_px) ** 2)) < 1.1


@pytest.mark.parametrize(("width_px", "read_noise", "gain"), [(0.95, 4.0, 0.0), (2.0, 1.0, 0.0), (3.0, 2.0, 0.5)])
def test_all_columns_at_once_and_one_by_one_agree(width_px: float, read_noise: float, gain: float) -> None:
    from calib_core.kernels.stripe import Limits, measure_columns
    from calib_core.kernels.stripe_filters import filters_of
    from calib_core.kernels.stripe_peaks import measure_peaks

    center = curve()
    image = frame(light(center, width_px=width_px), 6, read_noise, gain)
    filters = filters_of(width_px, 1.0 if gain else 0.0)
    columns, seeds = np.arange(WIDTH, dtype=np.int32), np.rint(center + 1.2).astype(np.int32)
    variance = read_noise**2 + gain * 10.0 + 1 / 12
    limits = Limits(variance, gain, 1e9, 255.0, 100.0, 0.0)
    at_once, clean = measure_peaks(image, columns, seeds, np.ones(WIDTH, bool), filters, limits)
    singly, codes = np.full((5, WIDTH), np.nan), np.zeros(WIDTH, np.uint8)
    measure_columns(image, columns, seeds, np.zeros(WIDTH, bool), filters, limits, singly, codes)
    assert clean.mean() > 0.95
    # Both look for the same zero: one by steps of filters, the other by interpolation between rows.
    apart = (at_once[0] - singly[0])[clean] / singly[1, clean]
    assert np.abs(apart).max() < 0.3
    assert np.sqrt(np.mean(apart**2)) < 0.08
    np.testing.assert_allclose(at_once[1, clean], singly[1, clean], rtol=0.02)
    np.testing.assert_allclose(at_once[2, clean], singly[2, clean], rtol=0.03)


def test_rows_are_columns_turned() -> None:
    center = curve()
    image = frame(light(center), 1)
    found, turned = find_stripe(image), find_stripe(np.ascontiguousarray(image.T))
    assert (found.axis, turned.axis) == ("columns", "rows")
    np.testing.assert_array_equal(found.column_px, turned.row_px)
    np.testing.assert_array_equal(found.row_px, turned.column_px)
    np.testing.assert_array_equal(turned.across, [1, 0])


@pytest.mark.parametrize("lit", [False, True])
@pytest.mark.parametrize("stripe", [0.0, 90.0])
def test_a_clear_direction_is_the_stripes_own(stripe: float, lit: bool) -> None:
    from calib_core.kernels.stripe_axis import COLUMNS, ROWS, UNCLEAR, clear_direction

    rows, columns = np.arange(HEIGHT)[:, None], np.arange(WIDTH)
    mean = light(curve(), stripe) + (60.0 * ((rows // 90 + columns // 90) % 2) if lit else 0.0)
    image = frame(mean, 7, 2.0, hot=300)
    found = clear_direction(image), clear_direction(np.ascontiguousarray(image.T))
    assert found == ((COLUMNS, ROWS) if stripe else (UNCLEAR, UNCLEAR))


def test_a_slanting_stripe_has_no_clear_direction() -> None:
    from calib_core.kernels.stripe_axis import UNCLEAR, clear_direction

    assert clear_direction(frame(light(0.8 * np.arange(WIDTH)), 1)) == UNCLEAR


@pytest.mark.parametrize("level", [255, 65535])
def test_the_middling_difference_is_the_sorted_ones(level: int) -> None:
    from calib_core.kernels.stripe_noise import middling

    rng = np.random.default_rng(8)
    for size in (1, 2, 7, 512):
        values = rng.integers(0, level + 1, size).astype(np.int32)
        assert middling(values) == np.sort(values)[size // 2]


def test_sixteen_bits_give_the_same_centres() -> None:
    mean = light(curve())
    noise = 4.0 * np.random.default_rng(5).standard_normal(mean.shape)
    eight = np.clip(np.rint(mean + noise), 0, 255).astype(np.uint8)
    sixteen = np.clip(np.rint(257 * (mean + noise)), 0, 65535).astype(np.uint16)
    one, other = find_stripe(eight), find_stripe(sixteen)
    np.testing.assert_array_equal(one.column_px, other.column_px)
    # They differ by the eight bits' rounding, σ² = 1/12 beside 16: a fourteenth of the noise.
    assert np.std(one.row_px - other.row_px) < 0.15 * np.median(one.sigma_px)


def test_moderate_saturation_keeps_centres_and_gross_saturation_is_left_out() -> None:
    center = curve()
    bright = find_stripe(frame(light(center, 400.0), 2))
    assert len(bright.row_px) > 0.99 * WIDTH
    assert np.sqrt(np.mean(errors(bright, center) ** 2)) < 0.05
    with pytest.raises(MeasurementError, match="saturated"):
        find_stripe(np.full((200, 300), 255, np.uint8) - (np.arange(300) == 5).astype(np.uint8))


@pytest.mark.parametrize("clear", [0, 40, 240])
def test_flanks_tell_the_centres_of_saturated_columns_and_the_width_where_most_are(clear: int) -> None:
    center = curve(320)
    amplitude = np.where(np.arange(320) < clear, 140.0, 1500.0)
    image = frame(light(center, 1.0, 3.0, 0.0) * amplitude + 10.0, 2)
    found = find_stripe(image, StripeOptions(flanks=True, width_px=3.0))
    np.testing.assert_array_equal(found.column_px, np.arange(320))
    assert np.sqrt(np.mean(errors(found, center) ** 2)) < 0.08
    # A stripe of 1500 over 10 is at half of what is left to 255 so far from its middle:
    half_px = 3.0 * np.sqrt(2 * np.log(1500 / (0.5 * 245)))
    told_px = 3.0 if clear > 160 else half_px / np.sqrt(2 * np.log(2))
    assert found.width_px == pytest.approx(told_px, rel=0.02)


def test_a_double_stripe_is_not_guessed_and_a_reflection_gives_way() -> None:
    center = curve()
    mean = light(center) + light(center + 120, 130.0, dark=0.0)
    with pytest.raises(MeasurementError, match="two peaks"):
        find_stripe(frame(mean, 1))
    part = np.where(np.arange(WIDTH) % 40 < 10, 130.0, 0.0)
    mean = light(center) + part * np.exp(-0.5 * ((np.arange(HEIGHT)[:, None] - center - 120) / 2) ** 2)
    found = find_stripe(frame(mean, 1))
    assert np.abs(errors(found, center)).max() < 1.0
    assert len(found.row_px) > 0.7 * WIDTH


def test_a_step_in_the_stripe_is_kept_and_an_empty_part_stays_empty() -> None:
    center = np.where(np.arange(WIDTH) < 600, 300.0, 650.3)
    mean = light(center)
    mean[:, 900:1000] = 10.0
    found = find_stripe(frame(mean, 1, hot=300))
    assert np.abs(errors(found, center)).max() < 0.5
    assert not np.isin(np.arange(902, 998), found.column_px).any()
    assert len(found.row_px) > 0.99 * (WIDTH - 100)


def test_a_wide_stripe_is_measured_with_its_own_width() -> None:
    center = curve()
    found = find_stripe(frame(light(center, 140, 9.0), 1))
    limit = bound(center, 140, 9.0, 4.0, 0.0)[found.column_px.astype(int)]
    assert found.width_px == pytest.approx(9.0, rel=0.05)
    assert np.sqrt(np.mean((errors(found, center) / limit) ** 2)) < 1.1


def test_a_lit_board_does_not_draw_the_stripe() -> None:
    center = curve()
    rows, columns = np.arange(HEIGHT)[:, None], np.arange(WIDTH)
    board = 60.0 * ((rows // 90 + columns // 90) % 2)
    mean = light(center, 90.0, dark=20.0) + board
    found = find_stripe(frame(mean, 1, read_noise=2.0))
    away = np.abs(center[found.column_px.astype(int)] % 90 - 45) < 35  # not at a square's edge
    assert len(found.row_px) > 0.8 * WIDTH
    assert np.sqrt(np.mean(errors(found, center)[away] ** 2)) < 0.05
    difference = find_stripe(frame(mean, 2, 2.0), dark=frame(mean - light(center, 90.0, dark=0.0), 3, 2.0))
    assert len(difference.row_px) > 0.99 * WIDTH
    # Two frames' noise: σ = 2√2 on 90 grey values.
    assert np.sqrt(np.mean(errors(difference, center) ** 2)) < 1.1 * np.median(
        bound(center, 90, 2.0, 2 * np.sqrt(2), 0.0)
    )


def test_a_coloured_line_is_found_in_its_channel() -> None:
    center = curve()
    room = 90.0 + 60.0 * ((np.arange(HEIGHT)[:, None] // 90 + np.arange(WIDTH) // 90) % 2)
    grey = np.repeat(room[..., None], 3, axis=2)
    grey[..., 1] += light(center, 90.0, dark=0.0)
    found = find_stripe(frame(grey, 4, 2.0))
    assert len(found.row_px) > 0.95 * WIDTH
    assert np.sqrt(np.mean(errors(found, center) ** 2)) < 0.08
    given = find_stripe(frame(grey, 4, 2.0), StripeOptions(color="green", axis="columns"))
    np.testing.assert_array_equal(given.row_px, found.row_px)


def test_a_coloured_line_with_a_saturated_core_is_not_hollow() -> None:
    """Where green is saturated, the light that spills into red makes green less red smallest in the middle."""
    center = curve()
    room = 70.0 + 50.0 * ((np.arange(HEIGHT)[:, None] // 90 + np.arange(WIDTH) // 90) % 2)
    grey = np.repeat(room[..., None], 3, axis=2)
    laser = light(center, 400.0, dark=0.0)
    grey += laser[..., None] * np.array([0.45, 1.0, 0.45])
    found = find_stripe(frame(grey, 5, 2.0))
    assert len(found.row_px) > 0.8 * WIDTH
    assert np.sqrt(np.mean(errors(found, center) ** 2)) < 0.25


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.full((200, 300), 7, np.uint8), "blank"),
        (np.random.default_rng(0).integers(0, 30, (200, 300)).astype(np.uint8), "need a laser stripe"),
    ],
)
def test_frames_without_a_stripe_say_so(image: np.ndarray, words: str) -> None:
    with pytest.raises(MeasurementError, match=words):
        find_stripe(image)


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.zeros((200, 300)), "8 or 16 bit"),
        (np.zeros((10, 300), np.uint8), "at least 32"),
        (np.zeros((200, 300, 4), np.uint8), "three-colour"),
    ],
)
def test_what_is_no_frame_is_refused(image: np.ndarray, words: str) -> None:
    with pytest.raises(InputError, match=words):
        find_stripe(image)


def test_a_dark_frame_of_another_size_is_refused() -> None:
    with pytest.raises(InputError, match="dark frame like the lit one"):
        find_stripe(np.zeros((200, 300), np.uint8), dark=np.zeros((200, 301), np.uint8))


def test_least_centers_is_an_option() -> None:
    mean = np.full((200, 300), 10.0)
    mean[:, 100:130] = light(np.full(30, 90.2), height=200)
    image = frame(mean, 1)
    assert 28 <= len(find_stripe(image, StripeOptions(axis="columns")).row_px) <= 30
    with pytest.raises(MeasurementError, match="at least 100 clean peaks"):
        find_stripe(image, StripeOptions(axis="columns", least_centers=100))
