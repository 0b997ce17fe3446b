"""The page of a server, seen in Chromium, its 3-D scene too."""

import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from playwright.sync_api import Page, sync_playwright

from tests.web.browsing import BROWSER_ARGUMENTS, CHROMIUM

_DRAWN = 0.05
"""Of the middle of the scene: its axes alone, before the sphere and the arcs come, are a hundredth."""
_LONGEST_S = 300.0


@contextmanager
def page_of(address: str) -> Generator[Page]:
    """Open an address; what the page complains of is an error in the end."""
    complaints: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=BROWSER_ARGUMENTS)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.set_default_timeout(1000 * _LONGEST_S)
        page.goto(address, wait_until="commit")
        try:
            yield page
        finally:
            browser.close()
    assert complaints == []


def scene_shown(page: Page, picture: Path) -> float:
    """Wait until a session's page shows its scene; keep a picture; return which part of its middle is drawn."""
    page.locator("sc-guide h1").wait_for()
    frame = page.locator("iframe").first
    frame.wait_for()
    page.frame_locator("iframe").first.locator("canvas").first.wait_for()
    until_s = time.monotonic() + _LONGEST_S
    while (drawn := _drawn(frame.screenshot())) < _DRAWN:
        page.screenshot(path=picture)
        assert time.monotonic() < until_s, f"{drawn:.3f} of the scene is drawn"
        time.sleep(1)
    page.screenshot(path=picture)
    return drawn


def _drawn(png: bytes) -> float:
    """Return which part of a picture's middle is not of its commonest colour."""
    pixels = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert pixels is not None
    height, width = pixels.shape[:2]
    middle = pixels[height // 4 : -height // 4, width // 4 : -width // 4].reshape(-1, 3)
    return 1 - float(np.unique(middle, axis=0, return_counts=True)[1].max()) / len(middle)
