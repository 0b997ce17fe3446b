"""The scene with the merged part in the real Chromium, drawn in software: its first picture, the points sent."""

import shutil
import sys
import time
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import zstandard
from harness import Row
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from calib_core.session.pipeline import run as solve
from calib_core.session.point_writers import ply_pieces
from calib_core.session.stored_clouds import CLOUD_FILE, read_stored_ply
from calib_core.simulation import simulate
from server.scenes.facts import SceneInput
from server.scenes.manager import SceneManager
from server.scenes.merged import merged_cloud
from server.scenes.stored import scene_input
from tests.server.scene_cell import serve_scenes

ARGUMENTS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox")
MOST_S, MOST_POINTS = 5.0, 1_000_000
_CLOUD_IS_THERE = """() => window.__viserSceneTree
  && window.__viserMutable.nodeRefFromName['/scans/merged/0']
  && document.getElementById('scancell-legend').innerText.includes('Merged cloud')"""


@dataclass(frozen=True)
class FirstPicture:
    """What one visit of a scene took: seconds to a picture with the cloud in it, points and bytes sent by then."""

    seconds: float
    points: int
    bytes: int


def merged_cell(seed: int = 7) -> tuple[SceneInput, dict[str, bytes]]:
    """Return the scene of the simulated cell's whole chain with its merged part, and the stored files by name."""
    simulated = simulate("cell", seed)
    files: dict[str, bytes] = {}

    def store(name: str, pieces: Any) -> None:
        files[name] = b"".join(bytes(piece) for piece in pieces)

    results = solve(simulated.session, simulated.files.__getitem__, store=store)
    data = {stage: result.to_json() for stage, result in results.items()}
    return scene_input(simulated.session, simulated.files.__getitem__, [], data, files.get), files


def enlarged(scene: SceneInput, files: dict[str, bytes], count: int) -> SceneInput:
    """Return the same scene with so many points in its merged cloud, each a neighbour of one that was there."""
    points = read_stored_ply(files[CLOUD_FILE], CLOUD_FILE).points_mm
    rng = np.random.default_rng(1)
    more = points[rng.integers(0, len(points), count)] + rng.normal(0, 0.1, (count, 3)).astype(np.float32)
    files = {CLOUD_FILE: b"".join(bytes(piece) for piece in ply_pieces(more))}
    return SceneInput(
        scene.session,
        scene.load_points,
        scene.measured,
        scene.results,
        scene.load_scans,
        partial(merged_cloud, scene.results, files.get),
    )


def first_picture(browser: Browser, address: str, size: tuple[int, int] = (720, 720)) -> FirstPicture:
    """Open a scene and wait until the merged cloud is seen on a picture of the page."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.set_default_timeout(120_000)
    frames: list[bytes] = []
    page.on("websocket", lambda socket: socket.on("framereceived", lambda data: frames.append(bytes(data))))
    start = time.perf_counter()
    page.goto(f"{address}?theme=light")
    page.wait_for_function(_CLOUD_IS_THERE)
    while coloured_pixels(page) < 2000:
        page.wait_for_timeout(50)
    seconds = time.perf_counter() - start
    page.close()
    return FirstPicture(seconds, sum(map(points_in, frames)), sum(map(len, frames)))


def coloured_pixels(page: Page) -> int:
    """Return how many pixels of the page have a colour of viridis, which is what heights are drawn in."""
    picture = np.array(Image.open(BytesIO(page.screenshot())).convert("RGB")).astype(int)
    green_blue = picture[..., 1] - picture[..., 0]
    return int(((green_blue > 50) & (picture[..., 2] > 60)).sum())


def points_in(frame: bytes) -> int:
    """Return how many points of clouds a frame of viser's WebSocket brings.

    A frame is the sizes of its messages, unpacked and packed (8 bytes each), the packed messages, then the arrays'
    bytes; where an array belongs in a message, its number stands.
    """
    unpacked, packed = (int.from_bytes(frame[at : at + 8], "little") for at in (0, 8))
    content = msgspec.msgpack.decode(
        zstandard.ZstdDecompressor().decompress(frame[16 : 16 + packed], max_output_size=unpacked)
    )
    arrays = [m["props"]["points"] for m in content["messages"] if m["type"] == "PointCloudMessage"]
    bytes_of_a_point = 12  # three numbers in single precision
    return sum(content["binaryBufferLengths"][array["__binary_index"]] for array in arrays) // bytes_of_a_point


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` also draws a cloud of five million points."""
    scene, files = merged_cell()
    cases = {"merged part": scene}
    if full:
        cases["merged cloud of 5,000,000 points"] = enlarged(scene, files, 5_000_000)
    rows: list[Row] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=list(ARGUMENTS))
        for what, one in cases.items():
            seen = [_visit(browser, one) for _ in range(3 if full else 1)]
            seconds, points = max(s.seconds for s in seen), max(s.points for s in seen)
            rows += [
                Row(
                    f"{what}: first picture, worst of {len(seen)}",
                    f"< {MOST_S:g} s",
                    f"{seconds:.2f} s",
                    seconds < MOST_S,
                ),
                Row(
                    f"{what}: points sent",
                    f"≤ {MOST_POINTS:,}",
                    f"{points:,} ({max(s.bytes for s in seen) / 1e6:.1f} MB)",
                    points <= MOST_POINTS,
                ),
            ]
        browser.close()
    return rows


def _visit(browser: Browser, scene: SceneInput) -> FirstPicture:
    manager = SceneManager({"s1": scene}.get)
    try:
        with serve_scenes(manager) as address:
            return first_picture(browser, f"{address}/scenes/s1/")
    finally:
        manager.stop()
