"""The cell as a picture of its chain: parts are added and moved by mouse and keyboard, and stored."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
from playwright.sync_api import Page, expect

from calib_core.optics.board_print import board_sheet, sheet_pdf, sheet_svg
from calib_core.records import Board
from calib_core.simulation import require_scenario
from tests.server.live_server import simulated_session, wait_for

Open = Callable[..., tuple[Page, object]]


def new_cell(open_page: Open) -> Page:
    page, _ = open_page("/")
    page.get_by_role("button", name="Select files").or_(
        page.locator(".way-cards button.primary").nth(1)
    ).first.click()
    page.get_by_label("Robot", exact=True).select_option("abb")
    page.get_by_label("Sphere diameter in mm").fill("40")
    return page


def stored_cell(page: Page, address: str) -> dict[str, Any]:
    page.get_by_role("button", name="Create session").click()
    page.wait_for_url(re.compile(r"/sessions/"))
    session = page.url.rsplit("/", 1)[1].partition("#")[0]
    return httpx.get(f"{address}/api/v1/sessions/{session}", trust_env=False).json()["cell"]


def test_a_plain_cell_needs_no_chain(open_page: Open, address: str) -> None:
    page = new_cell(open_page)
    assert not {"scanners", "spheres", "axes", "arrangement"} & set(stored_cell(page, address))


def test_a_board_is_printed_and_told_as_it_is_measured(open_page: Open, address: str, tmp_path: Path) -> None:
    page = new_cell(open_page)
    page.locator("summary", has_text="Calibration board").click()
    page.get_by_role("button", name="Print this board").click()
    expect(page.get_by_label("Columns")).to_have_attribute("aria-invalid", "true")
    for name, value in (("Columns", "9"), ("Rows", "6"), ("Pitch in mm", "20")):
        page.get_by_label(name, exact=True).fill(value)
    with page.expect_download() as download:
        page.get_by_role("button", name="Print this board").click()
    download.value.save_as(tmp_path / "board.pdf")
    assert download.value.suggested_filename == "board.pdf"
    board = Board(kind="chessboard", columns=9, rows=6, pitch_mm=20.0)
    assert (tmp_path / "board.pdf").read_bytes() == sheet_pdf(board_sheet(board))
    with page.expect_download() as download:
        page.get_by_role("button", name="Save this board as a drawing").click()
    download.value.save_as(tmp_path / "board.svg")
    assert download.value.suggested_filename == "board.svg"
    assert (tmp_path / "board.svg").read_bytes() == sheet_svg(board_sheet(board))
    measured = (("Pitch in mm", "20.02"), ("Pitch along a column in mm", "19.97"))
    for name, value in (*measured, ("Standard uncertainty of the pitch in mm", "0.005")):
        page.get_by_label(name, exact=True).fill(value)
    told = {"pitch_mm": 20.02, "pitch_y_mm": 19.97, "pitch_sigma_mm": 0.005}
    assert stored_cell(page, address)["board"].items() >= told.items()


def test_parts_are_added_dragged_and_moved_by_keyboard(open_page: Open, address: str, axe: str) -> None:
    page = new_cell(open_page)
    page.locator("summary", has_text="Chain of the cell").click()
    for name in ("Add rotary axis", "Add linear axis", "Add scanner", "Add ball"):
        page.get_by_role("button", name=name, exact=True).click()
    ball, axis = (page.locator(f'[data-part="{one}"] .box').bounding_box() for one in ("ball:ball2", "axis1"))
    assert ball is not None
    assert axis is not None
    page.mouse.move(ball["x"] + 40, ball["y"] + 10)
    page.mouse.down()
    page.mouse.move(axis["x"] + 30, axis["y"] + 8, steps=6)
    page.mouse.up()
    expect(page.get_by_role("button", name="Ball ball2, on Rotary axis axis1")).to_be_visible()
    # By keyboard: from the ball to the flange, down to the second scanner, and into base.
    page.get_by_role("button", name="Scanner scanner1, on Flange").focus()
    page.keyboard.press("ArrowDown")
    chosen = page.get_by_role("button", name="Scanner scanner2, on Flange")
    expect(chosen).to_have_attribute("aria-pressed", "true")
    expect(chosen).to_be_focused()
    page.keyboard.press("Enter")
    expect(page.get_by_label("Name", exact=True).first).to_be_focused()
    page.get_by_label("Stands on").select_option("base")
    expect(page.get_by_role("button", name="Scanner scanner2, on Base")).to_be_visible()
    page.locator('[data-part="rail1"]').click()
    page.get_by_label("Carries").select_option("robot")
    expect(page.get_by_role("button", name="Robot, on Linear axis rail1")).to_be_visible()
    page.evaluate(axe)
    found = page.evaluate("axe.run('sc-chain-picture', {resultTypes: ['violations']}).then((r) => r.violations)")
    assert [(v["id"], [n["html"] for n in v["nodes"]]) for v in found] == []
    cell = stored_cell(page, address)
    assert cell["scanners"] == {"scanner1": {"on": "tool0"}, "scanner2": {"on": "base"}}
    assert cell["spheres"] == [{"name": "ball1", "on": "base"}, {"name": "ball2", "on": "axis1"}]
    assert [(axis["name"], axis["carries"], axis["on"]) for axis in cell["axes"]] == [
        ("axis1", "object", "base"), ("rail1", "robot", "base"),
    ]  # fmt: skip


def test_what_is_known_of_axes_and_balls_is_told_and_kept(open_page: Open, address: str) -> None:
    page = new_cell(open_page)
    table = page.get_by_label("The part or the sphere is on a turntable")
    page.locator("summary", has_text="More").last.click()
    expect(table).to_be_visible()
    page.locator("summary", has_text="Chain of the cell").click()
    page.get_by_role("button", name="Add rotary axis").click()
    expect(table).to_be_hidden()
    page.get_by_label("Sense of its angles").select_option("-1")
    page.get_by_label("Readings").select_option("exact")
    page.get_by_label("Standard deviation of the reading, °").fill("0,004")
    page.keyboard.press("Shift+Tab")
    expect(page.get_by_label("Readings")).to_be_focused()  # what is told moves nothing under the hands
    page.get_by_role("button", name="Add ball").click()
    page.get_by_label("Distance to ball1 in mm").fill("120.013")
    page.get_by_label("Its standard uncertainty to ball1, mm").fill("0.002")
    page.get_by_label("Name", exact=True).first.fill("far")
    page.keyboard.press("Tab")
    cell = stored_cell(page, address)
    axis = {"name": "axis1", "kind": "rotary", "carries": "object", "on": "base"}
    assert cell["axes"] == [axis | {"direction": -1, "encoder": "exact", "sigma_deg": 0.004}]
    assert cell["sphere_distances"] == [{"between": ["far", "ball1"], "mm": 120.013, "sigma_mm": 0.002}]
    assert "turntable" not in cell
    page.get_by_role("button", name="Edit cell").click()
    page.locator("[data-part='ball:far']").click()
    expect(page.get_by_label("Distance to ball1 in mm")).to_have_value("120.013")
    page.locator("[data-part='axis1']").click()
    page.get_by_label("Readings").select_option("")
    page.get_by_role("button", name="Save", exact=True).click()
    expect(page.get_by_role("dialog")).to_have_count(0)
    session = page.url.rsplit("/", 1)[1].partition("#")[0]
    after = httpx.get(f"{address}/api/v1/sessions/{session}", trust_env=False).json()["cell"]
    assert after == cell | {"axes": [axis | {"direction": -1, "sigma_deg": 0.004}]}


def test_the_page_lists_simulated_cells_that_there_are(open_page: Open) -> None:
    source = (Path(__file__).resolve().parents[2] / "web" / "pages" / "start.js").read_text(encoding="utf-8")
    names = re.findall(r'"([a-z-]+)"', source.split("OTHER_CELLS = ")[1].split("]")[0])
    assert len(names) >= 20
    for name in names:
        require_scenario(name)
    page, _ = open_page("/")
    page.get_by_label("Another simulated cell").select_option("rail-positioner")
    page.get_by_role("button", name="Start", exact=True).click()
    page.wait_for_url(re.compile(r"/sessions/"))


def test_a_cell_is_planned_and_simulated_by_its_edges(open_page: Open, address: str, axe: str) -> None:
    page, _ = open_page("/", width=390)
    page.get_by_role("button", name="Plan or simulate a cell").click()
    dialog = page.get_by_role("dialog", name="Plan or simulate a cell")
    dialog.locator("summary", has_text="Chain of the cell").click()
    dialog.get_by_role("button", name="Add rotary axis").click()
    dialog.get_by_role("button", name="Add scanner", exact=True).click()
    dialog.get_by_label("Stands on").select_option("base")
    box = dialog.get_by_role("button", name="Scanner scanner2, on Base").bounding_box()
    assert box is not None
    assert box["height"] >= 24  # a finger's width, on a phone too
    dialog.get_by_role("button", name="Plan", exact=True).click()
    known = dialog.get_by_role("table").filter(has=page.get_by_text("Known by these captures"))
    for title in ("Scanner scanner1 on the flange", "Scanner scanner2 in base", "Rotary axis axis1"):
        row = known.get_by_role("row", name=title)
        expect(row).to_contain_text(re.compile(r"±\s*[\d.]+\s*mm.*±\s*[\d.]+\s*°"), timeout=120_000)
    page.evaluate(axe)
    found = page.evaluate("axe.run('dialog', {resultTypes: ['violations']}).then((r) => r.violations)")
    assert [(v["id"], [n["html"] for n in v["nodes"]]) for v in found] == []
    dialog.get_by_role("button", name="Simulate this cell").click()
    page.wait_for_url(re.compile(r"/sessions/"))
    expect(page.locator("[data-step=turntable]")).to_contain_text("Rotary axis axis1")
    session = page.url.rsplit("/", 1)[1].partition("#")[0]
    cell = httpx.get(f"{address}/api/v1/sessions/{session}", trust_env=False).json()["cell"]
    assert {name: one["on"] for name, one in cell["scanners"].items()} == {"scanner1": "tool0", "scanner2": "base"}
    assert [(axis["name"], axis["kind"]) for axis in cell["axes"]] == [("axis1", "rotary")]


def test_an_export_asks_what_the_answer_has(open_page: Open, address: str) -> None:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as api:
        for scenario, labels, scanners in (
            ("fixed-scanner", ["User frame of a scanner that stands still"], []),
            (
                "scanners-on-flange-and-base",
                ["Scanner", "Tool in the controller", "User frame of a scanner that stands still"],
                ["all", "arm", "gate"],
            ),
        ):
            session = simulated_session(api, captures=28 if scanners else 14, scenario=scenario)
            assert wait_for(api, api.post(f"/sessions/{session}/solve/tcp").json()["id"])["status"] == "done"
            page, _ = open_page(f"/sessions/{session}#tcp.result")
            page.locator(".export-menu").select_option("abb")
            dialog = page.get_by_role("dialog", name=re.compile("ABB"))
            expect(dialog.locator("label")).to_have_text(labels)
            assert dialog.locator("option").all_inner_texts() == scanners
            with page.expect_download() as download:
                dialog.get_by_role("button", name="Save file").click()
            written = Path(download.value.path()).read_text(encoding="utf-8")
            assert ("PERS tooldata" in written, "PERS wobjdata fScanner" in written) == (bool(scanners), True)
