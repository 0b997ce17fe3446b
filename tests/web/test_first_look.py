"""The first view of a result: answer, verdict and next action without scrolling, in few words."""

import json
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import expect

from calib_core.archive.archive import pack_files
from calib_core.records import Session
from tests.real.conftest import data_folder  # noqa: F401 — the fixture
from tests.server.live_server import simulated_session, wait_for
from tests.web.first_look import first_look

pytestmark = pytest.mark.browser


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        yield client


def real_session(client: httpx.Client, folder: Path, **cell: Any) -> str:
    """Store a session folder with some fields of its cell set otherwise; return its id."""
    record = json.loads((folder / "session.json").read_text(encoding="utf-8"))
    record["cell"].update(cell)
    session = Session.model_validate(record)
    files = {name: (folder / name).read_bytes() for capture in session.captures for name in capture.files}
    archive = BytesIO()
    pack_files(session, {"session.json": json.dumps(record).encode(), **files}, archive, "real")
    answer = client.post("/archives", content=archive.getvalue(), headers={"Content-Type": "application/zip"})
    assert answer.status_code == 201, answer.text
    return answer.json()["id"]


def solve(client: httpx.Client, session: str, stage: str) -> None:
    job = wait_for(client, client.post(f"/sessions/{session}/solve/{stage}").json()["id"], timeout_s=300)
    assert job["status"] == "done", job


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("convention", "verdict", "action"), [("fanuc", "warn", "Add captures"), ("kuka", "fail", "Set convention")]
)
def test_a_real_set_rightly_and_wrongly_read(
    open_page: Callable[..., Any],
    api: httpx.Client,
    data_folder: Path,  # noqa: F811
    convention: str,
    verdict: str,
    action: str,
) -> None:
    session = real_session(api, data_folder / "tcp-sphere-80mm", pose_convention=convention)
    solve(api, session, "tcp")
    assert api.get(f"/sessions/{session}/results/tcp").json()["verdict"] == verdict
    page, watched = open_page(f"/sessions/{session}#tcp.result", width=1280, height=720)
    page.locator("sc-actions button", has_text=action).first.wait_for()
    look = first_look(page)
    assert look.problems == []
    assert look.main[0].startswith(action)
    assert watched.complaints == []


def test_a_simulated_set_with_a_capture_left_out(open_page: Callable[..., Any], api: httpx.Client) -> None:
    session = simulated_session(api, captures=14, scenario="tcp-moved-sphere")
    solve(api, session, "tcp")
    page, watched = open_page(f"/sessions/{session}#tcp.result", width=1280, height=720)
    look = first_look(page)
    assert look.problems == []
    assert look.main == ["Capture the sphere"]  # what mends an amber result, without the key that does it
    page.locator(".messages summary").first.click()
    page.get_by_role("button", name="What this means").first.click()
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_role("heading", level=2)).to_have_text("captures-contradict")
    expect(dialog).to_contain_text("How it is decided")
    assert watched.complaints == []
