"""A real Chromium on the real server; pages that remember what they complained about and whom they asked."""

import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, Request, expect, sync_playwright

from server.settings import Settings
from tests.server.live_server import serving

_SCENE = re.compile(r"/scenes/[^/]+/(\?.*)?$")
_ARGUMENTS = [
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--disable-background-networking",
]


class Watched:
    """What a page complained about, and which hosts it asked."""

    def __init__(self, page: Page) -> None:
        self.complaints: list[str] = []
        self.hosts: set[str] = set()
        page.on("console", lambda m: self.complaints.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("request", self._asked)
        page.on("websocket", lambda socket: self.hosts.add(urlsplit(socket.url).netloc))

    def _asked(self, request: Request) -> None:
        if urlsplit(request.url).scheme not in ("data", "blob"):
            self.hosts.add(urlsplit(request.url).netloc)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    expect.set_options(timeout=30_000)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=_ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a server that all tests share; each makes its own sessions."""
    settings = Settings(data=tmp_path_factory.mktemp("sessions"), port=0, warm_up=False)
    with serving(settings) as client:
        yield str(client.base_url).removesuffix("/api/v1/")


def leave_out_the_scene(context: BrowserContext) -> None:
    """Put an empty page in the scene's place: drawing it in software takes most of a test's time."""
    context.route(_SCENE, lambda route: route.fulfill(body="<title>no scene</title>", content_type="text/html"))


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
