"""Widths, tablets and the shop floor: nothing cut off, targets large enough, the main action in sight."""

from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest
from playwright.sync_api import Browser, Page, expect

from tests.server.live_server import simulated_session
from tests.web.browsing import leave_out_the_scene

pytestmark = pytest.mark.browser

_SMALL_TARGETS = """() => [...document.querySelectorAll("main :is(button, a, select, summary), header button")]
  .filter((one) => one.checkVisibility() && !one.closest("svg, dd, p, li p"))
  .map((one) => [one.getBoundingClientRect(), one.innerText || one.getAttribute("aria-label") || one.tagName])
  .filter(([box]) => box.width > 0 && (box.height < 43.5 || box.width < 43.5))
  .map(([box, text]) => `${text}: ${box.width.toFixed(0)} x ${box.height.toFixed(0)}`)"""
_SMALL_TYPE = """() => [...document.querySelectorAll("main *, header *")]
  .filter((one) => one.checkVisibility() && !one.closest("svg, option, .visually-hidden")
    && [...one.childNodes].some((part) => part.nodeType === 3 && part.data.trim()))
  .filter((one) => parseFloat(getComputedStyle(one).fontSize) < 20).map((one) => one.outerHTML.slice(0, 90))"""
_WIDE = "() => document.documentElement.scrollWidth - innerWidth"


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        yield client


@pytest.fixture(params=[(1024, 768), (1280, 800)])
def tablet(request: pytest.FixtureRequest, browser: Browser, address: str) -> Page:
    width, height = request.param
    context = browser.new_context(
        base_url=address, viewport={"width": width, "height": height}, has_touch=True, is_mobile=True
    )
    leave_out_the_scene(context)
    return context.new_page()


def main_action_in_sight(page: Page) -> bool:
    box = page.locator("sc-actions button.primary:visible").first.bounding_box()
    size = page.viewport_size
    return bool(box and size) and box["y"] + box["height"] <= size["height"] and box["x"] >= 0


@pytest.mark.thorough
def test_a_tablet_by_touch(tablet: Page, api: httpx.Client) -> None:
    """The whole TCP: captures, the solve, and the result from its top to its end."""
    session = simulated_session(api, captures=1)
    tablet.goto(f"/sessions/{session}")
    main = tablet.locator("sc-actions button.primary:visible").first
    rows = tablet.locator(".captures tbody tr")

    def require_room() -> None:
        assert tablet.evaluate(_WIDE) <= 0
        assert main_action_in_sight(tablet)
        assert tablet.evaluate(_SMALL_TARGETS) == []

    expect(rows).to_have_count(1)
    require_room()
    main.tap()
    expect(rows).to_have_count(2)
    require_room()
    count = 2  # what is between looks the same: taken without taps
    while api.get(f"/sessions/{session}/guide").json()["current"]["action"] == "capture":
        api.post(f"/sessions/{session}/sources/simulated/capture").raise_for_status()
        count += 1
    expect(rows).to_have_count(count, timeout=120_000)
    expect(main).to_contain_text("Solve")
    require_room()
    main.tap()
    expect(tablet.locator(".answer-card")).to_be_visible(timeout=120_000)
    expect(tablet.locator(".plot-captures .dot").first).to_be_attached()
    require_room()
    tablet.locator(".work").evaluate("(work) => { work.scrollTop = work.scrollHeight; }")
    require_room()


_TONES = """
window.tones = [];
const start = OscillatorNode.prototype.start;
OscillatorNode.prototype.start = function (...at) {
  window.tones.push([this.frequency.value, this.context.state]);
  return start.apply(this, at);
};
"""


def test_the_shop_floor(open_page: Callable[..., Any], api: httpx.Client) -> None:
    page, watched = open_page(f"/sessions/{simulated_session(api, captures=2)}", width=1024, height=768)
    expect(page.locator("sc-quality")).to_be_visible()
    page.get_by_role("button", name="More", exact=True).click()
    page.get_by_label("Shop floor").check()
    page.get_by_label("Sound", exact=True).uncheck()
    page.keyboard.press("Escape")
    page.add_init_script(_TONES)
    page.context.new_cdp_session(page).send("Emulation.setTouchEmulationEnabled", {"enabled": True})
    page.reload()
    expect(page.locator("sc-quality")).to_be_visible()
    assert page.evaluate("() => matchMedia('(pointer: coarse)').matches")
    assert page.evaluate(_SMALL_TYPE) == []
    assert page.evaluate(_WIDE) <= 0
    assert main_action_in_sight(page)
    action = page.locator("sc-actions button.primary:visible").bounding_box()
    assert action is not None
    assert action["height"] >= 100
    page.locator("sc-actions button.primary:visible").click()
    expect(page.locator("sc-quality h2")).to_contain_text("p03")
    assert page.evaluate("() => window.tones") == []
    page.get_by_role("button", name="More", exact=True).click()
    page.get_by_label("Sound", exact=True).check()
    page.keyboard.press("Escape")
    page.locator("sc-actions button.primary:visible").click()
    expect(page.locator("sc-quality h2")).to_contain_text("p04")
    assert page.evaluate("() => window.tones") == [[660, "running"], [880, "running"]]
    # What a term means is told where a finger touches it.
    page.locator("sc-quality .term", has_text="r/R").click()
    expect(page.locator(".glossary")).to_contain_text("the radius of the arc over the sphere's radius")
    assert watched.complaints == []


def test_the_border_of_the_scene_is_moved_and_kept(open_page: Callable[..., Any], api: httpx.Client) -> None:
    page, watched = open_page(f"/sessions/{simulated_session(api, captures=1)}")
    border = page.get_by_role("separator", name="Width of the scene")
    border.focus()
    for key, share in (("End", "70"), ("Home", "20"), ("ArrowLeft", "23")):
        border.press(key)
        expect(border).to_have_attribute("aria-valuenow", share)
    page.reload()
    expect(border).to_have_attribute("aria-valuenow", "23")
    assert page.evaluate(_WIDE) <= 0
    assert watched.complaints == []
