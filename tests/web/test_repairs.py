"""From the refusal of a solve to the repaired answer; every kind of mistake: `scancell bench repairs`."""

import httpx
from bench_repairs import mended

from tests.web.browsing import SharedProfile


def test_a_wrong_diameter_is_mended_by_one_action(profile: SharedProfile, api: httpx.Client) -> None:
    assert mended(profile.open(), api, "wrong diameter") == (1, "pass")
