"""axe finds nothing to object to, in both themes; and the page weighs little."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Browser, Page, expect

from tests.server.live_server import make_session, simulated_session
from tests.web.browsing import leave_out_the_scene

pytestmark = pytest.mark.browser

WEB = Path(__file__).resolve().parents[2] / "web"


@pytest.fixture(params=["light", "dark"])
def page(request: pytest.FixtureRequest, browser: Browser, address: str) -> Iterator[Page]:
    """A page in either theme whose security policy lets the checker in."""
    context = browser.new_context(
        base_url=address, color_scheme=request.param, bypass_csp=True, reduced_motion="reduce"
    )
    leave_out_the_scene(context)
    yield context.new_page()
    context.close()


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=60, trust_env=False) as client:
        yield client


def violations(page: Page, axe: str) -> list[str]:
    """What axe objects to on the page itself; the scene is another document with its own tests."""
    page.evaluate(axe)
    found = page.evaluate("async () => (await axe.run({exclude: [['iframe']]}, {iframes: false})).violations")
    return [
        f"{one['id']}: {node['html'][:160]} {node['failureSummary']}" for one in found for node in one["nodes"]
    ]


def test_start(page: Page, axe: str, api: httpx.Client) -> None:
    make_session(api, name="for the list")
    page.goto("/")
    expect(page.locator(".session-card").first).to_be_visible()
    expect(page.locator("sc-drawing svg")).to_have_count(3)
    assert violations(page, axe) == []
    page.get_by_role("button", name="New session").click()
    page.get_by_text("More", exact=True).click()
    page.get_by_role("button", name="Create the session").click()
    assert violations(page, axe) == []


def test_session(page: Page, axe: str, api: httpx.Client) -> None:
    session = simulated_session(api, captures=14, scenario="tcp-moved-sphere")
    page.goto(f"/sessions/{session}")
    expect(page.locator(".captures tbody tr")).to_have_count(14)
    assert violations(page, axe) == []
    page.get_by_role("button", name="Paste poses").click()
    page.get_by_label("Pose lines, one a capture").fill("1 2 3")
    expect(page.locator(".match tbody tr")).to_have_count(1)
    assert violations(page, axe) == []
    page.get_by_role("button", name="Solve").click()
    expect(page.locator(".banner")).to_be_visible()
    assert violations(page, axe) == []
    page.get_by_role("tab", name="Measure").click()
    expect(page.locator(".captures")).to_contain_text("rejected")
    assert violations(page, axe) == []


def test_weight(open_page: Callable[..., Any], address: str) -> None:
    """The page without its scene stays below 300 kB, everything counted uncompressed."""
    counted = [
        p
        for p in WEB.rglob("*")
        if p.is_file() and "vendor" not in p.parts and p.suffix in {".js", ".css", ".html", ".svg"}
    ]
    assert sum(p.stat().st_size for p in counted) < 300_000
    page, _ = open_page()
    loaded = page.evaluate(
        "performance.getEntriesByType('resource').map(e => e.decodedBodySize).reduce((a, b) => a + b, 0)"
    )
    assert 20_000 < loaded < 300_000
