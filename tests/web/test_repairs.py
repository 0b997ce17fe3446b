"""From the refusal of a solve to the repaired answer; every kind of mistake: `scancell bench repairs`."""

import httpx
import pytest
from bench_repairs import mended

from tests.web.browsing import SharedProfile


@pytest.mark.thorough
def test_a_wrong_diameter_is_mended_by_one_action(profile: SharedProfile, address: str) -> None:
    with httpx.Client(base_url=f"{address}/api/v1/", timeout=300, trust_env=False) as client:
        assert mended(profile.open(), client, "wrong diameter") == (1, "pass")
