"""A real Chromium on the real server."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from server.settings import Settings
from tests.server.live_server import serving
from tests.web.browsing import Watched, leave_out_the_scene

# The start page draws the simulated cell's seed by lot; here it is always 7.
_SAME_CELL = "if (window === window.top) Math.random = () => 0.00065;"


@pytest.fixture(scope="session")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a server that all tests share; each makes its own sessions."""
    settings = Settings(data=tmp_path_factory.mktemp("sessions"), port=0, warm_up=False)
    with serving(settings) as client:
        yield str(client.base_url).removesuffix("/api/v1/")


@pytest.fixture
def open_page(browser: Browser, address: str) -> Iterator[Callable[..., tuple[Page, Watched]]]:
    """Open a page in a browser profile of its own, at a path of the server, with or without the 3-D scene."""
    contexts = []

    def begin(path: str = "/", scene: bool = False, width: int = 1280, height: int = 800) -> tuple[Page, Watched]:
        context = browser.new_context(viewport={"width": width, "height": height}, color_scheme="light")
        if not scene:
            leave_out_the_scene(context)
        context.grant_permissions(["clipboard-read", "clipboard-write"])
        context.set_default_timeout(30_000)
        context.add_init_script(_SAME_CELL)
        contexts.append(context)
        page = context.new_page()
        watched = Watched(page)
        page.goto(address + path)
        return page, watched

    yield begin
    for context in contexts:
        context.close()


@pytest.fixture(scope="session")
def axe() -> str:
    """The accessibility checker's script."""
    return (Path(__file__).parent / "vendor" / "axe" / "axe.min.js").read_text(encoding="utf-8")
