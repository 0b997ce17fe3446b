"""The merged part beside its nominal in the page: uncertainty, tolerance, distances in a section, 3-2-1."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from playwright.sync_api import Error, Page, expect

from calib_core.simulation.part import build_part
from tests.point_files import mesh_file
from tests.server.live_server import simulated_session, wait_for
from tests.web.browsing import look_into_the_merge
from tests.web.moments import scene_frame

pytestmark = pytest.mark.browser

PART = build_part()


def click_at(page: Page, across: float, up: float) -> None:
    """Click in the section's plot, by shares of its width and height."""
    plot = page.locator("sc-merged .picks")
    box = plot.bounding_box()
    assert box is not None
    plot.click(position={"x": across * box["width"], "y": up * box["height"]})


TOUCHED = (
    ("z", 5, -30.0, -32.0),
    ("z", 5, 30.0, -32.0),
    ("z", 25, 0.0, -32.0),
    ("z", 25, -48.0, -10.0),
    ("z", 5, -48.0, 15.0),
    ("x", 0, 0.0, 30.0),
)
"""Three points on the first side, two on the second, one on top: the section's axis and place, and where in it."""
ENDS = {"z": ((-48.0, -32.0), (48.0, 32.0)), "x": ((-32.0, -0.1), (32.0, 62.0))}
"""Of the part in a section across an axis."""
KEY_STEPS = 60
WIDTH, HEIGHT, MARGIN = 560, 360, 34


def section_at(page: Page, axis: str, at_mm: float) -> None:
    page.get_by_label("Section", exact=True).select_option(axis)
    page.get_by_label("Position").evaluate(
        f"(one) => {{ one.value = '{at_mm}'; one.dispatchEvent(new Event('input')); }}"
    )
    shown = re.compile(rf"across {axis} at \u2212?{at_mm}\.[01]\smm")
    expect(page.locator("sc-merged .picks")).to_have_attribute("aria-label", shown)


def click_on(page: Page, axis: str, across: float, up: float) -> None:
    """Click on a place of the section that is shown."""
    (left, bottom), (right, top) = ENDS[axis]
    scale = min((WIDTH - 2 * MARGIN) / (right - left), (HEIGHT - 2 * MARGIN) / (top - bottom))
    height = (top - bottom) * scale + 2 * MARGIN
    x, y = MARGIN + (across - left) * scale, height - MARGIN - (up - bottom) * scale
    click_at(page, x / WIDTH, y / height)


def aim_at(page: Page, axis: str, across: float, up: float) -> None:
    """Aim with the arrow keys, from the middle of the section, where they begin, or from where they were."""
    (left, bottom), (right, top) = ENDS[axis]
    step = (right - left) / KEY_STEPS
    page.locator("sc-merged .picks").focus()
    keys = page.evaluate("() => window.aimed ?? null") or [(left + right) / 2, (bottom + top) / 2]
    for off, more, less in ((across - keys[0], "ArrowRight", "ArrowLeft"), (up - keys[1], "ArrowUp", "ArrowDown")):
        for _ in range(abs(round(off / step))):
            page.keyboard.press(more if off > 0 else less)
    aimed = [now + step * round((to - now) / step) for now, to in zip(keys, (across, up), strict=True)]
    page.evaluate(f"window.aimed = {aimed}")


@pytest.mark.thorough
def test_a_part_is_measured_in_a_section_and_laid_by_six_points(
    open_page: Callable[..., Any], address: str, tmp_path: Path
) -> None:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as api:
        session = simulated_session(api, captures=12, scenario="part", seed=3)
        told = {"mesh": "none", "voxel_mm": 1.0, "tolerance_mm": 0.05}
        api.patch(f"/sessions/{session}", json={"cell": {"merge": told}}).raise_for_status()
        mesh = mesh_file("stl", PART.points_mm, PART.triangles)
        api.put(f"/sessions/{session}/merged/reference", files={"file": ("part.stl", mesh)}).raise_for_status()
        job = api.post(f"/sessions/{session}/solve/merge").json()
        assert wait_for(api, job["id"])["status"] == "done"
        page, _ = open_page(f"/sessions/{session}", width=1280, height=1000)
        page.get_by_role("tab", name="Result").click()
        page.get_by_role("button", name="Merge done").wait_for()
        look_into_the_merge(page)
        part = page.locator("sc-merged")
        page.get_by_label("by deviation").check()
        expect(part).to_contain_text("Standard uncertainty of a deviation")
        part.evaluate("(one) => { one.isTheSame = true; }")
        page.locator(".answer-card").evaluate("(one) => { one.isTheSame = true; }")
        place_px = part.bounding_box()
        api.patch(f"/sessions/{session}", json={"name": "another name"}).raise_for_status()
        page.wait_for_function("() => !document.querySelector('.answer-card').isTheSame")  # drawn anew
        assert part.evaluate("(one) => one.isTheSame"), "the inspector stays where the page is drawn anew"
        assert part.bounding_box() == pytest.approx(place_px, abs=1)
        bands = re.findall(r"(?:Within\s±|Beyond\s[+−])0\.050\smm\s*(\d+\.\d+)", part.locator("dl").inner_text())
        assert len(bands) == 3
        assert sum(map(float, bands)) == pytest.approx(100, abs=0.02)
        expect(part.locator(".limit")).to_be_attached()
        page.get_by_label("Section", exact=True).select_option("z")
        page.get_by_label("Position").evaluate(
            "(one) => { one.value = '12'; one.dispatchEvent(new Event('input')); }"
        )
        expect(part.locator(".nominal")).to_be_attached()
        expect(part).to_contain_text("Click two points")
        click_at(page, 0.1, 0.5)
        click_at(page, 0.9, 0.5)
        text = part.locator("p.number").inner_text()
        distance, *parts = map(float, re.findall(r"-?\d+\.\d+", text.replace("\u2212", "-")))
        assert distance == pytest.approx(np.linalg.norm(parts), abs=2e-3)
        assert distance > 5
        for theme in ("dark", "light"):
            page.evaluate(f"document.documentElement.dataset.theme = '{theme}'")
            part.screenshot(path=str(tmp_path / f"{theme}.png"))
        page.get_by_label("A click in plot or scene").select_option("feature")
        click_at(page, 0.5, 0.1)
        part.get_by_label("What it is").select_option("sphere")
        part.get_by_label("Radius in mm").fill("10")
        click_at(page, 0.3, 0.5)
        expect(part.get_by_label("What it is")).to_have_count(2)
        assert [one.input_value() for one in part.get_by_label("What it is").all()] == ["sphere", "plane"]
        assert [one.input_value() for one in part.get_by_label("Radius in mm").all()] == ["10", "5"]
        expect(part.get_by_role("button", name="Align by these points")).to_be_enabled()
        page.get_by_label("A click in plot or scene").select_option("datum")
        for number, (axis, at_mm, across, up) in enumerate(TOUCHED):
            section_at(page, axis, at_mm)
            if number % 2:
                aim_at(page, axis, across, up)
                page.keyboard.press("Enter")
            else:
                click_on(page, axis, across, up)
            expect(part).to_contain_text(f"{number + 1} of 6 datum points")
            expect(part.locator("ol li")).to_have_count(number + 1)
            assert part.get_by_role("button", name="Align by these points").is_disabled() == (number < 5)
        picked = [
            [float(value) for value in re.findall(r"-?\d+\.\d+", line.replace("\u2212", "-"))]
            for line in part.locator("ol li").all_inner_texts()
        ]
        assert all(
            place[2] == pytest.approx(at_mm, abs=0.2)
            for place, (_, at_mm, *_) in zip(picked[:5], TOUCHED, strict=False)
        )
        told_pose = np.array(
            api.get(f"/sessions/{session}/results/merge").json()["alignment"]["cloud_from_reference"]
        )
        with page.expect_response("**/solve/merge") as begun:
            part.get_by_role("button", name="Align by these points").click()
        stored = api.get(f"/sessions/{session}").json()["cell"]["merge"]["alignment"]
        assert stored["method"] == "3-2-1"
        there = np.array(stored["datum_points_mm"]) @ told_pose[:3, :3].T + told_pose[:3, 3]
        assert np.abs(there - picked).max() < 0.02  # they have two decimals
        assert wait_for(api, begun.value.json()["id"])["status"] == "done"
        merged = api.get(f"/sessions/{session}/results/merge").json()
        laid = merged["alignment"]
        assert (merged["verdict"], laid["method"]) == ("pass", "3-2-1")
        off = np.array(laid["cloud_from_reference"])
        turn = (off[:3, :3] - off[:3, :3].T)[[2, 0, 1], [1, 2, 0]] / 2
        stated = np.sqrt(np.diag(np.array(laid["covariance"])))
        assert np.all(np.abs([*turn, *off[:3, 3]]) < 4 * stated), "the part lies in the cloud's own frame"
        assert stated[3:].max() < 0.05


MERGED_DRAWN = """() => window.__viserSceneTree && "/scans/merged/0" in window.__viserSceneTree.getState()
                 && window.__viserMutable.nodeRefFromName["/scans/merged/0"] !== undefined"""
COLORS = """() => {
  const { colors } = window.__viserSceneTree.getState()["/scans/merged/0"].message.props;
  const of = new Set();
  for (let at = 0; at < colors.length; at += 3) of.add(colors.slice(at, at + 3).join());
  return of.size;
}"""
MARKS = """() => Object.keys(window.__viserSceneTree?.getState() ?? {})
          .filter((name) => name.startsWith("/scans/merged/picked/")).length"""


@pytest.mark.thorough
def test_points_clicked_in_the_scene_measure_and_cut(
    open_page: Callable[..., Any], address: str, tmp_path: Path
) -> None:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as api:
        session = simulated_session(api, captures=3, scenario="part", seed=3)
        api.patch(f"/sessions/{session}", json={"cell": {"merge": {"mesh": "none", "voxel_mm": 1.0}}})
        job = api.post(f"/sessions/{session}/solve/merge").json()
        assert wait_for(api, job["id"])["status"] == "done"
    page, _ = open_page(f"/sessions/{session}#merge", scene=True, width=1280, height=900)
    page.set_default_timeout(120_000)
    page.get_by_role("tab", name="Result").click()
    look_into_the_merge(page)
    page.get_by_label("by scan").check()  # before there is a scene that could be told
    scene = scene_frame(page)
    scene.wait_for_function(MERGED_DRAWN)
    scene.wait_for_function(f"() => ({COLORS})() < 20")
    part = page.locator("sc-merged")
    part.evaluate("(one) => one.scrollIntoView()")
    box = page.locator("sc-scene iframe").bounding_box()
    assert box is not None

    def click(across: float, down: float) -> None:
        page.mouse.move(box["x"] + across * box["width"], box["y"] + down * box["height"])
        page.wait_for_timeout(300)
        page.mouse.click(box["x"] + across * box["width"], box["y"] + down * box["height"], delay=60)

    def click_until(across: float, down: float, marks: int) -> None:
        for _ in range(20):
            click(across, down)
            try:
                scene.wait_for_function(f"() => ({MARKS})() === {marks}", timeout=10_000)
                return
            except Error:
                continue
        raise AssertionError(f"{marks} points are not marked")

    part.get_by_label("A click in plot or scene").select_option("measure")
    click_until(0.45, 0.4, 1)
    click_until(0.55, 0.45, 2)
    expect(part).to_contain_text(re.compile(r"Distance\s\d+\.\d+\smm"))
    page.screenshot(path=str(tmp_path / "measured.png"))
    part.get_by_label("A click in plot or scene").select_option("plane")
    for number, (across, down) in enumerate(((0.45, 0.4), (0.55, 0.45), (0.5, 0.5)), 1):
        click_until(across, down, number % 3)
    expect(page.get_by_label("Section", exact=True)).to_have_value("plane")
    expect(part.locator(".section-plot.picks")).to_have_attribute("aria-label", re.compile("the picked plane"))
    page.screenshot(path=str(tmp_path / "cut.png"))
