"""The page in a real Chromium: how soon it can be used, what it weighs, and how it bears 200 captures."""

import json
import statistics
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import httpx
from harness import Row
from playwright.sync_api import Browser, Page, expect, sync_playwright

from calib_core.archive.archive import pack_files
from calib_core.simulation import TcpScenario, simulate_tcp
from server.settings import Settings
from tests.server.live_server import serving, simulated_session, wait_for
from tests.web.browsing import BROWSER_ARGUMENTS, CHROMIUM, leave_out_the_scene

_OBSERVE = """
window.longTasks = [];
new PerformanceObserver((list) => {
  for (const { startTime, duration } of list.getEntries()) {
    window.longTasks.push({ start_ms: startTime, length_ms: duration });
  }
}).observe({ type: "longtask", buffered: true });
"""
_LOADED = """() => {
  const entries = [...performance.getEntriesByType("navigation"), ...performance.getEntriesByType("resource")]
    .filter((entry) => !entry.name.includes("/scenes/") && !entry.name.includes("/api/"));
  return [entries.reduce((sum, entry) => sum + entry.decodedBodySize, 0), entries.length];
}"""
_READY = "() => performance.getEntriesByName('scancell:ready')[0]?.startTime"
_TTI_LIMIT_MS = 1000
_TASK_LIMIT_MS = 100
_WEIGHT_LIMIT_BYTES = 300_000


def many_captures(client: httpx.Client, count: int) -> str:
    """Return a stored session of `count` captures of the simulated cell; it comes as one archive."""
    simulated = simulate_tcp(7, TcpScenario(orientations=count - 4))
    payload = {"session.json": json.dumps(simulated.session.to_json()).encode(), **simulated.files}
    archive = BytesIO()
    pack_files(simulated.session, payload, archive, "many")
    answer = client.post("/archives", content=archive.getvalue(), headers={"Content-Type": "application/zip"})
    assert answer.status_code == 201, answer.text
    return answer.json()["id"]


@contextmanager
def fresh_page(browser: Browser, address: str) -> Generator[Page]:
    """Give a page of a browser profile that has seen nothing yet, and whose long tasks are noted."""
    context = browser.new_context(base_url=address, viewport={"width": 1280, "height": 800})
    leave_out_the_scene(context)
    context.add_init_script(_OBSERVE)
    try:
        yield context.new_page()
    finally:
        context.close()


def time_to_interactive_ms(browser: Browser, address: str, path: str) -> float:
    """Return when a page that was opened cold shows its data, takes input, and no long task is left to come."""
    with fresh_page(browser, address) as page:
        page.goto(path)
        page.wait_for_function(_READY)
        page.wait_for_timeout(500)
        ready_ms: float = page.evaluate(_READY)
        return max(
            [ready_ms, *(task["start_ms"] + task["length_ms"] for task in page.evaluate("window.longTasks"))]
        )


def weight(browser: Browser, address: str, path: str) -> tuple[int, int]:
    """Return the bytes (decoded) and the number of files that a page loads, without data and scene."""
    with fresh_page(browser, address) as page:
        page.goto(path)
        page.wait_for_function(_READY)
        page.wait_for_timeout(300)
        size, count = page.evaluate(_LOADED)
        return size, count


def longest_tasks_ms(page: Page, client: httpx.Client, session: str, count: int) -> dict[str, float]:
    """Return the longest task of each thing that one does with a session of many captures, in milliseconds."""
    longest: dict[str, float] = {}

    def noted(what: str) -> None:
        page.wait_for_timeout(400)
        tasks: list[dict[str, Any]] = page.evaluate("window.longTasks.splice(0)")
        longest[what] = max([task["length_ms"] for task in tasks], default=0.0)

    table = page.locator("table.captures")
    page.goto(f"/sessions/{session}")
    expect(table).to_have_attribute("aria-rowcount", str(count + 1))
    noted("open")
    table.locator("tr[data-key]").nth(3).get_by_role("button").first.click()
    noted("pick a capture")
    page.locator(".work").evaluate("(work) => { work.scrollTop = work.scrollHeight; }")
    noted("scroll to the end")
    *_, seen, last = [one["id"] for one in client.get(f"/sessions/{session}/captures?limit=1000").json()["items"]]
    client.patch(f"/sessions/{session}/captures/{seen}", json={"excluded": True})
    expect(page.get_by_role("checkbox", name=f"Use {seen}")).not_to_be_checked()
    noted("leave one out, elsewhere")
    client.delete(f"/sessions/{session}/captures/{last}")
    expect(table).to_have_attribute("aria-rowcount", str(count))
    noted("delete one, elsewhere")
    job = wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"])
    assert job["status"] == "done", job["error"]
    expect(page.locator("sc-rail .answer")).to_contain_text("±")
    noted("a result arrives")
    page.get_by_role("tab", name="Result").click()
    noted("show the result")
    page.locator(".plot-captures .dot").nth(40).click()
    noted("pick in the plot")
    page.get_by_role("tab", name="Measure").click()
    noted("back to the captures")
    return longest


def run(full: bool) -> list[Row]:
    """Return the page's figures; `full` opens it nine times cold instead of five, and adds each task."""
    rounds = 9 if full else 5
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=BROWSER_ARGUMENTS)
        settings = Settings(data=Path(folder) / "sessions", port=0, warm_up=False)
        with serving(settings) as client:
            rows = _rows(browser, client, rounds, full)
        browser.close()
    return rows


def _rows(browser: Browser, client: httpx.Client, rounds: int, full: bool) -> list[Row]:
    address = str(client.base_url).removesuffix("/api/v1/")
    small, large = simulated_session(client, captures=10), many_captures(client, 200)
    paths = {
        "start": "/",
        "session, 10 captures": f"/sessions/{small}",
        "session, 200 captures": f"/sessions/{large}",
    }
    rows: list[Row] = []
    for name, path in paths.items():
        times_ms = [time_to_interactive_ms(browser, address, path) for _ in range(rounds)]
        middle_ms = statistics.median(times_ms)
        shown = f"{middle_ms:.0f} ms (worst {max(times_ms):.0f})"
        rows.append(Row(f"time to interactive, cold: {name}", "≤ 1 s", shown, middle_ms <= _TTI_LIMIT_MS))
    for name, path in list(paths.items())[:2]:
        size, files = weight(browser, address, path)
        rows.append(
            Row(
                f"weight without scene: {name.split(',')[0]}",
                "≤ 300 kB",
                f"{size / 1000:.0f} kB, {files} files",
                size <= _WEIGHT_LIMIT_BYTES,
            )
        )
    with fresh_page(browser, address) as page:
        tasks_ms = longest_tasks_ms(page, client, large, 200)
    worst = max(tasks_ms, key=lambda name: tasks_ms[name])
    shown = f"{tasks_ms[worst]:.0f} ms ({worst})"
    rows.append(Row("200 captures: longest task", "≤ 100 ms", shown, tasks_ms[worst] <= _TASK_LIMIT_MS))
    if full:
        rows += [Row(f"  {name}", "", f"{length_ms:.0f} ms") for name, length_ms in tasks_ms.items()]
    return rows
