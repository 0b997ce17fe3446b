"""What the browser's tests share: pages that are watched, and pages without the scene."""

import re
from collections.abc import Generator
from contextlib import contextmanager, suppress
from typing import Any
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, Request, expect
from playwright.sync_api import TimeoutError as PlaywrightTimeout

BROWSER_ARGUMENTS = [
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-gpu-rasterization",
    "--disable-gpu-compositing",
]
_TOLD_ANEW = "(told) => document.querySelector('.guide-words')?.textContent !== told"
_NO_SCENE = '<meta name="color-scheme" content="light dark"><title>no scene</title>'
_SCENE = re.compile(r"/scenes/[^/]+/(viewers/[^/]+/)?(\?.*)?$")


class Watch:
    """Watches all pages of a test: none may ask another server than its own, or complain unannounced."""

    def __init__(self) -> None:
        self.complaints: list[str] = []
        self.foreign: list[str] = []
        self._announced: list[str] = []
        self._allowed: list[str] = []

    def announce(self, pattern: str) -> None:
        """Say beforehand that pages will complain like this: the browser writes down each request that fails."""
        self._announced.append(pattern)

    def allow(self, pattern: str) -> None:
        """Say beforehand that pages may complain like this: it depends on which moment a server goes away in."""
        self._allowed.append(pattern)

    def follow(self, context: BrowserContext) -> BrowserContext:
        """Watch a profile's pages; the server that the first of them asks is its own."""
        own: list[str] = []

        def asked(url: str) -> None:
            parts = urlsplit(url)
            if parts.scheme in ("data", "blob", "about"):
                return
            own.append(parts.netloc)
            if parts.netloc != own[0] or parts.hostname != "127.0.0.1":
                self.foreign.append(url)

        context.on("console", lambda m: self.complaints.append(m.text) if m.type == "error" else None)
        context.on("weberror", lambda error: self.complaints.append(str(error.error)))
        context.on("request", lambda request: asked(request.url))
        context.on("page", lambda page: page.on("websocket", lambda socket: asked(socket.url)))
        return context

    def require_quiet(self) -> None:
        """Fail where a page asked elsewhere, complained unannounced, or did not complain as announced."""
        expected = [*self._announced, *self._allowed]
        unannounced = [c for c in self.complaints if not any(re.search(p, c) for p in expected)]
        missing = [p for p in self._announced if not any(re.search(p, c) for c in self.complaints)]
        if self.foreign or unannounced or missing:
            said = f"asked elsewhere: {self.foreign}; complained: {unannounced}; did not complain of: {missing}"
            raise AssertionError(said)


@contextmanager
def watching(browser: Browser) -> Generator[Watch]:
    """Watch every page that is opened in a browser meanwhile, and fail at the end where one was not quiet."""
    watch = Watch()
    make = browser.new_context

    def context(**options: Any) -> BrowserContext:
        return watch.follow(make(**options))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(browser, "new_context", context)
        patch.setattr(browser, "new_page", lambda **options: context(**options).new_page())
        yield watch
        for left in browser.contexts:  # what they still have to say is heard as well
            left.close()
    watch.require_quiet()


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


def leave_out_the_scene(context: BrowserContext) -> None:
    """Put an empty page in the scene's place: drawing it in software takes most of a test's time."""
    context.route(_SCENE, lambda route: route.fulfill(body=_NO_SCENE, content_type="text/html"))


def go_on(page: Page) -> bool:
    """Press the button that leads to the next step, where there is one; tell whether there was."""
    on = page.locator("sc-actions").get_by_role("button", name=re.compile("^Continue with "))
    if not on.is_visible():
        return False
    step = str(on.text_content()).removeprefix("Continue with ")
    on.click()
    expect(page.locator("sc-rail [aria-current=step]")).to_contain_text(step)
    return True


def take_one(page: Page) -> int:
    """Take a capture of the step that is open and wait until the guide has seen it; return how many there are.

    Where the guide asks for the same again (a shift too short to count), its words stay as they are.
    """
    rows, told = page.locator("table.captures tbody tr"), page.locator(".guide-words").text_content()
    before = rows.count()
    page.locator("sc-actions .capture").click()
    expect(rows).to_have_count(before + 1, timeout=120_000)  # the first one waits for the kernels
    with suppress(PlaywrightTimeout):
        page.wait_for_function(_TOLD_ANEW, arg=told, timeout=4_000)
    return before + 1
