"""A random walk of 5,000 actions through the page in the real Chromium: no console error, no dead end."""

import tempfile
from pathlib import Path

import httpx
from harness import Row
from playwright.sync_api import Browser, sync_playwright

from server.settings import Settings
from tests.server.live_server import serving, simulated_session, wait_for
from tests.web.browsing import BROWSER_ARGUMENTS, CHROMIUM, leave_out_the_scene
from tests.web.random_walk import Walk, walk


def session_to_walk_in(client: httpx.Client) -> str:
    """Return a simulated session with captures, of which one was spoiled, and a result."""
    session = simulated_session(client, captures=14, scenario="tcp-moved-sphere")
    wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"])
    return session


def walk_from(browser: Browser, client: httpx.Client, actions: int, seed: int) -> Walk:
    """Walk in a session of its own, in a browser profile of its own."""
    address = str(client.base_url).split("/api/")[0]
    context = browser.new_context(
        base_url=address, viewport={"width": 1280, "height": 800}, reduced_motion="reduce"
    )
    leave_out_the_scene(context)
    context.grant_permissions(["clipboard-read", "clipboard-write"])
    page = context.new_page()
    page.set_default_timeout(30_000)
    try:
        return walk(page, f"/sessions/{session_to_walk_in(client)}", actions, seed)
    finally:
        context.close()


def run(full: bool) -> list[Row]:
    """Return the walk's rows; `full` does 5,000 actions instead of 500, in ten sessions."""
    walks = 10 if full else 1
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=BROWSER_ARGUMENTS)
        with serving(Settings(data=Path(folder) / "sessions", port=0, warm_up=False)) as client:
            found = [walk_from(browser, client, 500, seed) for seed in range(1, walks + 1)]
        browser.close()
    actions = sum(one.actions for one in found)
    kinds = sum((one.used for one in found), start=found[0].used.__class__())
    problems = [problem for one in found for problem in one.problems]
    shown = f"{actions} actions ({', '.join(f'{n} {what}' for what, n in kinds.most_common(6))})"
    rows = [Row("random walk: console errors and dead ends", "none", f"{len(problems)} in {shown}", not problems)]
    return rows + [Row(f"  {problem[:400]}", "", "") for problem in problems[:10]]
