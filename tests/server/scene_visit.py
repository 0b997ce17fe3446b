"""One visit of a scene in the real browser: how long until its first picture, what it took, and what was sent.

What is taken for the cloud are the pixels that change when its layer, and nothing else, is hidden in the end.  The
first picture is the first one in which they look as they do once everything has come to rest: nothing else that is
green or yellow can be mistaken for the cloud, nor the cloud as viser's own first camera sees it.
"""

import base64
import os
import time
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
import zstandard
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Browser, Page

from server.scenes.manager import SceneManager
from server.scenes.scene_input import SceneInput
from tests.server.scene_cell import serve_scenes

ARGUMENTS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox")
_CLOUD_IS_THERE = """() => new Promise((resolve) => {
  const look = () => window.__viserSceneTree && window.__viserMutable.nodeRefFromName['/scans/merged/0']
    ? resolve() : setTimeout(look, 20);
  look();
})"""
_TWO_FRAMES = "() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)))"
_BYTES_OF_A_POINT = 12  # three numbers in single precision
_ENOUGH_PIXELS = 2000
_SAME_SHARE = 0.9  # labels that come later hide some
_SAME_COLOR = 40
_AT_REST_S = 1.5
_LONGEST_S = 120.0

How = Literal["frames", "screenshots"]
Picture = NDArray[np.int_]


@dataclass(frozen=True)
class FirstPicture:
    """What a visit took until the merged cloud was seen.

    Attributes
    ----------
    seconds : float
        From the navigation until we had the first picture that shows the cloud.
    presented_s : float
        Until the browser presented it, by its own stamp; a screenshot has none and is stamped when we have it.
    processor_s : float
        Of the browser alone, on all cores together, until then.
    pixels : int
        Of the cloud in that picture.
    points, bytes : int
        Sent in all, until everything had come to rest.
    """

    seconds: float
    presented_s: float
    processor_s: float
    pixels: int
    points: int
    bytes: int


@dataclass(frozen=True)
class _Look:
    """A picture of the page: when we had it, when it was presented, what had been used and had come by then."""

    seconds: float
    presented_s: float
    processor_s: float
    messages: int
    png: bytes


class _Visit:
    """A page, the messages of its WebSocket, and how it looked from time to time.

    By frames, the browser's compositor hands over what it presents anyway; by screenshots, one is taken after the
    other, for each of which the page is drawn once more.
    """

    def __init__(self, page: Page, how: How) -> None:
        self.page = page
        self.messages: list[bytes] = []
        self.looks: list[_Look] = []
        self._how = how
        self._session = page.context.new_cdp_session(page)
        page.on("websocket", lambda socket: socket.on("framereceived", self._received))
        if how == "frames":
            self._session.on("Page.screencastFrame", self._take)
            self._session.send("Page.startScreencast", {"format": "png", "everyNthFrame": 1})
        self._start_s, self._used_s = time.time(), _of_children_s()

    def at_rest(self, other_than: Picture | None = None) -> Picture:
        """Return the picture once it does not change any more, and is another one than before."""
        since_s = time.time()
        while time.time() - self._start_s < _LONGEST_S:
            self._step()
            now = self.looks[-1]
            changed_s = next((look.seconds for look in reversed(self.looks) if look.png != now.png), 0.0)
            if time.time() - max(since_s, self._start_s + changed_s) < _AT_REST_S:
                continue
            if other_than is None or (np.abs(_picture(now.png) - other_than) > _SAME_COLOR).any():
                return _picture(now.png)
        raise AssertionError("the picture never comes to rest")

    def _received(self, message: str | bytes) -> None:
        self.messages.append(message if isinstance(message, bytes) else message.encode())

    def _step(self) -> None:
        self.page.evaluate(_TWO_FRAMES)  # waits as long as the page is busy
        if self._how == "screenshots":
            self._add(self.page.screenshot(), None)
        self.page.wait_for_timeout(50)

    def _take(self, event: dict[str, Any]) -> None:
        self._session.send("Page.screencastFrameAck", {"sessionId": event["sessionId"]})
        self._add(base64.b64decode(event["data"]), event["metadata"]["timestamp"])

    def _add(self, png: bytes, presented_s: float | None) -> None:
        now = time.time()
        used_s = _of_children_s() - self._used_s
        presented_s = (now if presented_s is None else presented_s) - self._start_s
        self.looks.append(_Look(now - self._start_s, presented_s, used_s, len(self.messages), png))


def visit(
    browser: Browser, scene: SceneInput, how: How = "frames", size: tuple[int, int] = (720, 720)
) -> FirstPicture:
    """Serve a scene that nobody has looked at yet, and look at it."""
    manager = SceneManager({"s1": scene}.get)
    try:
        with serve_scenes(manager) as address, _new_page(browser, size) as page:
            visited = _Visit(page, how)
            page.goto(f"{address}/scenes/s1/?theme=light", wait_until="commit")
            if how == "frames":
                page.evaluate(_CLOUD_IS_THERE)
            settled = visited.at_rest()
            while not any(map(_points_in, visited.messages)):  # a busy machine rests before the cloud comes, too
                settled = visited.at_rest()
            looks, messages = list(visited.looks), list(visited.messages)
            live = manager.live("s1")
            assert live is not None
            live.show_layer("scans", False)
            hidden, own = settled, np.zeros(settled.shape[:2], bool)
            while (
                own.sum() < _ENOUGH_PIXELS
            ):  # on a busy machine the words beside it may change well before the cloud
                hidden = visited.at_rest(hidden)
                own = np.abs(hidden - settled).max(axis=2) > _SAME_COLOR
    finally:
        manager.stop()
    return _first(looks, messages, settled, own)


def _first(looks: list[_Look], messages: list[bytes], settled: Picture, own: NDArray[np.bool_]) -> FirstPicture:
    points = [_points_in(message) for message in messages]
    first = next(look for look in looks if sum(points[: look.messages]) and _shows(look.png, settled, own))
    return FirstPicture(
        first.seconds,
        first.presented_s,
        first.processor_s,
        int(own.sum()),
        sum(points),
        sum(map(len, messages)),
    )


def _shows(png: bytes, settled: Picture, own: NDArray[np.bool_]) -> bool:
    """Tell whether the cloud's own pixels look in a picture as they do in the end."""
    apart = np.abs(_picture(png)[own] - settled[own]).max(axis=1)
    return bool((apart <= _SAME_COLOR).mean() >= _SAME_SHARE)


def _picture(png: bytes) -> Picture:
    return np.array(Image.open(BytesIO(png)).convert("RGB")).astype(int)


@contextmanager
def _new_page(browser: Browser, size: tuple[int, int]) -> Generator[Page]:
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.set_default_timeout(1000 * _LONGEST_S)
    try:
        yield page
    finally:
        page.close()


def _points_in(frame: bytes) -> int:
    """Return how many points of clouds a frame of viser's WebSocket brings.

    A frame is the sizes of its messages, unpacked and packed (8 bytes each), the packed messages, then the arrays'
    bytes; where an array belongs in a message, its number stands.
    """
    unpacked, packed = (int.from_bytes(frame[at : at + 8], "little") for at in (0, 8))
    content = msgspec.msgpack.decode(
        zstandard.ZstdDecompressor().decompress(frame[16 : 16 + packed], max_output_size=unpacked)
    )
    arrays = [m["props"]["points"] for m in content["messages"] if m["type"] == "PointCloudMessage"]
    return sum(content["binaryBufferLengths"][array["__binary_index"]] for array in arrays) // _BYTES_OF_A_POINT


def _of_children_s() -> float:
    """Return the processor time of all processes below this one that still run."""
    parents: dict[int, int] = {}
    used: dict[int, float] = {}
    tick_s = 1 / os.sysconf("SC_CLK_TCK")
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue  # it ended meanwhile
        number = int(stat.parent.name)
        parents[number], used[number] = int(fields[1]), (int(fields[11]) + int(fields[12])) * tick_s
    return sum(seconds for number, seconds in used.items() if _is_below(number, parents))


def _is_below(number: int, parents: dict[int, int]) -> bool:
    while number in parents:
        number = parents[number]
        if number == os.getpid():
            return True
    return False
