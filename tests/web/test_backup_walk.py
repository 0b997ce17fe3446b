"""From a backup and a folder of profiles to the tool in a copy of that backup: at most eight actions."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from playwright.sync_api import Page, expect

from calib_core.robots import parse_pose, to_pose
from calib_core.robots.backup import read_controller_files
from calib_core.simulation import simulate
from tests.core.robot_dialects import CONFIG
from tests.server.live_server import make_session
from tests.web.browsing import Hand

pytestmark = pytest.mark.browser

MOST_ACTIONS = 8
MADE = simulate("tcp", 11)
RECORD: Any = MADE.session.to_json()


@pytest.fixture
def backup(tmp_path: Path) -> Path:
    """A folder as people have it: a KUKA program with its points, the tools, and a profile for each point."""
    folder = tmp_path / "cell 4"
    folder.mkdir()
    lines = ["DEFDAT MEASURE"]
    for number, capture in enumerate(RECORD["captures"], start=1):
        pose = to_pose("kuka", parse_pose(RECORD["cell"]["pose_convention"], capture["pose"]))
        fields = ",".join(f"{name} {value!r}" for name, value in zip("XYZABC", pose, strict=True))
        motion = '{TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " "}'
        lines += [f"DECL E6POS XP{number}={{{fields},S 2,T 3,E1 0.0}}", f"DECL FDAT FP{number}={motion}"]
        (folder / f"p{number:02d}.csv").write_bytes(MADE.files[capture["files"][0]])
    (folder / "measure.dat").write_text("\n".join([*lines, "ENDDAT", ""]))
    (folder / "$config.dat").write_text(CONFIG)
    return folder


@pytest.mark.thorough
def test_from_a_backup_to_a_patched_backup(open_page: Callable[..., Any], backup: Path, tmp_path: Path) -> None:
    page, watched = open_page("/")
    hand = Hand(page)
    hand.actions += 1
    page.locator("sc-start input[webkitdirectory]").set_input_files(backup)
    hand.fill("Sphere diameter", str(RECORD["cell"]["sphere_diameter_mm"]))
    assert page.get_by_label("Robot", exact=True).input_value() == "kuka"
    hand.click("Create session")
    count = len(RECORD["captures"])
    shown = page.get_by_role("region", name="Poses from the controller's files")
    expect(shown).to_contain_text(f"kuka (proved by real files): {count} poses, 2 tools")
    expect(page.get_by_role("region", name="How the scanner files are read")).to_contain_text("profile, ")
    hand.click(f"Add {count} captures")
    expect(page.locator(".captures tbody tr")).to_have_count(count)
    hand.click("Solve the TCP")
    hand.click("Write into backup")
    hand.choose("Tool to replace", "1")
    with page.expect_download() as download:
        hand.click("Save patched copy")
    assert hand.actions <= MOST_ACTIONS
    target = tmp_path / "saved.dat"
    download.value.save_as(target)
    assert download.value.suggested_filename.endswith("config.dat")
    before, after = CONFIG.splitlines(), target.read_text().splitlines()
    assert [i for i, pair in enumerate(zip(before, after, strict=True)) if pair[0] != pair[1]] == [2]
    tool = next(t for t in read_controller_files({"c.dat": target.read_bytes()}, "kuka").tools if t.number == 1)
    truth = np.array(MADE.truth["tool0_from_laser"])
    assert np.linalg.norm(parse_pose("kuka", tool.pose).translation_mm - truth[:3, 3]) < 2
    read_back_in_the_page(page, target, [f"{value!r}" for value in tool.pose])
    check_move_for_another_tool(page)
    assert watched.complaints == []


def read_back_in_the_page(page: Page, file: Path, numbers: list[str]) -> None:
    """The patched copy is equal to the answer, and wrongly typed numbers are explained."""
    page.get_by_role("button", name="Compare with controller").click()
    dialog = page.get_by_role("dialog", name="Compare the tool in the controller")
    said = dialog.get_by_role("status")
    compare = dialog.get_by_role("button", name="Compare")
    dialog.get_by_label("Controller file or backup").set_input_files(file)
    dialog.get_by_label("Tool in the file").select_option("1")
    compare.click()
    expect(said).to_contain_text("Equal to the digits")
    dialog.get_by_label("Tool in the file").select_option("2")
    compare.click()
    expect(said).to_contain_text("mm and")
    typed = dialog.get_by_label("Or the numbers on the pendant")
    typed.fill(" ".join([*numbers[:4], numbers[5], numbers[4]]))
    compare.click()
    expect(said).to_contain_text("B and C are swapped")
    typed.fill("")
    dialog.get_by_label("Controller file or backup").set_input_files([])
    compare.click()
    expect(said).to_be_empty()  # nothing was sent
    assert typed.evaluate("field => field.validationMessage")
    dialog.get_by_role("button", name="Close").click()
    expect(dialog).to_have_count(0)


def check_move_for_another_tool(page: Page) -> None:
    """An export that has settings asks for them."""
    page.get_by_label("Export …").select_option("kuka-check-move")
    dialog = page.get_by_role("dialog", name="KUKA: check move")
    dialog.get_by_label("Approach distance").fill("200")
    dialog.get_by_label("Tool in the controller").fill("3")
    with page.expect_download() as download:
        dialog.get_by_role("button", name="Save file").click()
    assert download.value.suggested_filename == "kuka-check-move.src"
    assert "$TOOL=TOOL_DATA[3]" in Path(download.value.path()).read_text()
    expect(dialog).to_have_count(0)


@pytest.mark.thorough
def test_a_capture_keeps_file_and_line_and_what_was_said_of_its_file(
    open_page: Callable[..., Any], address: str, backup: Path
) -> None:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as api:
        session = make_session(api, cell={**RECORD["cell"], "pose_convention": "kuka"})
        page, _ = open_page(f"/sessions/{session}")
        files = [backup / "measure.dat", backup / "p01.csv", backup / "p02.csv"]
        page.locator("sc-intake input[type=file]").first.set_input_files(files)
        shown = page.get_by_role("region", name="How the scanner files are read")
        shown.get_by_text("Read them differently").click()
        shown.get_by_label("Unit").select_option("mm")
        shown.get_by_role("button", name="Read again").click()
        expect(shown).to_contain_text("mm (as chosen)")
        page.get_by_role("button", name="Add 2 captures").click()
        expect(page.locator(".captures tbody tr")).to_have_count(2)
        stored = api.get(f"/sessions/{session}/captures").json()["items"]
        assert [c["source"] for c in stored] == ["measure.dat:2", "measure.dat:4"]
        assert [c["format_settings"] for c in stored] == [{"unit": "mm"}] * 2
