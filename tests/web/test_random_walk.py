"""A random walk through the page; the benchmark `walk` does 5,000 actions."""

import httpx
import pytest
from bench_walk import walk_from
from playwright.sync_api import Browser

from tests.web.browsing import Watch

pytestmark = pytest.mark.browser


@pytest.mark.thorough
def test_a_random_walk_finds_no_error_and_no_dead_end(browser: Browser, address: str, watch: Watch) -> None:
    watch.allow("server responded with a status of 4")  # a refusal, which the walk itself asks to be told
    with httpx.Client(base_url=f"{address}/api/v1/", timeout=300, trust_env=False) as client:
        found = walk_from(browser, client, actions=60, seed=3)
    assert found.problems == []
    assert len(found.used) >= 3  # links, buttons and fields
