"""One visit of a scene in the real browser: how long until its first picture, what it took, and what was sent."""

import os
import time
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import msgspec
import numpy as np
import zstandard
from PIL import Image
from playwright.sync_api import Browser, Page

from server.scenes.facts import SceneInput
from server.scenes.manager import SceneManager
from tests.server.scene_cell import serve_scenes

ARGUMENTS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox")
_CLOUD_IS_DRAWN = """() => new Promise((resolve) => {
  const look = () => window.__viserSceneTree && window.__viserMutable.nodeRefFromName['/scans/merged/0']
    ? requestAnimationFrame(() => requestAnimationFrame(resolve)) : setTimeout(look, 20);
  look();
})"""
_BYTES_OF_A_POINT = 12  # three numbers in single precision
_ENOUGH_PIXELS = 2000


@dataclass(frozen=True)
class FirstPicture:
    """What a visit took until the merged cloud was seen.

    Attributes
    ----------
    seconds : float
    processor_s : float
        Of the browser alone, on all cores together.
    points, bytes : int
        Sent by then.
    """

    seconds: float
    processor_s: float
    points: int
    bytes: int


def visit(browser: Browser, scene: SceneInput, size: tuple[int, int] = (720, 720)) -> FirstPicture:
    """Serve a scene that nobody has looked at yet, and look at it."""
    manager = SceneManager({"s1": scene}.get)
    try:
        with serve_scenes(manager) as address:
            return _first_picture(browser, f"{address}/scenes/s1/", size)
    finally:
        manager.stop()


def _first_picture(browser: Browser, address: str, size: tuple[int, int]) -> FirstPicture:
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.set_default_timeout(120_000)
    frames: list[bytes] = []
    page.on("websocket", lambda socket: socket.on("framereceived", lambda data: frames.append(bytes(data))))
    before_s, start = _of_children_s(), time.perf_counter()
    page.goto(f"{address}?theme=light")
    page.evaluate(_CLOUD_IS_DRAWN)
    while _coloured_pixels(page) < _ENOUGH_PIXELS:
        page.wait_for_timeout(50)
    seconds, processor_s = time.perf_counter() - start, _of_children_s() - before_s
    page.close()
    return FirstPicture(seconds, processor_s, sum(map(_points_in, frames)), sum(map(len, frames)))


def _coloured_pixels(page: Page) -> int:
    """Return how many pixels of the page have a colour of viridis, which is what heights are drawn in."""
    picture = np.array(Image.open(BytesIO(page.screenshot())).convert("RGB")).astype(int)
    green_over_red = picture[..., 1] - picture[..., 0]
    return int(((green_over_red > 50) & (picture[..., 2] > 60)).sum())


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
