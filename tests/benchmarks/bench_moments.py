"""Moments of the scene in the real Chromium: how much of the view the subject fills, labels, the legend."""

import tempfile
from pathlib import Path

from harness import Row
from playwright.sync_api import sync_playwright

from server.settings import Settings
from tests.server.live_server import serving
from tests.web.browsing import BROWSER_ARGUMENTS, CHROMIUM
from tests.web.moments import LEAST_FILL, MOMENTS, Album


def run(full: bool) -> list[Row]:
    """Return one row a moment; in full all of them, otherwise those of the TCP."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=BROWSER_ARGUMENTS)
        with serving(Settings(data=Path(folder), port=0, warm_up=False)) as client:
            client.timeout = 400
            album = Album(client, browser)
            for name, told in MOMENTS.items():
                if not full and told.scenario != "tcp":
                    continue
                found = album.look_at(name)
                target = f"≥ {LEAST_FILL:.0%}, no overlap" if told.subject else "no overlap"
                shown = f"{found.fill:.0%}, {found.labels} labels {'; '.join(found.problems)}"
                rows.append(Row(name, target, shown, not found.problems))
        browser.close()
    return rows
