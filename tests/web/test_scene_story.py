"""The scene tells the step's story: its layers, a view that the subject fills, labels apart, no legend on it."""

from collections.abc import Callable
from typing import Any

import httpx
import pytest
from playwright.sync_api import expect

from tests.server.live_server import simulated_session, wait_for
from tests.web.moments import moment, scene_frame

pytestmark = pytest.mark.browser


@pytest.mark.thorough
def test_measuring_and_its_result_have_their_own_layers_and_views(
    open_page: Callable[..., Any], address: str
) -> None:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as api:
        session = simulated_session(api, captures=12)
        assert wait_for(api, api.post(f"/sessions/{session}/solve/tcp").json()["id"])["status"] == "done"
    page, watched = open_page(f"/sessions/{session}#tcp", scene=True, width=1100, height=640)
    page.set_default_timeout(120_000)
    scene = scene_frame(page)
    scene.wait_for_function("() => window.scancellScene.layers().frames")
    measuring = moment(page, ["frames", "ghost"])
    assert measuring.problems == []
    assert measuring.labels > 3
    # A page around the scene makes its own words of what the server tells all who look, and may tell more later.
    for word in ("pose ", "view "):
        scene.evaluate("(word) => window.scancellScene.speak((text) => text.replace(/^p(?=[0-9])/, word))", word)
        scene.wait_for_function("() => window.scancellScene.labels().length > 3")
        begins = "(word) => window.scancellScene.labels().some((label) => label.text.startsWith(word))"
        scene.wait_for_function(begins, arg=word)
    page.get_by_role("tab", name="Result").click()
    scene.wait_for_function("() => !window.scancellScene.layers().frames")
    result = moment(page, ["sphere"])
    assert result.problems == []
    assert scene.evaluate("() => window.scancellScene.layers().points")
    expect(scene.locator("#scancell-legend")).to_contain_text("uncertainty, k = 2")
    assert watched.complaints == []
