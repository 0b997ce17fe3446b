"""The scene with 15, 300 and 2,000 captures in Chromium: frames while the camera turns, and the page's heap.

The pages take turns, a few frames each: what else the machine does slows all of them alike.  The resolution, which
viser lowers where frames are slow, stays.
"""

from contextlib import ExitStack
from statistics import median
from typing import Any

from harness import Row
from playwright.sync_api import Browser, Page, sync_playwright

from server.scenes.manager import SceneManager
from tests.server.scene_cell import make_cell, serve_scenes
from tests.server.scene_visit import ARGUMENTS
from tests.web.browsing import CHROMIUM

FEW = 15
LEAST_SHARE = {300: 0.7, 2000: 0.4}
MOST_HEAP_MB = 120.0
_SAME_PIXELS = "() => window.__viserTestpoints.devSettings.set({ fixedDpr: 1 })"
_DRAWN = """() => {
  const nodes = window.__viserSceneTree?.getState();
  return nodes?.["/sphere/solved"] && nodes["/labels/p01"];
}"""
_TURN = """(count) => new Promise((resolve) => {
  const mutable = window.__viserMutable;
  let frames = -2, began = 0;
  const next = () => {
    if (!frames) began = performance.now();
    if (frames === count) return resolve((performance.now() - began) / count);
    frames += 1;
    const { camera } = mutable, [x, y] = [camera.position.x, camera.position.y];
    camera.position.set(x - 0.01 * y, y + 0.01 * x, camera.position.z);
    mutable.requestRender?.();
    requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
})"""


def opened(browser: Browser, captures: int, until_the_end: ExitStack) -> Page:
    """Return a page of a scene that is drawn whole."""
    scene = make_cell(count=captures, rejected=()).scene()
    manager = SceneManager(lambda _: scene)
    until_the_end.callback(manager.stop)
    address = until_the_end.enter_context(serve_scenes(manager))
    page = browser.new_page(viewport={"width": 900, "height": 700})
    until_the_end.callback(page.close)
    page.set_default_timeout(240_000)
    page.goto(f"{address}/scenes/many/")
    page.wait_for_function(_DRAWN)
    page.evaluate(_SAME_PIXELS)
    page.wait_for_timeout(3000)
    return page


def heap_mb(page: Page) -> float:
    """Return what the tab holds after its garbage is collected."""
    session: Any = page.context.new_cdp_session(page)
    session.send("HeapProfiler.collectGarbage")
    heap = session.send("Runtime.getHeapUsage")
    return sum(heap.get(name, 0) for name in ("usedSize", "embedderHeapUsedSize", "backingStorageSize")) / 1e6


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` turns for longer."""
    with sync_playwright() as playwright, ExitStack() as until_the_end:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(ARGUMENTS))
        pages = {captures: opened(browser, captures, until_the_end) for captures in (FEW, *LEAST_SHARE)}
        times_ms = {captures: [] for captures in pages}
        for _ in range(30 if full else 6):
            for captures, page in pages.items():
                times_ms[captures].append(float(page.evaluate(_TURN, 4)))
        largest_mb = heap_mb(pages[max(pages)])
    rows: list[Row] = []
    for captures, least in LEAST_SHARE.items():
        share = median(few / many for few, many in zip(times_ms[FEW], times_ms[captures], strict=True))
        rate, few = (1000 / median(times_ms[count]) for count in (captures, FEW))
        rows.append(
            Row(
                f"scene with {captures:,} captures: frames beside those with {FEW}",
                f"≥ {least:g} ×",
                f"{share:.2f} × ({rate:.1f} of {few:.1f} a second)",
                share >= least,
            )
        )
    what = f"heap of the scene's page at {max(LEAST_SHARE):,} captures"
    held = largest_mb <= MOST_HEAP_MB
    return [*rows, Row(what, f"≤ {MOST_HEAP_MB:g} MB", f"{largest_mb:.0f} MB", held)]
