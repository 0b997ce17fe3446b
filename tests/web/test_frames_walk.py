"""From raw camera frames to the solved TCP, doing what the page says."""

import re
from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.web.browsing import go_on, take_one

pytestmark = pytest.mark.browser

FRAMES = 36  # boards, boards with the stripe, and the sphere


def seen_so_far(page: Page) -> tuple[int, int]:
    """How many frames count, and what share of the image they cover, %."""
    words = page.locator("sc-quality .seen-so-far figcaption").inner_text()
    found = re.search(r"(\d+) frames? covers? (\d+)\s%", words)
    assert found, words
    return int(found[1]), int(found[2])


@pytest.mark.thorough
def test_the_page_leads_from_board_frames_to_the_tcp(open_page: Callable[..., Any]) -> None:
    page, watched = open_page(width=1400, height=1000)
    page.get_by_role("button", name="With raw camera frames").click()
    instruction = page.locator("sc-guide h1")
    expect(instruction).not_to_be_empty(timeout=300_000)
    taken, solved, shares = 0, [], []
    while "TCP" not in solved:
        words = str(instruction.text_content())
        if words.startswith("Solve"):
            page.locator("sc-actions .solve").click()
            expect(instruction).not_to_have_text(words, timeout=300_000)
            expect(page.locator("#view-result")).to_be_visible()
            solved.append(page.locator("#answer-title").inner_text())
            look_at_the_result(page, solved[-1])
            assert go_on(page) or solved[-1] == "TCP"
            continue
        assert taken < FRAMES, words
        count = take_one(page)
        taken += 1
        if "Laser plane" in solved:  # a frame of the sphere is a profile as soon as it is there
            expect(page.locator("sc-quality h2")).to_contain_text(f"p{count:02d}")
            expect(page.locator("sc-quality .profile-plot .on").first).to_be_attached()
            continue
        if not solved and taken in (1, 6):
            frames, share = seen_so_far(page)
            assert frames == taken
            shares.append(share)
            gauge = page.get_by_role("meter", name=re.compile(r"edges of the squares are \d+\.\d pixels wide"))
            assert float(gauge.get_attribute("value") or 0) > 6  # edges of some two pixels
            expect(page.locator("sc-quality .frame-plot image")).to_have_count(1)
        go_on(page)  # boards with the stripe make the camera's result out of date
    assert shares[0] < shares[1]
    # The boards with the stripe serve the camera too: it is solved again before the plane.
    assert list(dict.fromkeys(solved)) == ["Camera", "Laser plane", "TCP"]
    assert len(solved) <= 4
    expect(page.locator("sc-rail .answer").last).to_contain_text("±")
    assert watched.complaints == []


def look_at_the_result(page: Page, step: str) -> None:
    """Each result has its own evidence."""
    if step == "Camera":
        views = page.locator("details", has=page.get_by_text("Residuals of each view"))
        views.evaluate("(details) => { details.open = true; }")
        expect(page.locator("svg.arrows .corner").first).to_be_visible()
        # A view that is chosen is the capture that is picked, and the other way round.
        view = page.locator("#camera-view")
        view.select_option(index=2)
        picked = view.input_value()
        expect(page.get_by_role("img", name=f"Residuals of view {picked}:")).to_be_visible()
        expect(page.locator(".dot.picked").first).to_have_attribute("data-capture", picked)
        view.select_option("")
        expect(page.get_by_role("img", name=f"Residuals of view {picked}:")).to_have_count(0)
        expect(page.get_by_role("heading", name="Coverage")).to_be_visible()
    elif step == "Laser plane":
        expect(page.locator("#view-result .evidence-plot").first).to_be_visible()
