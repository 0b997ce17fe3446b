"""From a result or a drop to the repaired answer in the real Chromium: how many actions mend a mistake."""

import json
import tempfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import httpx
from harness import Row
from playwright.sync_api import FilePayload, Page, expect, sync_playwright
from wrong_poses import reordered, rewritten, writer

from calib_core.archive.archive import pack_files
from calib_core.records import Session
from calib_core.simulation import simulate
from server.settings import Settings
from tests.server.live_server import make_session, serving
from tests.web.browsing import BROWSER_ARGUMENTS, CHROMIUM, leave_out_the_scene

MOST_ACTIONS = 3
_MADE = simulate("tcp", 5)
_RIGHT: Session = rewritten(_MADE.session, "fanuc", writer("fanuc", 1.0, False))


def _with_cell(**cell: Any) -> Session:
    record = _RIGHT.to_json()
    record["cell"].update(cell)
    return Session.model_validate(record)


def _moved_sphere() -> Session:
    """Return the session with the sphere pushed before its last four captures: their poses are off by as much."""
    record = _RIGHT.to_json()
    for capture in record["captures"][-4:]:
        capture["pose"] = [v + off for v, off in zip(capture["pose"][:3], (4.0, -3.0, 2.0), strict=True)] + (
            capture["pose"][3:]
        )
    return Session.model_validate(record)


def _in_metres() -> dict[str, bytes]:
    """Return the files with their numbers in metres and without the header that tells the unit."""
    files: dict[str, bytes] = {}
    for name, content in _MADE.files.items():
        rows = [line.split(",") for line in content.decode().splitlines()[1:] if line.strip()]
        files[name] = "\n".join(
            ",".join(f"{float(v) / 1000:.8f}" if v else "" for v in row) for row in rows
        ).encode()
    return files


_SWAPPED = [*range(6), 9, 7, 8, 6, *range(10, len(_RIGHT.captures))]
SESSIONS: dict[str, Callable[[], tuple[Session, dict[str, bytes]]]] = {
    "wrong convention": lambda: (rewritten(_MADE.session, "kuka", writer("fanuc", 1.0, False)), _MADE.files),
    "poses in metres": lambda: (rewritten(_MADE.session, "fanuc", writer("fanuc", 1000.0, False)), _MADE.files),
    "files in metres": lambda: (_RIGHT, _in_metres()),
    "swapped poses": lambda: (reordered(_RIGHT, _SWAPPED), _MADE.files),
    "moved sphere": lambda: (_moved_sphere(), _MADE.files),
    "wrong diameter": lambda: (_with_cell(sphere_diameter_mm=_RIGHT.cell.sphere_diameter_mm / 2), _MADE.files),
}


def stored(client: httpx.Client, session: Session, files: dict[str, bytes]) -> str:
    """Store a session of any origin; return its id."""
    archive = BytesIO()
    named = {name: files[name] for capture in session.captures for name in capture.files}
    pack_files(session, {"session.json": json.dumps(session.to_json()).encode(), **named}, archive, "real")
    answer = client.post("/archives", content=archive.getvalue(), headers={"Content-Type": "application/zip"})
    assert answer.status_code == 201, answer.text
    return answer.json()["id"]


def mended(page: Page, client: httpx.Client, name: str) -> tuple[int, str]:
    """Mend a named session in the page; return after how many actions, and the verdict of the repaired answer."""
    session = stored(client, *SESSIONS[name]())
    page.goto(f"/sessions/{session}#tcp")
    page.locator("sc-guide h1").wait_for()
    page.locator("sc-actions .solve").click()  # this is how one comes to the result, or to its refusal
    apply = page.locator("sc-actions .remedies button").first
    apply.wait_for(timeout=120_000)
    actions = 0
    while apply.is_visible() and actions < MOST_ACTIONS:
        actions += 1
        apply.click()
        # Looked for in every frame: a quick solve is over before `expect` looks again.
        page.wait_for_function("() => document.querySelector('sc-actions .job')?.checkVisibility()")
        expect(page.locator("sc-actions .job")).to_be_hidden(timeout=120_000)
        page.wait_for_timeout(500)
    return actions, client.get(f"/sessions/{session}/results/tcp").json()["verdict"]


def without_poses(page: Page, client: httpx.Client) -> tuple[int, str]:
    """Drop files without poses, give them theirs, and solve."""
    cell = {key: value for key, value in _RIGHT.to_json()["cell"].items() if key != "turntable"}
    session = make_session(client, cell=cell)
    page.goto(f"/sessions/{session}")
    page.locator("sc-guide h1").wait_for()
    files = [
        FilePayload(name=f"{c.id}.csv", mimeType="text/csv", buffer=_MADE.files[c.files[0]])
        for c in _RIGHT.captures
    ]
    page.locator("sc-intake input[type=file]").first.set_input_files(files)  # one
    lines = [" ".join([c.id, *(str(v) for v in c.pose or [])]) for c in _RIGHT.captures]
    page.get_by_label("Poses, one line per capture").fill("\n".join(lines))  # two
    page.get_by_role("button", name="Add and solve").click()  # three
    expect(page.locator(".answer-card")).to_be_visible(timeout=120_000)
    return 3, client.get(f"/sessions/{session}/results/tcp").json()["verdict"]


def run(full: bool) -> list[Row]:
    """Return one row for each mistake."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=BROWSER_ARGUMENTS)
        with serving(Settings(data=Path(folder) / "sessions", port=0, warm_up=False)) as client:
            client.timeout = 300
            address = str(client.base_url).split("/api/")[0]
            for name in [*SESSIONS, "no poses"]:
                context = browser.new_context(base_url=address, viewport={"width": 1280, "height": 720})
                leave_out_the_scene(context)
                page = context.new_page()
                page.set_default_timeout(60_000)
                try:
                    actions, verdict = (
                        without_poses(page, client) if name == "no poses" else mended(page, client, name)
                    )
                    good = actions <= MOST_ACTIONS and verdict != "fail"
                    rows.append(Row(name, f"≤ {MOST_ACTIONS} actions", f"{actions}, then '{verdict}'", good))
                except Exception as error:  # the row says what stood in the way
                    seen = page.locator("sc-actions, sc-toasts").all_inner_texts()
                    rows.append(Row(name, f"≤ {MOST_ACTIONS} actions", f"{error!r:.200} {seen}", False))
                context.close()
        browser.close()
    return rows
