"""Simulated frames → camera → plane of light → TCP: is what the results state about themselves true?

Every seed renders 36 frames and solves all three stages; two processes share the seeds.
"""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor

from frame_chain import FrameChain, frame_chain, mean_interval, mean_of
from harness import Row

from calib_core.simulation import simulate

_PROCESSES = 2


def run(full: bool) -> list[Row]:
    """Return the mean normalised errors; `full` takes the 50 seeds of the target."""
    seeds = 50 if full else 10
    with ProcessPoolExecutor(_PROCESSES, multiprocessing.get_context("spawn")) as pool:
        chains = list(pool.map(_chain, range(seeds)))
    return [
        _nees(chains, "plane_nees", f"plane from frames, {seeds} seeds: mean NEES (3)", 3),
        _nees(chains, "tcp_nees", f"TCP from frames, {seeds} seeds: mean NEES (6)", 6),
        Row("camera from frames: mean NEES of a parameter", "", f"{mean_of(chains, 'camera_nees'):.2f}"),
        Row("error of the plane's normal, mean", "", f"{mean_of(chains, 'normal_error_deg'):.4f}°"),
        Row("error of the TCP's place, mean", "", f"{mean_of(chains, 'tcp_error_mm'):.3f} mm"),
    ]


def _chain(seed: int) -> FrameChain:
    return frame_chain(simulate("frames-tcp", seed))


def _nees(chains: list[FrameChain], field: str, what: str, freedom: int) -> Row:
    low, high = mean_interval(freedom, len(chains))
    mean = mean_of(chains, field)
    return Row(what, f"{low:.2f} to {high:.2f}", f"{mean:.2f}", low <= mean <= high)
