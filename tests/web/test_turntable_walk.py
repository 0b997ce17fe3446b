"""From the simulated cell with a turntable to the merged part, doing what the page says."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from calib_core.simulation.part import build_part
from tests.point_files import mesh_file
from tests.web.browsing import LOADED, go_on, in_language, leave_out_the_scene, look_into_the_merge, take_one
from tests.web.first_look import first_look

pytestmark = pytest.mark.browser

PICTURES = os.environ.get("SCANCELL_PICTURES")  # a folder for pictures of what was walked through


def picture(page: Page, name: str) -> None:
    if PICTURES:
        for theme in ("light", "dark"):
            page.evaluate(f"document.documentElement.dataset.theme = '{theme}'")
            page.screenshot(path=Path(PICTURES) / f"{name}-{theme}.png", full_page=True)


def open_step(page: Page, step: str) -> None:
    page.locator(f"sc-rail [data-step={step}]").click()
    expect(page.locator("sc-rail [aria-current=step]")).to_have_attribute("data-step", step)


def violations(page: Page) -> list[tuple[str, str]]:
    found = page.evaluate("axe.run('sc-session', {resultTypes: ['violations']})")["violations"]
    return [(one["id"], one["nodes"][0]["html"]) for one in found]


def start_the_merge_and_cancel_it(page: Page) -> None:
    """Progress names the scan that is being merged; after the cancel everything is as it was."""
    page.evaluate("""() => {
        window.told = [];
        const job = document.querySelector("sc-actions .job");
        const options = { subtree: true, childList: true, characterData: true };
        new MutationObserver(() => window.told.push(job.innerText)).observe(job, options);
    }""")
    page.locator("sc-actions .solve").click()
    merging = re.compile("Cleaning and merging|Gathering the points|Building the mesh")
    expect(page.locator("sc-actions .job")).to_contain_text(merging)
    page.get_by_role("button", name="Cancel").click()
    assert any(re.search(r"Cleaning and merging v\d\d", words) for words in page.evaluate("window.told"))
    expect(page.locator("sc-toasts")).to_contain_text("The merge was cancelled.")
    expect(page.locator("sc-guide h1")).to_have_text("Merge the 12 scans.")


def require_a_good_first_look(page: Page) -> None:
    assert first_look(page, all_done=True).problems == []
    page.set_viewport_size({"width": 1400, "height": 1000})


def require_a_light_first_look(page: Page) -> None:
    """The heaviest result, in the language with the longest words; what lies below comes when it is near."""
    other = page.context.new_page()
    other.set_viewport_size({"width": 1280, "height": 720})
    leave_out_the_scene(other)
    in_language(other, "de-DE")
    other.goto(page.url)
    expect(other.locator(".evidence-plot svg").first).to_be_attached()
    size, travelled = other.evaluate(LOADED)
    assert size < 300_000
    assert travelled < 150_000
    other.close()


def look_into_the_merged_part(page: Page, axe: str) -> None:
    """The result of the merge: how far scans lie apart, the files, colours, a section, deviations."""
    page.get_by_role("tab", name="Result").click()
    require_a_good_first_look(page)
    require_a_light_first_look(page)
    apart = page.get_by_role("region", name="How far scans lie apart").locator("dd").all_inner_texts()
    measured, expected = (float(text.split()[0]) for text in apart[:2])  # µm
    assert 0.5 < measured / expected < 1.5
    expect(page.locator("details", has_text="Each scan").locator("tbody tr")).to_have_count(12)
    for name in ("XYZ", "E57"):  # which are made in the tests of clouds
        expect(page.get_by_role("link", name=name, exact=True)).to_have_attribute("href", re.compile(name.lower()))
    for name in ("PCD", "STL"):
        with page.expect_download() as saved:
            page.get_by_role("link", name=name, exact=True).click()
        assert saved.value.path().stat().st_size > 500_000
    look_into_the_merge(page)
    page.get_by_label("by deviation").check()
    expect(page.locator("sc-merged")).to_contain_text("No reference mesh yet")
    page.get_by_label("Deviation from").select_option("sphere")
    page.get_by_label("Diameter in mm").fill("20")
    expect(page.locator("sc-merged")).to_contain_text("the sphere, diameter 20.000 mm as known")
    page.get_by_label("Section").select_option("z")
    where = page.get_by_label("Position")
    where.focus()
    with page.expect_request(lambda request: request.url.endswith("/cloud")) as shown:
        for _ in range(20):
            where.press("ArrowRight")
    assert shown.value.post_data_json["section"]["axis"] == "z"
    expect(page.locator("sc-merged .section-plot .dots").first).to_be_attached()
    part = build_part()
    mesh = mesh_file("stl", part.points_mm, part.triangles)
    page.get_by_label("Deviation from").select_option("mesh")
    page.get_by_label("Add reference mesh").set_input_files(
        {"name": "part.stl", "mimeType": "model/stl", "buffer": mesh}
    )
    expect(page.locator("sc-merged")).to_contain_text("Distance to the reference mesh")
    off = page.locator("sc-merged dl dd").first.inner_text()
    assert 30 < float(off.split()[0]) < 400, off  # µm: what the calibration leaves uncertain
    picture(page, "merge-result")
    page.evaluate(axe)
    page.emulate_media(reduced_motion="reduce")
    for theme in ("dark", "light"):
        page.evaluate(f"document.documentElement.dataset.theme = '{theme}'")
        assert violations(page) == []


@pytest.mark.thorough
def test_the_page_leads_to_the_whole_chain_and_the_merged_part(open_page: Callable[..., Any], axe: str) -> None:
    page, watched = open_page(width=1400, height=1000)
    page.get_by_role("button", name="With a turntable").click()
    instruction = page.locator("sc-guide h1")
    expect(instruction).not_to_be_empty(timeout=120_000)  # the part and its scans are simulated first
    taken, solved, seen = 0, [], []
    while "Merge" not in solved:
        assert taken < 70, instruction.text_content()
        words = str(instruction.text_content())
        if words.startswith(("Solve", "Verify", "Merge")):
            if words.startswith("Merge"):
                start_the_merge_and_cancel_it(page)
            page.locator("sc-actions .solve").click()
            expect(instruction).not_to_have_text(words, timeout=300_000)
            expect(page.locator("#view-result")).to_be_visible()
            expect(page.locator(".answer-card")).to_contain_text("accepted")
            solved.append(page.locator("#answer-title").inner_text())
            assert len(solved) <= 5, solved
            go_on(page)
            continue
        seen.append(words)
        take_one(page)
        taken += 1
        if taken == 20:
            picture(page, "turntable-measure")
        go_on(page)
    assert solved == ["TCP", "Turntable", "Whole chain", "Verify", "Merge"]
    # Seven angles are asked for by number at each height, and a second height; then eleven of the part.
    assert sum("Turn the table to about" in words and "sphere" in words for words in seen) == 14
    assert sum("another height" in words for words in seen) == 1
    assert len({words for words in seen if "scan the object there" in words}) == 11
    open_step(page, "turntable")
    page.get_by_role("tab", name="Measure").click()
    expect(page.get_by_role("button", name=re.compile(r"Table at t09: 0° · high"))).to_be_visible()

    open_step(page, "merge")
    look_into_the_merged_part(page, axe)
    open_step(page, "chain")
    require_a_good_first_look(page)
    frame = page.get_by_role("region", name="Turntable in the robot's base")
    numbers = frame.locator(".frame-numbers dd").all_inner_texts()
    assert len(numbers) == 7  # the simulated cell speaks ABB's x y z q1 q2 q3 q4
    for number in numbers:
        assert re.fullmatch(r"−?\d+(\.\d+)?\s±\s\d+(\.\d+)?(\s?mm)?", number), number
    # Two figures in millimetres for each of 16 captures.
    wobble = page.get_by_role("region", name="Wobble", exact=True).locator(".dot")
    expect(wobble).to_have_count(32)
    expect(page.get_by_role("heading", name="Joint answer beside the paper's circles")).to_be_visible()
    expect(page.locator("sc-rail .answer")).to_have_count(5)
    picture(page, "chain-result")
    page.evaluate(axe)
    assert violations(page) == []
    wobble.first.press("Enter")
    open_step(page, "turntable")
    expect(page.locator(".answer-card")).to_contain_text("Turntable")
    picture(page, "turntable-result")

    # A wrong angle is corrected where it stands, and everything that rests on it is out of date.
    page.get_by_role("tab", name="Measure").click()
    page.get_by_role("button", name=re.compile("Table at t01")).click()
    page.get_by_label("Table angle in degrees").fill("0.02")
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("button", name=re.compile(r"Table at t01: 0.020°"))).to_be_visible()
    expect(page.locator("sc-rail .status-stale")).to_contain_text(["Turntable", "Scan", "Merge"])
    assert watched.complaints == []
