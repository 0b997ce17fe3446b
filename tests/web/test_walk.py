"""From "new session" to a calibrated TCP with the scene drawn, reading only what the page says."""

import os
import re
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Locator, Page, expect

from tests.web.browsing import Hand

pytestmark = pytest.mark.browser

MOST_ACTIONS = 30
"""From the first visit to an accepted calibration with its truth shown."""
TRUTH = "Compared with the truth"
# The README's picture is taken when it is asked for.
TAKE_PICTURE = "SCANCELL_PICTURE" in os.environ
PICTURE = Path(__file__).resolve().parents[2] / "docs" / "images" / "session.png"


def instruction(page: Page) -> Locator:
    return page.locator("sc-guide h1")


def rows(page: Page) -> Locator:
    return page.get_by_role("table").locator("tbody tr")


def capture_as_told(page: Page, act: Callable[[], None], at_most: int = 30) -> int:
    """Capture for as long as the page says so; returns how many it took."""
    expect(instruction(page)).not_to_be_empty()
    count = 0
    while not instruction(page).inner_text().startswith("Solve"):
        assert count < at_most, f"still told to capture: {instruction(page).inner_text()}"
        act()
        count += 1
        expect(rows(page)).to_have_count(count)
        expect(page.locator("sc-quality h2")).to_contain_text(f"p{count:02d}")
        page.wait_for_timeout(250)
    return count


def drawn_colours(page: Page) -> int:
    """How many different colours the scene shows, once its picture rests."""
    frame = page.locator("sc-scene iframe")
    before: Any = None
    for _ in range(60):
        now = np.array(Image.open(BytesIO(frame.screenshot())).convert("RGB"))
        if before is not None and now.shape == before.shape and not np.any(now != before):
            return len(np.unique(now.reshape(-1, 3), axis=0))
        before = now
        page.wait_for_timeout(300)
    raise AssertionError("the scene never comes to rest")


def test_keyboard_alone_calibrates_the_simulated_cell(open_page: Callable[..., Any]) -> None:
    width, height = (1600, 1000) if TAKE_PICTURE else (1100, 640)
    page, watched = open_page(scene=True, width=width, height=height)
    expect(page.get_by_role("button", name="Start the simulated cell")).to_be_visible()
    hand = Hand(page)
    for _ in range(8):
        hand.press("Tab")
        if page.locator(":focus").inner_text() == "Start the simulated cell":
            break
    hand.press("Enter")
    expect(page.locator("header")).to_contain_text("simulated cell 7")
    taken = capture_as_told(page, lambda: hand.press("Space"))
    assert taken >= 7
    hand.press("s")

    expect(page.get_by_role("tab", name="Result")).to_have_attribute("aria-selected", "true")
    expect(page.locator(".answer-card")).to_contain_text("accepted")
    expect(page.get_by_role("region", name=TRUTH)).to_be_visible()
    assert hand.actions <= MOST_ACTIONS
    frame = page.get_by_role("region", name="Scanner on the flange")
    numbers = frame.locator("dd").all_inner_texts()
    assert len(numbers) == 7  # the simulated cell speaks ABB's x y z q1 q2 q3 q4
    for number in numbers:
        assert re.fullmatch(r"−?\d+(\.\d+)?\s±\s\d+(\.\d+)?(\s?mm)?", number), number
    expect(page.get_by_role("heading", name="Joint answer beside the paper's two steps")).to_be_visible()
    expect(page.locator(".plot-captures .dot")).to_have_count(taken)
    expect(page.locator("sc-rail .answer")).to_contain_text("±")
    assert drawn_colours(page) > 300
    if TAKE_PICTURE:
        PICTURE.parent.mkdir(parents=True, exist_ok=True)
        page.screenshot(path=PICTURE)
    assert watched.complaints == []
    assert watched.hosts == {urlsplit(page.url).netloc}


@pytest.mark.thorough
def test_mouse_alone_and_a_pick_that_lights_up_everywhere(open_page: Callable[..., Any]) -> None:
    page, watched = open_page()
    hand = Hand(page)
    hand.click("Start the simulated cell")
    capture_as_told(page, lambda: hand.click("Capture the"))
    hand.click("Solve")
    expect(page.locator(".answer-card")).to_contain_text("accepted")
    expect(page.get_by_role("region", name=TRUTH)).to_be_visible()
    assert hand.actions <= MOST_ACTIONS
    dot = page.locator(".plot-captures .dot").nth(1)
    with page.expect_request(lambda request: request.url.endswith("/highlight")) as lit:
        dot.click()
    assert lit.value.post_data_json == {"capture": "p02"}
    expect(dot).to_have_class(re.compile("picked"))
    page.get_by_role("tab", name="Measure").click()
    expect(page.get_by_role("button", name="p02", exact=True)).to_have_attribute("aria-pressed", "true")
    expect(page.locator("sc-quality h2")).to_contain_text("Selected capture p02")

    # What changes the captures makes the result out of date, here and in the rail.
    page.get_by_role("checkbox", name="Use p03").uncheck()
    expect(page.locator("sc-rail")).to_contain_text("out of date")
    page.get_by_role("checkbox", name="Use p03").check()
    expect(page.locator("sc-rail .answer")).not_to_contain_text("out of date")

    # The result is drawn anew; what leads on from it stays in its place, lest a click on it be lost.
    parts = "document.querySelectorAll('.answer-card, .result-links')"
    page.evaluate(f"() => {parts}.forEach((one) => {{ one.dataset.seen = 'before'; }})")
    page.get_by_role("tab", name="Result").click()
    expect(page.locator(".answer-card")).not_to_have_attribute("data-seen", "before")
    expect(page.locator(".result-links")).to_have_attribute("data-seen", "before")
    assert watched.complaints == []
