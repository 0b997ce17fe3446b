"""Moments of the scene, measured from the page: how much of the view the subject fills, labels, and the legend.

`python tests/web/moments.py [NAME …]` writes `docs/images/moments/*.png` and prints what was measured; with
`--looks FOLDER` every moment goes there in two sizes, two themes and three languages, to be looked at one by one.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from itertools import groupby, product
from pathlib import Path
from typing import Any, Literal

import httpx
from PIL import Image
from playwright.sync_api import Browser, Error, Frame, Page, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from calib_core.simulation.part import build_part  # noqa: E402
from server.settings import Settings  # noqa: E402
from tests.point_files import mesh_file  # noqa: E402
from tests.server.live_server import make_session, serving, simulated_session, wait_for  # noqa: E402
from tests.web.browsing import BROWSER_ARGUMENTS, CHROMIUM, draw_the_scene_seldom, look_into_the_merge  # noqa: E402

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


_TOLD = """(theme) => !!window.scancellScene?.layers()
  && (!theme || document.documentElement.classList.contains("dark") === (theme === "dark"))"""


_DRAWN = """(subject) => {
  const { nodeRefFromName } = window.__viserMutable, names = Object.keys(window.__viserSceneTree.getState());
  const of = (layer) => names.filter((name) => name.startsWith(`/${layer}/`));
  return !!document.getElementById("scancell-legend").innerText.trim()
    && subject.every((layer) => of(layer).length && of(layer).every((name) => nodeRefFromName[name]));
}"""


def scene_frame(page: Page, theme: str = "") -> Frame:
    """Return the scene's frame, in a theme, once it tells the story of the page's step."""
    for _ in range(600):
        for frame in page.frames:
            with suppress(Error):  # it is being loaded: the step's own scene comes
                if "/viewers/" in frame.url and frame.evaluate(_TOLD, theme):
                    return frame
        page.wait_for_timeout(200)
    raise AssertionError("the scene does not tell its story")


def moment(page: Page, subject: list[str]) -> Moment:
    """Measure the scene as the page shows it now, once it has come to rest."""
    frame = scene_frame(page)
    with suppress(Error):  # then the picture shows what is not drawn
        frame.wait_for_function(_DRAWN, arg=subject, timeout=60_000)
    page.wait_for_timeout(1500)
    seen = frame.evaluate(_MEASURE, subject)
    problems = [f"labels on each other: {pair}" for pair in seen["overlaps"]]
    if subject and seen["fill"] < LEAST_FILL:
        problems.append(f"the subject fills {seen['fill']:.0%}")
    if seen["covered"]:
        problems.append("the legend covers the picture")
    return Moment(seen["fill"], seen["labels"], problems)


@dataclass(frozen=True)
class Look:
    """How a moment is looked at."""

    size: tuple[int, int] = (1280, 720)
    theme: Literal["light", "dark"] = "light"
    language: str = "en"

    @property
    def name(self) -> str:
        return f"{self.size[0]}-{self.theme}-{self.language}"


LOOKS = [
    Look(size, theme, language)
    for language, size, theme in product(("en", "de", "zh"), ((1280, 720), (1920, 1080)), ("light", "dark"))
]
"""In this order each follows on a page of the other theme, whose scene is drawn anew."""


@dataclass(frozen=True)
class Told:
    """A moment: how far its scenario's session is walked, what of it is open, and the layers that it is about."""

    scenario: str
    until: str
    place: str
    subject: list[str]
    then: Callable[[httpx.Client, Page, str], None] | None = None


def _compare_with_the_part(client: httpx.Client, page: Page, session: str) -> None:
    """Colour the merged cloud by its deviation from the part's own mesh."""
    part = build_part()
    mesh = mesh_file("stl", part.points_mm, part.triangles)
    stored = client.put(f"/sessions/{session}/merged/reference", files={"file": ("part.stl", mesh)})
    stored.raise_for_status()
    page.reload()
    look_into_the_merge(page)
    page.locator("#cloud-deviation").check()
    with page.expect_response("**/cloud"):
        page.locator("sc-merged select", has=page.locator("option[value=mesh]")).select_option("mesh")


def _verify_with_all(client: httpx.Client, page: Page, session: str) -> None:
    """Take what the guide does not ask for too: the cell's plate is bowed by more than is allowed."""
    while client.post(f"/sessions/{session}/sources/simulated/capture").is_success:
        pass
    solve(client, session, "verify")
    verdict = client.get(f"/sessions/{session}/results/verify").raise_for_status().json()["verdict"]
    assert verdict == "fail", f"a verification that is to fail says {verdict}"
    page.reload()


def _edit_the_cell(_client: httpx.Client, page: Page, _session: str) -> None:
    page.locator(".session-title ~ * button, .session-title button").first.click()
    page.locator("dialog sc-chain-picture").scroll_into_view_if_needed()


def _pick_one(_client: httpx.Client, page: Page, _session: str) -> None:
    """Pick a capture in the table, which lights up in the scene, once that is there."""
    page.wait_for_timeout(8000)
    scene_frame(page)
    page.locator("#tab-measure").click()
    page.get_by_role("button", name="p04", exact=True).click()


MOMENTS: dict[str, Told] = {
    "empty": Told("tcp", "0 captures", "tcp", []),
    "capture-1": Told("tcp", "1 captures", "tcp", ["frames", "ghost"]),
    "capture-5": Told("tcp", "5 captures", "tcp", ["frames", "ghost"]),
    "tcp": Told("tcp", "tcp", "tcp.result", ["sphere"]),
    "picked": Told("tcp", "tcp", "tcp", ["frames"], _pick_one),
    "tcp-rejected": Told("tcp-moved-sphere", "tcp", "tcp.result", ["sphere"]),
    "camera": Told("frames-tcp", "camera", "camera.result", ["boards"]),
    "laser-plane": Told("frames-tcp", "laser-plane", "laser-plane.result", ["boards"]),
    "table-half": Told("cell", "half turntable", "turntable", ["table-so-far"]),
    "table": Told("cell", "turntable", "turntable.result", ["circles", "places"]),
    "scans": Told("cell", "half scan", "scan", ["scans"]),
    "chain": Told("cell", "chain", "chain.result", ["circles", "places"]),
    "merged": Told("cell", "merge", "merge.result", ["scans"]),
    "deviation": Told("cell", "merge", "merge.result", ["scans"], _compare_with_the_part),
    "verify-failed": Told("verify-bowed-plate", "verify", "verify.result", ["sphere"], _verify_with_all),
    "chain-editor": Told("", "0 captures", "tcp", [], _edit_the_cell),
}
"""The moments in the order in which a scenario's session comes to them."""
_MOST = 90


def solve(client: httpx.Client, session: str, stage: str) -> None:
    """Compute a stage; what cannot be computed fails here."""
    job = client.post(f"/sessions/{session}/solve/{stage}").raise_for_status().json()["id"]
    solved = wait_for(client, job, timeout_s=400)
    assert solved["status"] == "done", f"{stage}: {solved}"


def walk_on(client: httpx.Client, session: str, until: str) -> None:
    """Follow the guide from where a session stands until so many captures, half a step, or a result."""
    for _ in range(_MOST):
        if until in client.get(f"/sessions/{session}/results").json():
            return
        count = len(client.get(f"/sessions/{session}/captures?limit=1000").json()["items"])
        now = client.get(f"/sessions/{session}/guide").json()["current"]
        if until == f"{count} captures" or (until == f"half {now['step']}" and 0 < now["still_needed"] <= 8):
            return
        capture = f"/sessions/{session}/sources/simulated/capture"
        taken = now["action"] == "capture" and client.post(capture).is_success
        if not taken:  # where the guide asks for more than the simulated cell has, what there is gives the result
            solve(client, session, now["stage"])
    raise AssertionError(f"{until} is not reached in {_MOST} steps")


def own_cell(client: httpx.Client) -> str:
    """Return a session of a cell with a rail, a table, two scanners and two balls."""
    axes = [{"name": "rail", "kind": "linear", "carries": "robot"}, {"name": "positioner", "kind": "rotary"}]
    balls = [{"name": name, "on": "positioner", "diameter_mm": 40.0} for name in ("low", "high")]
    scanners = {"left": {"on": "tool0"}, "fixed": {"on": "base"}}
    cell = {"pose_convention": "abb", "scanner": {"kind": "profile"}, "axes": axes, "spheres": balls}
    return make_session(client, name="Cell 4", cell={**cell, "scanners": scanners})


@dataclass
class Album:
    """Moments of one server: each scenario's session is walked on from moment to moment."""

    client: httpx.Client
    browser: Browser
    sessions: dict[str, str] = field(default_factory=dict[str, str])

    def look_at(self, name: str, look: Look = LOOKS[0], into: Path | None = None) -> Moment:
        """Measure a moment, and save its picture into a folder where one is named."""
        page = self.opened(name, look)
        found = seen(page, name, look, into)
        page.close()
        return found

    def opened(self, name: str, look: Look) -> Page:
        """Return a page at a moment."""
        told = MOMENTS[name]
        if told.scenario not in self.sessions:
            made = (
                simulated_session(self.client, scenario=told.scenario) if told.scenario else own_cell(self.client)
            )
            self.sessions[told.scenario] = made
        session = self.sessions[told.scenario]
        walk_on(self.client, session, told.until)
        address = str(self.client.base_url).split("/api/")[0]
        width, height = look.size
        options: dict[str, Any] = {"viewport": {"width": width, "height": height}, "color_scheme": look.theme}
        page = self.browser.new_page(base_url=address, locale=look.language, **options)
        page.set_default_timeout(120_000)
        draw_the_scene_seldom(page)
        page.goto(f"/sessions/{session}#{told.place}")
        if told.then:
            told.then(self.client, page, session)
        return page


def seen(page: Page, name: str, look: Look, into: Path | None = None) -> Moment:
    """Measure a moment's page in a look, and save its picture into a folder where one is named."""
    page.set_viewport_size({"width": look.size[0], "height": look.size[1]})
    page.emulate_media(color_scheme=look.theme)
    scene_frame(page, look.theme)
    page.wait_for_timeout(5000)
    found = moment(page, MOMENTS[name].subject)
    if into is not None:
        into.mkdir(parents=True, exist_ok=True)
        picture = Image.open(BytesIO(page.screenshot())).convert("RGB")
        picture = picture.resize((960, 540)) if into == FOLDER else picture
        picture.quantize(255, Image.Quantize.FASTOCTREE).save(into / f"{name}.png", optimize=True)
    return found


def _by_language(looks: list[Look]) -> list[tuple[str, list[Look]]]:
    return [(language, list(alike)) for language, alike in groupby(looks, lambda one: one.language)]


def main() -> None:
    """Take the named moments' pictures, or all, and print what was measured."""
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*", help=", ".join(MOMENTS))
    parser.add_argument("--looks", type=Path, metavar="FOLDER", help="each in every look")
    parser.add_argument("--only", nargs="+", default=[one.name for one in LOOKS], metavar="LOOK")
    told = parser.parse_args()
    looks = LOOKS[:1] if told.looks is None else [one for one in LOOKS if one.name in told.only]
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=BROWSER_ARGUMENTS)
        with serving(Settings(data=Path(folder), port=0, warm_up=False)) as client:
            client.timeout = 400
            album = Album(client, browser)
            for name, (_, alike) in product(told.names or MOMENTS, _by_language(looks)):
                page = album.opened(name, alike[0])
                for look in alike:
                    found = seen(page, name, look, FOLDER if told.looks is None else told.looks / look.name)
                    shown = f"fills {found.fill:.0%}, {found.labels} labels {found.problems}"
                    print(f"{name} {look.name}: {shown}", flush=True)
                page.close()
        browser.close()


if __name__ == "__main__":
    main()
