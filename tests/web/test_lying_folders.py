"""Twelve folders as programs leave them, dropped whole on the page: every file listed, solved, nothing lost."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from playwright.sync_api import Page, expect

from calib_core.robots import parse_pose
from tests.lying_folders import DIAMETER_MM, MATRICES, SPHERE, folders
from tests.web.browsing import Hand

pytestmark = pytest.mark.browser
MOST_ACTIONS = 3
FOLDERS = folders()


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        yield client


def drop(page: Page, folder: Path) -> None:
    """Drop a folder from outside, as a file manager does."""
    browser = page.context.new_cdp_session(page)
    data = {"items": [], "files": [str(folder)], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        browser.send("Input.dispatchDragEvent", {"type": kind, "x": 640, "y": 400, "data": data})


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("name", FOLDERS)
def test_a_folder_dropped_whole_is_listed_paired_and_solved(
    open_page: Callable[..., Any], api: httpx.Client, tmp_path: Path, name: str
) -> None:
    lying = FOLDERS[name]
    page, watched = open_page("/")
    expect(page.get_by_role("heading", level=1)).to_be_visible()
    drop(page, lying.lay(tmp_path / "stick"))
    hand = Hand(page)
    create = page.get_by_role("button", name="Create session")
    expect(create).to_be_visible(timeout=60_000)
    if SPHERE in lying.files.values():
        expect(page.get_by_label("Sphere diameter in mm", exact=True)).to_have_value(f"{DIAMETER_MM:g}")
    else:
        hand.fill("Sphere diameter", f"{DIAMETER_MM:g}")
    assert page.get_by_label("Robot", exact=True).input_value() == lying.convention
    hand.click("Create session")
    shown = page.locator("sc-file-list tbody tr td:first-child")
    expect(shown).to_have_count(len(lying.files))
    assert {one.partition("/")[2] for one in shown.all_text_contents()} == set(lying.files)
    paired = page.locator("sc-file-list").get_by_text(re.compile(rf"^{len(lying.measurements)} measurements with"))
    expect(paired).to_be_visible()
    hand.click("Add and solve")
    expect(page.locator("#answer-title")).to_be_visible(timeout=120_000)
    assert hand.actions <= MOST_ACTIONS
    session = page.url.rsplit("/", 1)[1].partition("#")[0].partition("?")[0]
    stored = api.get(f"/sessions/{session}/captures?limit=1000").json()["items"]
    measured = {Path(path).stem: k for path, k in lying.measurements.items()}
    assert {one["id"] for one in stored} == set(measured)
    for one in stored:
        pose = parse_pose(lying.convention, one["pose"]).matrix
        np.testing.assert_allclose(pose, MATRICES[measured[one["id"]]].matrix, atol=2e-3)
    assert api.get(f"/sessions/{session}/results/tcp").json()["verdict"] != "fail"
    assert watched.complaints == []
