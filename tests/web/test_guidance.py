"""A cell's plan, the error budget at a picked point, planned poses as a program, in a real Chromium."""

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.core.test_certificate import certificate, quantity
from tests.server.live_server import simulated_session, wait_for
from tests.web.browsing import SharedProfile, Watch
from tests.web.test_accessible import violations

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def session(address: str) -> Iterator[str]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as api:
        made = simulated_session(api, captures=30, scenario="turntable")
        assert wait_for(api, api.post(f"/sessions/{made}/solve/chain").json()["id"])["status"] == "done"
        yield made


@pytest.fixture
def page(profile: SharedProfile) -> Page:
    return profile.open(reduced_motion="reduce")


def test_a_cell_is_planned_from_the_start_page(page: Page, watch: Watch, address: str, axe: str) -> None:
    page.goto(f"{address}/")
    page.get_by_role("button", name="Plan or simulate a cell").click()
    dialog = page.get_by_role("dialog", name="Plan or simulate a cell")
    dialog.get_by_label("Sphere diameter, mm").fill("30")
    dialog.get_by_label("Wanted ± at the workpiece, mm").fill("0,3")
    dialog.get_by_role("button", name="Plan", exact=True).click()
    expect(dialog.get_by_text("±0.3 mm at the workpiece takes a certified sphere of 30 mm")).to_be_visible(
        timeout=120_000
    )
    assert violations(page, axe) == []
    watch.announce("status of 422")
    dialog.get_by_label("Width where it begins, mm").fill("2")
    dialog.get_by_role("button", name="Plan", exact=True).click()
    expect(dialog.get_by_role("alert")).to_contain_text("smaller sphere", timeout=120_000)
    dialog.get_by_label("Noise of a point, mm").fill("some")
    dialog.get_by_role("button", name="Plan", exact=True).click()
    assert dialog.get_by_label("Noise of a point, mm").evaluate("e => e.validationMessage") == "Enter a number."


def test_the_spheres_certificate_fills_the_new_cell(page: Page, address: str) -> None:
    page.goto(f"{address}/")
    page.get_by_role("button", name="New session").first.click()
    page.get_by_text("More", exact=True).click()
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Read the sphere's digital certificate …").click()
    file = {"name": "dcc.xml", "mimeType": "text/xml", "buffer": certificate(quantity("Diameter of the sphere"))}
    chooser.value.set_files([file])  # type: ignore[list-item]
    expect(page.locator("input[name=diameter]")).to_have_value("38.0997")
    expect(page.locator("input[name=diameter_sigma]")).to_have_value("0.0002")


@pytest.mark.thorough
def test_a_point_is_picked_in_the_field_of_the_budget(
    page: Page, watch: Watch, address: str, session: str, axe: str
) -> None:
    page.goto(f"{address}/sessions/{session}#chain.result")
    page.get_by_role("button", name="Error budget …").click()
    dialog = page.get_by_role("dialog", name="Error budget")
    field = dialog.get_by_role("img", name="Uncertainty over the table")
    expect(field).to_be_visible(timeout=120_000)
    expect(dialog.get_by_role("rowheader", name="Axis under the object")).to_be_visible()
    before = dialog.locator("#budget-x").input_value()
    field.click(position={"x": 40, "y": 120})
    expect(dialog.locator("#budget-x")).not_to_have_value(before)
    assert float(dialog.locator("#budget-x").input_value()) < 0
    assert violations(page, axe) == []
    watch.announce("status of 422")
    dialog.locator("#budget-x").fill("1e99")
    dialog.get_by_role("button", name="Show").click()
    expect(dialog.get_by_role("alert")).to_be_visible()


@pytest.mark.thorough
def test_planned_poses_are_saved_as_a_program(
    page: Page, address: str, session: str, axe: str, tmp_path: Path
) -> None:
    page.goto(f"{address}/sessions/{session}#chain.result")
    page.get_by_role("button", name="Planned poses …").click()
    dialog = page.get_by_role("dialog", name="Planned poses")
    dialog.get_by_label("Captures").fill("3")
    dialog.get_by_role("button", name="Plan", exact=True).click()
    expect(dialog.get_by_role("rowheader", name="3", exact=True)).to_be_visible(timeout=120_000)
    dialog.get_by_label("Controller").select_option("kuka")
    assert violations(page, axe) == []
    with page.expect_download() as download:
        dialog.get_by_role("button", name="Save as program").click()
    assert download.value.suggested_filename == "planned-tcp.src"
    download.value.save_as(tmp_path / "program")
    assert (tmp_path / "program").read_text().count("HALT") == 9
