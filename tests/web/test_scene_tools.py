"""The page's controls of the scene, with the scene itself: views, layers, turning, picking by click, pictures."""

from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Frame, Page, expect

from tests.server.live_server import simulated_session

pytestmark = pytest.mark.browser

DRAWN = """(name) => window.__viserSceneTree && name in window.__viserSceneTree.getState()
           && window.__viserMutable.nodeRefFromName[name] !== undefined"""
GONE = "(name) => !(name in window.__viserSceneTree.getState())"
PLACE = """(name) => {
    const { nodeRefFromName, camera } = window.__viserMutable;
    const place = nodeRefFromName[name].position.clone();
    nodeRefFromName[name].getWorldPosition(place);
    place.project(camera);
    const { clientWidth, clientHeight } = document.querySelector("canvas");
    return [(place.x + 1) / 2 * clientWidth, (1 - place.y) / 2 * clientHeight];
}"""
MOVED = """(from) => {
    const now = window.__viserMutable.camera.position.toArray();
    return Math.hypot(...now.map((value, axis) => value - from[axis])) > 0.05;
}"""
RESTS = """() => {
    const before = window.cameraBefore;
    window.cameraBefore = window.__viserMutable.camera.position.toArray().join();
    return before === window.cameraBefore;
}"""
CAMERA = "() => window.__viserMutable.camera.position.toArray()"


def scene_of(page: Page) -> Frame:
    for _ in range(200):
        found = [frame for frame in page.frames if "/viewers/" in frame.url]
        if found:
            return found[0]
        page.wait_for_timeout(100)
    raise AssertionError("the scene's page is not loaded")


@pytest.mark.thorough
def test_the_page_and_its_scene(open_page: Callable[..., Any], address: str, tmp_path: Path) -> None:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as api:
        session = simulated_session(api, captures=3)
        page, watched = open_page(f"/sessions/{session}", scene=True, width=1000, height=600)
        page.set_default_timeout(90_000)  # software rendering on a busy machine draws a frame a second
        scene = scene_of(page)
        scene.wait_for_function(DRAWN, arg="/frames/p03/flange")
        scene.wait_for_function(DRAWN, arg="/ghost/flange")

        # A view moves this page's camera.
        before = np.array(scene.evaluate(CAMERA))
        page.locator("sc-scene select[aria-label=View]").select_option("Top")
        scene.wait_for_function(MOVED, arg=before.tolist())
        scene.wait_for_function(RESTS, polling=500)  # where a flange is seen moves with it

        # A click on a flange picks its capture in the table.
        x, y = scene.evaluate(PLACE, "/frames/p02/flange")
        box = page.locator("sc-scene iframe").bounding_box()
        assert box is not None
        page.mouse.move(box["x"] + x, box["y"] + y)
        page.wait_for_timeout(300)
        page.mouse.click(box["x"] + x, box["y"] + y, delay=60)
        expect(page.locator("table.captures tr.picked")).to_contain_text("p02", timeout=120_000)

        # A layer that is switched off goes; playing turns to the next capture, alone.
        # Only what there is can be chosen: no turntable, no cloud, no camera yet.
        views = page.locator("sc-scene select[aria-label=View] option").all_inner_texts()
        assert views[1:] == ["Captures", "Cell", "Top", "Side"]
        page.locator(".scene-layers summary", has_text="Layers").click()
        expect(page.locator(".scene-layer-list").first).not_to_contain_text("Turntable")
        page.get_by_label("Labels").set_checked(False)
        scene.wait_for_function("window.__viserSceneTree.getState()['/labels'].overrideVisibility === false")
        page.keyboard.press("Escape")
        page.get_by_role("group", name="Scene").get_by_role("button", name="Play").click()
        scene.wait_for_function(GONE, arg="/ghost/flange")
        expect(page.locator("table.captures tr.picked")).not_to_contain_text("p02")
        page.get_by_role("button", name="Stop").click()
        scene.wait_for_function(DRAWN, arg="/ghost/flange")

        page.locator(".scene-layers summary", has_text="Save").click()
        with page.expect_download() as saved:
            page.get_by_role("button", name="Image", exact=True).click()
        picture = np.array(Image.open(BytesIO(Path(saved.value.path()).read_bytes())))
        assert picture.shape[2] == 4
        assert abs(picture.shape[1] - box["width"]) <= 1
        assert len(np.unique(picture.reshape(-1, 4), axis=0)) > 50
        with page.expect_download() as saved:
            page.get_by_role("link", name="Offline page").click()
        text = Path(saved.value.path()).read_text(encoding="utf-8")
        assert saved.value.suggested_filename.endswith(".html")
        assert "scancell-legend" in text

        # The scene of the past belongs to the reviewing page alone, and follows its time line.
        page.goto(f"{address}/sessions/{session}/review")
        past = scene_of(page)
        past.wait_for_function(DRAWN, arg="/frames/p03/flange")
        slider = page.get_by_role("slider")
        slider.focus()
        slider.press("Home")
        past.wait_for_function(GONE, arg="/frames/p02/flange")
        assert past.evaluate(DRAWN, "/frames/p01/flange")
    assert watched.complaints == []


@pytest.mark.thorough
def test_what_is_not_there_is_refused(address: str) -> None:
    with httpx.Client(base_url=address, timeout=300, trust_env=False) as client:
        session = client.post("/api/v1/sessions", json={"cell": {"pose_convention": "ur"}}).json()["id"]
        controls = client.get(f"/scenes/{session}/controls").json()
        assert {"ghost", "frames"} <= {layer["name"] for layer in controls["layers"]}
        assert client.get("/scenes/none/controls").status_code == 404
        assert client.get("/scenes/none/page").status_code == 404
        refused = {
            f"/scenes/{session}/layers": {"name": "nothing", "shown": True},
            f"/scenes/{session}/viewers/abcdefgh/view": {"view": "Nowhere"},
        }
        for path, body in refused.items():
            assert client.post(path, json=body).status_code == 422, path
        closed = {
            f"/scenes/{session}/layers": {"name": "frames", "shown": False},
            f"/scenes/{session}/turn": {"capture": None},
            f"/scenes/{session}/moment": {"place": 0},
            f"/scenes/{session}/viewers/abcdefgh/view": {"view": "Top"},
        }
        for path, body in closed.items():
            assert client.post(path, json=body).status_code == 404, path
        assert client.post(f"/scenes/{session}.abcd/moment", json={"place": 0}).status_code == 204
        assert client.get(f"/scenes/{session}/viewers/abcdefgh/picture").status_code == 404
        assert client.get(f"/scenes/{session}/viewers/abcdefgh/picture?width=99999").status_code == 422
