"""What the browser's tests share: pages that are watched, and pages without the scene."""

import re
import shutil
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any, cast
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, Request, expect

BROWSER_ARGUMENTS = [
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-gpu-rasterization",
    "--disable-gpu-compositing",
    "--enable-features=NetworkServiceInProcess2",  # a page asks for a hundred files: a tenth less of the processor
    "--process-per-site",  # a page beside another of the same server is drawn by a process that is warm
]
CHROMIUM = shutil.which("chromium-headless-shell") or shutil.which("chromium")
"""Chromium without its own windows and menus, where it is installed: a page costs a fifth less."""

LOADED = """() => {
    const files = performance.getEntriesByType("resource").filter((one) => !/[/](api|scenes)[/]/.test(one.name));
    const sum = (name) => files.reduce((all, one) => all + one[name], 0);
    return [sum("decodedBodySize"), sum("encodedBodySize")];
}"""
"""Bytes of the files that a page has loaded, without data and scene: unpacked, and as they travelled."""

_ROWS = "(count) => document.querySelectorAll('table.captures tbody tr').length === count"
_NO_SCENE = """{
  const address = Object.getOwnPropertyDescriptor(HTMLIFrameElement.prototype, "src");
  const set = function (to) { if (!String(to).includes("/scenes/")) address.set.call(this, to); };
  Object.defineProperty(HTMLIFrameElement.prototype, "src", { ...address, set });
}"""

_SLOW_SCENE = """if (location.pathname.includes("/scenes/")) {
  window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 150);
  window.cancelAnimationFrame = clearTimeout;
}"""

_SLOW_PREVIEWS = """{
  const send = WebSocket.prototype.send;
  WebSocket.prototype.send = function (words) {
    if (words !== "next") send.call(this, words);
    else setTimeout(() => { if (this.readyState === WebSocket.OPEN) send.call(this, words); }, 200);
  };
}"""


class Watch:
    """Watches all pages of a test: none may ask another server than its own, or complain unannounced."""

    def __init__(self) -> None:
        self.complaints: list[str] = []
        self.foreign: list[str] = []
        self._announced: list[str] = []
        self._allowed: list[str] = []
        self._followed: list[tuple[BrowserContext, str, Callable[[Any], None]]] = []

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

        hear: dict[str, Callable[[Any], None]] = {
            "console": lambda m: (
                self.complaints.append(f"{m.text} {m.location['url']}") if m.type == "error" else None
            ),
            "weberror": lambda error: self.complaints.append(str(error.error)),
            "request": lambda request: asked(request.url),
            "page": lambda page: page.on("websocket", lambda socket: asked(socket.url)),
        }
        for event, heard in hear.items():
            context.on(cast(Any, event), heard)
            self._followed.append((context, event, heard))
        return context

    def leave(self) -> None:
        """Watch no longer: the profile may serve another test."""
        for context, event, heard in self._followed:
            context.remove_listener(event, heard)
        self._followed.clear()

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
    made: list[BrowserContext] = []

    def context(**options: Any) -> BrowserContext:
        made.append(watch.follow(make(**options)))
        return made[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(browser, "new_context", context)
        patch.setattr(browser, "new_page", lambda **options: context(**options).new_page())
        yield watch
        for left in made:  # what they still have to say is heard as well
            left.close()
    watch.leave()
    watch.require_quiet()


class SharedProfile:
    """A browser profile that tests take in turn.

    What it keeps of the page's files, and the process that draws them, stay; what a test leaves in it goes. A
    profile of its own loads and compiles everything anew, which takes longer than most tests.

    Parameters
    ----------
    browser : Browser
    address : str
        The server that most tests ask.
    script : str
        What every page runs before its own scripts.
    """

    def __init__(self, browser: Browser, address: str, script: str) -> None:
        self.context = browser.new_context(base_url=address)
        self.context.grant_permissions(["clipboard-read", "clipboard-write"])
        self.context.add_init_script(script)
        self._home = self.context.new_page()
        self._home.route("**/favicon.ico", lambda route: route.fulfill(status=204))
        self._home.goto("/web/icon.svg")

    def open(self, path: str = "", scene: bool = False, size: tuple[int, int] = (1280, 800), **media: Any) -> Page:
        """Open a page in a window of its own, with the 3-D scene or without; empty without a path."""
        self.context.set_default_timeout(120_000)
        page = self.context.new_page()
        page.set_viewport_size({"width": size[0], "height": size[1]})
        emulated: dict[str, Any] = {"color_scheme": "light", **media}
        page.emulate_media(**emulated)
        page.add_init_script(_SLOW_PREVIEWS)  # of a live cell: drawn in software, twenty a second fill a processor
        if scene:
            draw_the_scene_seldom(page)
        else:
            leave_out_the_scene(page)
        if path:
            page.goto(path)
        return page

    def clear(self) -> None:
        """Close the pages that were opened and forget what they kept."""
        for page in self.context.pages:
            if page is not self._home:
                page.close()
        self.context.unroute_all()
        self.context.set_offline(False)
        self.context.clear_cookies()
        self._home.evaluate("window.localStorage.clear()")


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


class Hand:
    """Does what a person does, and counts it."""

    def __init__(self, page: Page) -> None:
        self.page, self.actions = page, 0

    def press(self, key: str) -> None:
        self.actions += 1
        self.page.keyboard.press(key)

    def click(self, name: str) -> None:
        self.actions += 1
        self.page.get_by_role("button", name=re.compile(f"^{name}")).first.click()

    def fill(self, label: str, text: str) -> None:
        self.actions += 1
        self.page.get_by_label(label).fill(text)

    def choose(self, label: str, value: str) -> None:
        self.actions += 1
        self.page.get_by_label(label).select_option(value)


def leave_out_the_scene(where: BrowserContext | Page) -> None:
    """Leave the scene's frame empty: drawing it in software takes most of a test's time."""
    where.add_init_script(_NO_SCENE)


def draw_the_scene_seldom(where: BrowserContext | Page) -> None:
    """Have the scene drawn six times a second, as slow machines do, instead of sixty times."""
    where.add_init_script(_SLOW_SCENE)


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
    """Take a capture of the step that is open and wait until table and guide have it; return how many there are.

    Both show what came with one load: the guide first, then the table.
    """
    before = page.locator("table.captures tbody tr").count()
    page.locator("sc-actions .capture").click()
    # The first one waits for the kernels; asked in every frame, for `expect` looks but once a second.
    page.wait_for_function(_ROWS, arg=before + 1, timeout=300_000)
    return before + 1


def look_into_the_merge(page: Page) -> None:
    """Scroll to the merged part, whose inspector loads when it is near; also where the page is drawn meanwhile."""
    page.wait_for_function(
        "() => { document.getElementById('merge-files')?.scrollIntoView();"
        " return document.querySelector('sc-merged')?.childElementCount > 0; }"
    )


def in_language(page: Page, language: str) -> None:
    """Have a page's browser ask for a language, such as `de-DE`, from its next address on."""
    agent = {"userAgent": page.evaluate("navigator.userAgent"), "acceptLanguage": language}
    page.context.new_cdp_session(page).send("Emulation.setUserAgentOverride", agent)
