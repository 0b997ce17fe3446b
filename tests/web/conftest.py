"""A real Chromium on the real server."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from server.settings import Settings
from tests.server.live_server import serving
from tests.web.browsing import SharedProfile, Watch, Watched

# The start page draws the simulated cell's seed by lot; here it is always 7.
_SAME_CELL = "if (window === window.top) Math.random = () => 0.00065;"


@pytest.fixture(scope="session")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a server that all tests share; each makes its own sessions."""
    settings = Settings(data=tmp_path_factory.mktemp("sessions"), port=0, warm_up=False)
    with serving(settings) as client:
        yield str(client.base_url).removesuffix("/api/v1/")


@pytest.fixture(scope="session")
def shared_profile(chromium: Browser, address: str) -> SharedProfile:
    return SharedProfile(chromium, address, _SAME_CELL)


@pytest.fixture
def profile(shared_profile: SharedProfile, watch: Watch) -> Iterator[SharedProfile]:
    """The profile that tests take in turn, watched and empty."""
    watch.follow(shared_profile.context)
    yield shared_profile
    shared_profile.clear()


@pytest.fixture
def open_page(profile: SharedProfile, browser: Browser, address: str) -> Callable[..., tuple[Page, Watched]]:
    """Open a page at a path of the server, with or without the 3-D scene; a second one in a browser of its own."""
    lent: list[SharedProfile] = []

    def begin(path: str = "/", scene: bool = False, width: int = 1280, height: int = 800) -> tuple[Page, Watched]:
        lent.append(profile if not lent else SharedProfile(browser, address, _SAME_CELL))
        page = lent[-1].open(scene=scene, size=(width, height))
        watched = Watched(page)
        page.goto(path)
        return page, watched

    return begin


@pytest.fixture(scope="session")
def axe() -> str:
    """The accessibility checker's script."""
    return (Path(__file__).parent / "vendor" / "axe" / "axe.min.js").read_text(encoding="utf-8")
