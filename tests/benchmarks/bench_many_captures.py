"""The scene with 15, 300 and 2,000 captures in Chromium: frames while the camera turns, and the page's heap."""

from typing import Any

from harness import Row
from playwright.sync_api import Browser, sync_playwright

from server.scenes.manager import SceneManager
from tests.server.scene_cell import make_cell, serve_scenes
from tests.server.scene_visit import ARGUMENTS
from tests.web.browsing import CHROMIUM

LEAST_SHARE = {300: 0.7, 2000: 0.4}
MOST_HEAP_MB = 120.0
_DRAWN = """() => {
  const nodes = window.__viserSceneTree?.getState();
  return nodes?.["/sphere/solved"] && nodes["/labels/p01"];
}"""
_TURN = """(seconds) => new Promise((resolve) => {
  const mutable = window.__viserMutable, began = performance.now();
  let frames = 0;
  const next = () => {
    const now = performance.now();
    if (now - began > 1000 * seconds) return resolve(1000 * frames / (now - began));
    frames += 1;
    const { camera } = mutable, [x, y] = [camera.position.x, camera.position.y];
    camera.position.set(x - 0.01 * y, y + 0.01 * x, camera.position.z);
    mutable.requestRender?.();
    requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
})"""


def look(browser: Browser, captures: int, seconds: float) -> tuple[float, float]:
    """Return frames a second and the tab's heap in MB."""
    scene = make_cell(count=captures, rejected=()).scene()
    manager = SceneManager(lambda _: scene)
    try:
        with serve_scenes(manager) as address:
            page = browser.new_page(viewport={"width": 900, "height": 700})
            page.goto(f"{address}/scenes/many/")
            page.wait_for_function(_DRAWN, timeout=240_000)
            page.wait_for_timeout(3000)
            rate = float(page.evaluate(_TURN, seconds))
            session: Any = page.context.new_cdp_session(page)
            session.send("HeapProfiler.collectGarbage")
            heap = session.send("Runtime.getHeapUsage")
            used = sum(heap.get(name, 0) for name in ("usedSize", "embedderHeapUsedSize", "backingStorageSize"))
            page.close()
    finally:
        manager.stop()
    return rate, used / 1e6


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` turns for longer."""
    seconds = 12.0 if full else 4.0
    rows: list[Row] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(ARGUMENTS))
        few, _ = look(browser, 15, seconds)
        for captures, least in LEAST_SHARE.items():
            rate, heap_mb = look(browser, captures, seconds)
            share = rate / few
            rows.append(
                Row(
                    f"scene with {captures:,} captures: frames beside those with 15",
                    f"≥ {least:g} ×",
                    f"{share:.2f} × ({rate:.1f} of {few:.1f} a second)",
                    share >= least,
                )
            )
            if captures == max(LEAST_SHARE):
                rows.append(
                    Row(
                        f"heap of the scene's page at {captures:,}",
                        f"≤ {MOST_HEAP_MB:g} MB",
                        f"{heap_mb:.0f} MB",
                        heap_mb <= MOST_HEAP_MB,
                    )
                )
        browser.close()
    return rows
