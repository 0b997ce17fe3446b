"""Raw frames all the way: what camera, plane of light and TCP state about themselves is true."""

from collections.abc import Callable

import pytest

from calib_core.simulation import SimulatedSession
from tests.benchmarks.frame_chain import frame_chain, mean_interval, mean_of

SEEDS = (5, 7)  # those of other tests: rendered once


@pytest.mark.thorough
def test_what_the_results_from_frames_state_is_true(rendered: Callable[[str, int], SimulatedSession]) -> None:
    chains = [frame_chain(rendered("frames-tcp", seed)) for seed in SEEDS]
    for field, freedom in (("plane_nees", 3), ("tcp_nees", 6)):
        low, high = mean_interval(freedom, len(SEEDS), 0.999)
        assert low < mean_of(chains, field) < high, field
    low, high = mean_interval(8, len(SEEDS), 0.999)
    assert low / 8 < mean_of(chains, "camera_nees") < high / 8
    assert mean_of(chains, "normal_error_deg") < 0.02
