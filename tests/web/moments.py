"""Moments of the scene, measured from the page: how much of the view the subject fills, labels, and the legend.

`python tests/web/moments.py` writes `docs/images/moments/*.png` and prints what was measured.
"""

import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import httpx
from PIL import Image
from playwright.sync_api import Frame, Page, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from server.settings import Settings  # noqa: E402
from tests.server.live_server import serving, simulated_session, wait_for  # noqa: E402
from tests.web.browsing import BROWSER_ARGUMENTS  # noqa: E402

FOLDER = ROOT / "docs" / "images" / "moments"
LEAST_FILL = 0.4

_MEASURE = """(subject) => {
  const { nodeRefFromName, camera } = window.__viserMutable, nodes = window.__viserSceneTree.getState();
  const canvas = document.querySelector("canvas").getBoundingClientRect();
  const [width, height] = [canvas.width, canvas.height];
  const seen = [];
  const add = (at) => {
    at.project(camera);
    if (Math.abs(at.z) <= 1) seen.push([(at.x + 1) / 2 * width, (1 - at.y) / 2 * height]);
  };
  for (const layer of subject) {
    for (const [name, node] of Object.entries(nodes)) {
      if (!name.startsWith(`/${layer}/`) || !nodeRefFromName[name]) continue;
      if (node.message?.type === "FrameMessage") {
        const at = nodeRefFromName[name].position.clone();
        add(nodeRefFromName[name].getWorldPosition(at));
      }
      nodeRefFromName[name].traverse((part) => {
        const places = part.geometry?.attributes?.position;
        const drawn = part.isMesh || part.isPoints || part.isLine;
        if (!drawn || !places || node.message?.type === "FrameMessage") return;
        const every = Math.max(1, Math.floor(places.count / 400));
        const at = nodeRefFromName[name].position.clone();
        for (let index = 0; index < places.count; index += every) {
          add(part.localToWorld(at.fromBufferAttribute(places, index)));
        }
      });
    }
  }
  const inside = (value, most) => Math.min(Math.max(value, 0), most);
  const range = (axis, most) => {
    const sorted = seen.map((one) => inside(one[axis], most)).sort((a, b) => a - b);
    const at = (share) => sorted[Math.floor(sorted.length * share)];
    return sorted.length ? at(0.995) - at(0.005) : 0;
  };
  const legend = document.getElementById("scancell-legend").getBoundingClientRect();
  const apart = (a, b) => a.right <= b.left || b.right <= a.left || a.bottom <= b.top || b.bottom <= a.top;
  const labels = window.scancellScene.labels();
  const overlaps = labels.flatMap((a, index) =>
    labels.slice(index + 1).filter((b) => !apart(a, b)).map((b) => `${a.text} | ${b.text}`));
  return {
    fill: Math.max(range(0, width), range(1, height)) / Math.min(width, height),
    labels: labels.length, overlaps, covered: legend.height > 0 && !apart(legend, canvas),
  };
}"""


@dataclass(frozen=True)
class Moment:
    """What was measured of one moment of the scene."""

    fill: float
    labels: int
    problems: list[str] = field(default_factory=list[str])


def scene_frame(page: Page) -> Frame:
    """Return the scene's frame once it tells the story of the page's step."""
    for _ in range(300):
        for frame in page.frames:
            if "/viewers/" in frame.url and frame.evaluate("() => !!window.scancellScene?.layers()"):
                return frame
        page.wait_for_timeout(200)
    raise AssertionError("the scene does not tell its story")


def moment(page: Page, subject: list[str]) -> Moment:
    """Measure the scene as the page shows it now, once it has come to rest."""
    frame = scene_frame(page)
    page.wait_for_timeout(1500)
    seen = frame.evaluate(_MEASURE, subject)
    problems = [f"labels on each other: {pair}" for pair in seen["overlaps"]]
    if subject and seen["fill"] < LEAST_FILL:
        problems.append(f"the subject fills {seen['fill']:.0%}")
    if seen["covered"]:
        problems.append("the legend covers the picture")
    return Moment(seen["fill"], seen["labels"], problems)


Get = Callable[[httpx.Client], str]


def _tcp(captures: int, *, solved: bool = False, scenario: str = "tcp") -> Get:
    def make(client: httpx.Client) -> str:
        session = simulated_session(client, captures=captures, scenario=scenario)
        if solved:
            wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"], timeout_s=300)
        return session

    return make


def _walked(scenario: str, until: str, most: int = 80) -> Get:
    """Follow the guide until it asks for a step's stage, or has solved it."""

    def make(client: httpx.Client) -> str:
        session = simulated_session(client, scenario=scenario)
        for _ in range(most):
            now = client.get(f"/sessions/{session}/guide").json()["current"]
            if now["action"] == "capture":
                client.post(f"/sessions/{session}/sources/simulated/capture").raise_for_status()
                done = until == f"half {now['step']}" and now["still_needed"] <= 8
            else:
                wait_for(
                    client, client.post(f"/sessions/{session}/solve/{now['stage']}").json()["id"], timeout_s=400
                )
                done = until == now["stage"]
            if done:
                break
        return session

    return make


MOMENTS: dict[str, tuple[Get, str, list[str]]] = {
    "empty": (_tcp(0), "tcp", []),
    "capture-1": (_tcp(1), "tcp", ["frames", "ghost"]),
    "capture-5": (_tcp(5), "tcp", ["frames", "ghost"]),
    "tcp": (_tcp(14, solved=True), "tcp.result", ["sphere"]),
    "tcp-rejected": (_tcp(14, solved=True, scenario="tcp-moved-sphere"), "tcp.result", ["sphere"]),
    "camera": (_walked("frames-tcp", "camera"), "camera.result", ["boards"]),
    "laser-plane": (_walked("frames-tcp", "laser-plane"), "laser-plane.result", ["boards"]),
    "table-half": (_walked("turntable", "half turntable"), "turntable", ["frames"]),
    "table": (_walked("turntable", "turntable"), "turntable.result", ["circles", "places"]),
    "scans": (_walked("cell", "half scan"), "scan", ["table", "scans"]),
    "merged": (_walked("cell", "merge"), "merge.result", ["scans"]),
}
"""Of each moment: the session, what of it is open, and the layers that it is about."""


def main(names: list[str]) -> None:
    """Take the named moments' pictures, or all, and print what was measured."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=BROWSER_ARGUMENTS)
        with serving(Settings(data=Path(folder), port=0, warm_up=False)) as client:
            client.timeout = 400
            for name in names or MOMENTS:
                make, place, subject = MOMENTS[name]
                address = str(client.base_url).split("/api/")[0]
                page = browser.new_page(base_url=address, viewport={"width": 1280, "height": 720})
                page.goto(f"/sessions/{make(client)}#{place}")
                page.set_default_timeout(120_000)
                scene_frame(page)
                page.wait_for_timeout(6000)
                found = moment(page, subject)
                picture = Image.open(BytesIO(page.screenshot())).convert("RGB")
                picture.quantize(128).save(FOLDER / f"{name}.png", optimize=True)
                print(f"{name}: fills {found.fill:.0%}, {found.labels} labels {found.problems}", flush=True)
                page.close()
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1:])
