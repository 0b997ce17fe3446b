"""The scene in a real browser: it draws, follows, keeps to its own server and has nothing to complain about."""

import threading
from io import BytesIO
from urllib.parse import urlsplit

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Browser, Page

from server.scenes.colors import REJECTED, Rgb
from server.scenes.live import LiveScene
from server.scenes.manager import SceneManager
from server.scenes.merged import MAX_SCAN_POINTS
from server.scenes.scene_input import SceneInput
from tests.server.scene_cell import make_cell, serve_scenes
from tests.server.scene_visit import visit
from tests.server.test_scene_cloud import fused_scene
from tests.web.browsing import Watch

pytestmark = pytest.mark.browser

CELL = make_cell(count=5, points=100, rejected=("p05",))
DRAWN = """(name) => window.__viserSceneTree && name in window.__viserSceneTree.getState()
           && window.__viserMutable.nodeRefFromName[name]"""


class Watched:
    """A page, and what it said and asked for meanwhile."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.complaints: list[str] = []
        self.hosts: set[str] = set()
        page.on("console", lambda m: self.complaints.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("request", lambda request: self._asked(request.url))
        page.on("websocket", lambda socket: self._asked(socket.url))

    def _asked(self, url: str) -> None:
        if urlsplit(url).scheme not in ("data", "blob"):
            self.hosts.add(urlsplit(url).netloc)

    def picture(self) -> NDArray[np.int_]:
        """Return the screen as (rows, columns, 3) once two pictures in a row are the same."""
        before = None
        for _ in range(40):
            now = np.array(Image.open(BytesIO(self.page.screenshot())).convert("RGB")).astype(int)
            if before is not None and np.abs(now - before).max() == 0:
                return now
            before = now
            self.page.wait_for_timeout(250)
        raise AssertionError("the picture never comes to rest")


def pixels_near(picture: NDArray[np.int_], color: Rgb, within: int = 60) -> int:
    return int((np.abs(picture - np.array(color)).max(axis=2) < within).sum())


@pytest.mark.thorough
def test_the_scene_draws_follows_and_keeps_to_its_own_server(browser: Browser) -> None:
    inputs = {"s1": CELL.scene(count=4, solved=False, name="a cell")}
    manager = SceneManager(inputs.get)
    try:
        with serve_scenes(manager) as address:
            page = browser.new_page(viewport={"width": 360, "height": 320})
            page.set_default_timeout(90_000)  # software rendering on a busy machine draws a frame a second
            watched = Watched(page)
            page.goto(
                f"{address}/scenes/s1/?theme=dark&websocket=ws://192.0.2.1/evil&playbackPath=http://192.0.2.1/x"
            )
            page.wait_for_function(DRAWN, arg="/frames/p04/flange")
            flanges = watched.picture()
            assert flanges[5, 5].max() < 40  # the dark theme's ground
            assert len(np.unique(flanges.reshape(-1, 3), axis=0)) > 200
            assert "first result" in page.locator("#scancell-legend").inner_text()

            inputs["s1"] = CELL.scene(name="a cell")
            manager.refresh("s1")
            page.wait_for_function(DRAWN, arg="/sphere/solved")
            page.wait_for_function("document.getElementById('scancell-legend').innerText.includes('µm')")
            solved = watched.picture()
            assert pixels_near(solved, REJECTED) > pixels_near(flanges, REJECTED) + 10

            page.get_by_text("Layers and views").click()
            page.get_by_label("Plane of light").set_checked(False)
            page.wait_for_function("!window.__viserSceneTree.getState()['/light'].visibility")
            page.get_by_text("Layers and views").click()
            without_light = watched.picture()
            before, after = (p[50:, :, 1] - p[50:, :, 0] for p in (solved, without_light))
            assert (before - after > 3).sum() > 200  # where the fans were, it was greener
            assert watched.complaints == []
            assert watched.hosts == {urlsplit(address).netloc}
            page.close()
    finally:
        manager.stop()


@pytest.mark.thorough
def test_the_first_picture_of_a_merged_cloud_comes_and_sends_no_more_than_is_borne(browser: Browser) -> None:
    """How soon it comes, the benchmark tells."""
    rng = np.random.default_rng(8)
    points = rng.uniform(-60, 60, (MAX_SCAN_POINTS + 300_000, 3))
    points[:, 2] = 20 + 5 * np.sin(points[:, 0] / 10)
    seen = visit(browser, fused_scene(points))
    assert MAX_SCAN_POINTS <= seen.points <= 1_000_000


@pytest.mark.thorough
def test_a_viewer_comes_back_by_itself_after_the_server_was_away(browser: Browser) -> None:
    manager = SceneManager({"s1": CELL.scene(count=2, solved=False)}.get)
    try:
        with serve_scenes(manager) as address:
            page = browser.new_page(viewport={"width": 300, "height": 240})
            page.set_default_timeout(90_000)
            page.goto(f"{address}/scenes/s1/?theme=light")
            page.wait_for_function(DRAWN, arg="/frames/p02/flange")
            with manager.viewing("s1") as before:
                manager.close("s1")
            page.wait_for_timeout(200)
            page.bring_to_front()
            for _ in range(100):
                if "s1" in manager:
                    break
                page.wait_for_timeout(100)
            with manager.viewing("s1") as after:
                assert after is not before
            page.close()
    finally:
        manager.stop()


@pytest.mark.thorough
def test_a_page_says_that_its_scene_is_loading_and_a_client_without_its_server_does_not_hurry(
    browser: Browser, watch: Watch, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Chromium holds back a page's connections after a dozen that failed: tries each second would never end."""
    may_open = threading.Event()

    def slowly(scene: SceneInput) -> LiveScene:
        may_open.wait(120)
        return LiveScene(scene)

    monkeypatch.setattr("server.scenes.manager.LiveScene", slowly)
    manager = SceneManager({"s1": CELL.scene(count=4, solved=False)}.get)
    page = browser.new_page(viewport={"width": 360, "height": 320})
    page.set_default_timeout(90_000)
    tries: list[str] = []
    page.on("console", lambda said: tries.append(said.text) if said.text.startswith("Connecting to") else None)
    try:
        with serve_scenes(manager) as address:
            page.goto(f"{address}/scenes/s1/legend")
            page.evaluate(
                "document.body.append(Object.assign(document.createElement('iframe'), { src: '/scenes/s1/' }))"
            )
            page.locator("iframe.waiting").wait_for()
            page.wait_for_timeout(8000)  # the client gives up after 5 s what was not let in
            assert page.locator("iframe.waiting").count() == 1
            assert len(tries) == 1
            may_open.set()
            page.locator("iframe:not(.waiting)").wait_for()
        watch.allow("Failed to load resource|WebSocket connection")
        tries.clear()
        page.wait_for_timeout(9000)
        assert 1 <= len(tries) <= 2
    finally:
        may_open.set()
        manager.stop()
        page.close()
