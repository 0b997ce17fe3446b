"""Stripe centres of a 1280×1024 frame: against the Cramér–Rao bound, and beside OpenCV blur + parabola in a band.

Frames come in streams: each job takes a stream of different frames at its turn; a frame's time is its share.
The peer is told the stripe's width and direction, so the figure is for ours told the same.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from calib_core.optics.stripe import StripeOptions, find_stripe
from tests.benchmarks.harness import Row, interleaved_medians_s

HEIGHT, WIDTH = 1024, 1280
AMPLITUDE, WIDTH_PX, NOISE, DARK, HOT = 140.0, 2.0, 4.0, 10.0, 300
STREAM = 5
COARSE, BAND = 4, 33  # rows of the peer's coarse image; of the band about its peak


def run(full: bool) -> list[Row]:
    """Return accuracy relative to the bound, gross errors, and times of ours and of the peers."""
    frames = [_frame(seed) for seed in range(20 if full else 5)]
    center, bound = _center(), _bound()
    ratios = []
    for image in frames:
        found = find_stripe(image)
        index = found.column_px.astype(int)
        ratios.append((found.row_px - center[index]) / bound[index])
    ratio = np.concatenate(ratios)
    gross = float(np.mean(np.abs(ratio) > 6))
    rms = float(np.sqrt(np.mean(ratio[np.abs(ratio) <= 6] ** 2)))
    peer_errors = (_blur_and_parabola(frames[0]) - center) / bound
    peer_gross = float(np.mean(np.abs(peer_errors) > 6))
    peer_rms = float(np.sqrt(np.mean(peer_errors[np.abs(peer_errors) <= 6] ** 2)))
    stream = frames[:STREAM]
    series = StripeOptions(axis="columns", width_px=2.0)
    kinds = {
        "ours": find_stripe,
        "series": partial(find_stripe, options=series),
        "peer": _blur_and_parabola,
        "centroid": _centroid,
    }
    rounds = 41 if full else 15
    streams = {name: partial(_each, find, stream) for name, find in kinds.items()}
    times = {name: 1e3 * t / STREAM for name, t in interleaved_medians_s(streams, rounds).items()}
    alone = interleaved_medians_s({name: partial(find, frames[0]) for name, find in kinds.items()}, rounds)
    arrives = peer_rms <= 1.3 and peer_gross < 0.01
    faster, faster_series = times["peer"] / times["ours"], times["peer"] / times["series"]
    return [
        Row("RMS / per-column Cramér–Rao bound", "≤ 1.05", f"{rms:.3f}", rms <= 1.05),
        Row("gross errors (beyond 6 bounds)", "< 0.1 %", f"{100 * gross:.3f} %", gross < 1e-3),
        Row("the peer, OpenCV in a band: RMS / bound", "≤ 1.3", f"{peer_rms:.3f}", arrives),
        Row("ours, direction and width found in the frame", "", f"{times['ours']:.3f} ms a frame"),
        Row("ours, direction and width known from the frame before", "", f"{times['series']:.3f} ms a frame"),
        Row("OpenCV blur + parabola in a band", "", f"{times['peer']:.3f} ms a frame"),
        Row("numpy centroid", "", f"{times['centroid']:.3f} ms a frame"),
        Row(
            "times faster than the peer, both told",
            "≥ 12",
            f"{faster_series:.1f}",
            arrives and faster_series >= 12,
        ),
        Row("  only the peer told width and direction", "", f"{faster:.1f}"),
        Row("  one frame right after other work: both, only the peer told", "", _alone(alone)),
    ]


def _each(find: Callable[[np.ndarray], object], stream: Sequence[np.ndarray]) -> None:
    for image in stream:
        find(image)


def _alone(times: Mapping[str, float]) -> str:
    """Return both ratios of a single call, whose code and memory the jobs before it have put out of the caches."""
    return f"{times['peer'] / times['series']:.1f}, {times['peer'] / times['ours']:.1f}"


def _center() -> np.ndarray:
    x = np.arange(WIDTH)
    return 500 + 60 * np.sin(x / 200) + 0.05 * x


def _frame(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    u = np.arange(HEIGHT)[:, None] - _center()
    image = DARK + AMPLITUDE * np.exp(-0.5 * (u / WIDTH_PX) ** 2) + NOISE * rng.standard_normal(u.shape)
    image[rng.integers(0, HEIGHT, HOT), rng.integers(0, WIDTH, HOT)] += rng.uniform(60, 250, HOT)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def _bound() -> np.ndarray:
    u = np.arange(HEIGHT)[:, None] - _center()
    slope = AMPLITUDE * u / WIDTH_PX**2 * np.exp(-0.5 * (u / WIDTH_PX) ** 2)
    return np.sqrt((NOISE**2 + 1 / 12) / (slope**2).sum(axis=0))


def _blur_and_parabola(image: np.ndarray) -> np.ndarray:
    """Blur a band about each column's coarse peak by the stripe's width; a parabola through its highest rows."""
    import cv2

    coarse = cv2.resize(image, (WIDTH, HEIGHT // COARSE), interpolation=cv2.INTER_AREA)
    columns = np.arange(WIDTH)
    first = np.clip(COARSE * coarse.argmax(axis=0) - BAND // 2, 0, HEIGHT - BAND)
    band = image[first + np.arange(BAND)[:, None], columns].astype(np.float32)
    size = 2 * int(np.ceil(3 * WIDTH_PX)) + 1
    blurred = cv2.GaussianBlur(band, (1, size), sigmaX=1e-6, sigmaY=WIDTH_PX)
    top = np.clip(blurred.argmax(axis=0), 1, BAND - 2)
    low, mid, high = blurred[top - 1, columns], blurred[top, columns], blurred[top + 1, columns]
    return first + top + 0.5 * (low - high) / (low - 2 * mid + high)


def _centroid(image: np.ndarray) -> np.ndarray:
    """Return the centre of gravity about each column's brightest row."""
    top = np.clip(image.argmax(axis=0), 8, HEIGHT - 9)
    rows = top + np.arange(-8, 9)[:, None]
    weight = np.maximum(image[rows, np.arange(WIDTH)].astype(np.float64) - DARK - 3 * NOISE, 0.0)
    return (weight * rows).sum(axis=0) / weight.sum(axis=0)
