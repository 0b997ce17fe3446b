"""What the browser's tests share: pages that are watched, and pages without the scene."""

import re
from urllib.parse import urlsplit

from playwright.sync_api import BrowserContext, Page, Request

BROWSER_ARGUMENTS = [
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--disable-background-networking",
]
_SCENE = re.compile(r"/scenes/[^/]+/(viewers/[^/]+/)?(\?.*)?$")


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
    context.route(_SCENE, lambda route: route.fulfill(body="<title>no scene</title>", content_type="text/html"))
