"""From the simulated cell with a turntable to the solved chain, doing what the page says."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

pytestmark = pytest.mark.browser

PICTURES = os.environ.get("SCANCELL_PICTURES")  # a folder for pictures of what was walked through


def picture(page: Page, name: str) -> None:
    if PICTURES:
        for theme in ("light", "dark"):
            page.evaluate(f"document.documentElement.dataset.theme = '{theme}'")
            page.screenshot(path=Path(PICTURES) / f"{name}-{theme}.png", full_page=True)


def test_the_page_leads_to_the_whole_chain(open_page: Callable[..., Any], axe: str) -> None:
    page, watched = open_page(width=1400, height=1000)
    page.get_by_role("button", name="With a turntable").click()
    instruction = page.locator("sc-guide h1")
    expect(instruction).not_to_be_empty()
    captured, solved, seen = 0, 0, set()
    while solved < 3:
        assert captured < 40, instruction.inner_text()
        words = instruction.inner_text()
        if words.startswith("Solve"):
            before = words
            page.locator("sc-actions .solve").click()
            solved += 1
            expect(page.locator(".banner")).to_contain_text("accepted")
            expect(instruction).not_to_have_text(before)
            page.get_by_role("tab", name="Measure").click()
            continue
        seen.add(words)
        page.locator("sc-actions .capture").click()
        captured += 1
        expect(page.locator("table.captures tbody tr")).to_have_count(captured)
        page.wait_for_timeout(200)
        if captured == 20:
            picture(page, "turntable-measure")
    # Seven angles are asked for by number at each height, and a second height.
    assert sum("Turn the table to about" in words for words in seen) == 7
    assert any("another height" in words for words in seen)
    expect(page.get_by_role("button", name=re.compile(r"Table at t09: 0° · high"))).to_be_visible()

    page.get_by_role("tab", name="Result").click()
    frame = page.get_by_role("region", name="Table in the robot's base")
    numbers = frame.locator("dd").all_inner_texts()
    assert len(numbers) == 7  # the simulated cell speaks ABB's x y z q1 q2 q3 q4
    for number in numbers:
        assert re.fullmatch(r"−?\d+(\.\d+)? ± \d+(\.\d+)?(\s?mm)?", number), number
    # Two figures in millimetres and one in degrees for each of 16 captures.
    expect(page.locator(".angle-plot .mark-point")).to_have_count(48)
    expect(page.get_by_role("heading", name="The circles beside the joint answer")).to_be_visible()
    expect(page.locator("sc-rail .answer")).to_have_count(3)
    picture(page, "chain-result")
    page.evaluate(axe)
    found = page.evaluate("axe.run('sc-session', {resultTypes: ['violations']})")["violations"]
    assert [(one["id"], one["nodes"][0]["html"]) for one in found] == []
    page.locator(".angle-plot .mark-point").first.press("Enter")
    page.get_by_role("button", name="Turntable", exact=True).click()
    expect(page.locator(".banner")).to_contain_text("Turntable")
    picture(page, "turntable-result")

    # A wrong angle is corrected where it stands, and everything that rests on it is out of date.
    page.get_by_role("tab", name="Measure").click()
    page.get_by_role("button", name=re.compile("Table at t01")).click()
    page.get_by_label("Table angle in degrees").fill("0.02")
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("button", name=re.compile(r"Table at t01: 0.020°"))).to_be_visible()
    expect(page.locator("sc-rail .status-stale")).to_contain_text("Turntable")
    assert watched.complaints == []
