"""Walks that provoke problems: which ones they meet, what the page must say, and the picture that each leaves.

`SCANCELL_PICTURE=1 python -m pytest tests/web -k problem` writes `docs/images/problems/*.png`.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import httpx
from PIL import Image
from playwright.sync_api import Error as PlaywrightError
from playwright.sync_api import Locator, Page, Response, expect

from tests.web.browsing import SharedProfile

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "images" / "problems"
TAKE_PICTURES = "SCANCELL_PICTURE" in os.environ
COLORS = 64

PROVOKED: set[str] = set()
"""Types of the server's catalogue, and names of the page's texts/problems.json, that some walk meets."""


def provokes(*names: str) -> Callable[[Any], Any]:
    """Note which entries of the catalogues a walk meets."""
    PROVOKED.update(names)
    return lambda walk: walk


class Visitor:
    """A page, and the problems that the server answered it."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self._answers: list[Response] = []
        page.on("response", self._heard)

    def _heard(self, answer: Response) -> None:
        if "problem+json" in answer.headers.get("content-type", ""):
            self._answers.append(answer)

    @property
    def toast(self) -> Locator:
        return self.page.locator(".toast.bad").last

    @property
    def rows(self) -> Locator:
        return self.page.locator("table.captures tbody tr")

    def told(self, kind: str, where: Locator | None = None) -> dict[str, Any]:
        """Return the last problem of a type, once the page says what was needed, what was there, what to do."""
        where = where or self.toast
        expect(where).to_be_visible()
        bodies = [body for body in map(_body_of, self._answers) if body]
        found = [body for body in bodies if body["type"].endswith(f":{kind}")]
        assert found, f"no {kind} among {[answer.status for answer in self._answers]}"
        require_said(found[-1], where)
        return found[-1]

    def picture(self, name: str) -> None:
        """Leave a picture of what is seen, where pictures were asked for."""
        if not TAKE_PICTURES:
            return
        FOLDER.mkdir(parents=True, exist_ok=True)
        self.page.wait_for_timeout(300)
        image = Image.open(BytesIO(self.page.screenshot())).convert("RGB")
        image.quantize(COLORS).save(FOLDER / f"{name}.png", optimize=True)


def _body_of(answer: Response) -> dict[str, Any] | None:
    """Return an answer's body; None where the browser has forgotten it, as of a scene's frame that has gone."""
    try:
        return answer.json()
    except PlaywrightError:
        return None


def require_said(problem: dict[str, Any], where: Locator) -> None:
    """Require that the page says all of a problem; a status alone or an outage has no need of its own."""
    parts = [problem["got"], problem["to_do"]]
    if not problem["type"].rsplit(":", 1)[1].startswith(("http-", "unavailable")):
        parts.append(problem["need"])
    for part in parts:
        assert part
        expect(where).to_contain_text(part, ignore_case=True)


def site_of(client: httpx.Client) -> str:
    return str(client.base_url).removesuffix("/api/v1/")


@contextmanager
def visiting(profile: SharedProfile, client: httpx.Client, path: str, site: str = "") -> Iterator[Visitor]:
    """Open a page of a server, at its own address or at another way to it."""
    before = profile.context.pages
    visitor = Visitor(profile.open(size=(1100, 720), reduced_motion="reduce"))
    visitor.page.goto((site or site_of(client)) + path)
    yield visitor
    for page in profile.context.pages:
        if page not in before:
            page.close()  # before its server ends
