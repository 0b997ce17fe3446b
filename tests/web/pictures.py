"""Takes pictures for reviewing the page: `python tests/web/pictures.py [NAME …]` writes `docs/images/page-*.png`.

Each picture is a state of the page that is easily missed when it changes, also the errors; the scene is left out
where it is not the point, since drawing it in software takes most of the time.
"""

import re
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Literal

import httpx
from PIL import Image
from playwright.sync_api import Browser, Page, expect, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from server.settings import Settings  # noqa: E402
from tests.server.live_server import make_session, serving, simulated_session, wait_for  # noqa: E402
from tests.web.browsing import BROWSER_ARGUMENTS, CHROMIUM, leave_out_the_scene  # noqa: E402
from tests.web.moments import scene_frame  # noqa: E402

FOLDER = ROOT / "docs" / "images"
COLORS = 256

Show = Callable[[Page, httpx.Client], None]


@dataclass(frozen=True)
class Picture:
    """How a state of the page is reached, and in which window it is seen."""

    show: Show
    width: int = 1280
    height: int = 800
    theme: Literal["light", "dark"] = "light"
    touch: bool = False
    scene: bool = False


def start(page: Page, client: httpx.Client) -> None:
    make_session(client, name="cell 4, before the shift")
    for scenario, count in (("turntable", 6), ("frames-tcp", 3), ("tcp", 10)):
        simulated_session(client, captures=count, scenario=scenario)
    page.goto("/")
    expect(page.locator(".session-card").nth(3)).to_be_visible()
    page.wait_for_function("() => [...document.images].slice(0, 3).every((image) => image.naturalWidth > 0)")


def measuring(page: Page, client: httpx.Client) -> None:
    page.goto(f"/sessions/{simulated_session(client, captures=7)}")
    expect(page.locator(".captures tbody tr")).to_have_count(7)
    page.get_by_label("Compare p07 with").select_option("p02")
    expect(page.get_by_role("region", name="p07 beside p02")).to_contain_text("turns")


def refused(page: Page, client: httpx.Client) -> None:
    session = make_session(client)
    wall = "x_mm,z_mm\n" + "\n".join(f"{x / 10:.1f},200.0" for x in range(-300, 300))
    record = '{"id": "wall", "step": "tcp", "kind": "profile", "pose": [0, 0, 500, 0, 0, 0]}'
    client.post(f"/sessions/{session}/captures", data={"record": record}, files={"files": ("wall.csv", wall)})
    page.goto(f"/sessions/{session}")
    expect(page.locator("sc-quality h2")).to_contain_text("refused")


def columns(page: Page, client: httpx.Client) -> None:
    page.goto(f"/sessions/{make_session(client)}")
    page.get_by_role("button", name="Paste poses").click()
    text = "file;x;y;z;W;P;R\np1;100,5;200;300;180;0;0\np2;110,5;200;300;180;0;10\np3;110,5;230;300;nan;0;10"
    page.get_by_label("Poses, one line per capture").fill(text)
    expect(page.locator(".match tbody tr")).to_have_count(3)


def unreachable(page: Page, client: httpx.Client) -> None:
    page.goto(f"/sessions/{simulated_session(client, captures=2)}")
    expect(page.locator("sc-live")).to_have_text("connected")
    page.context.set_offline(True)
    page.keyboard.press("Space")
    expect(page.locator(".toast.bad")).to_contain_text("cannot be reached", timeout=120_000)


def nothing_there(page: Page, _: httpx.Client) -> None:
    page.goto("/sessions/not-there")
    expect(page.get_by_role("link", name="Back to all sessions")).to_be_visible()


def toured(page: Page, _: httpx.Client) -> None:
    page.goto("/")
    page.get_by_role("button", name="Take the tour").click()
    expect(page.locator(".tour")).to_be_visible()


def result(page: Page, client: httpx.Client) -> None:
    session = simulated_session(client, captures=14, scenario="tcp-moved-sphere")
    wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"], timeout_s=300)
    page.goto(f"/sessions/{session}#result")
    expect(page.locator(".answer-card")).to_be_visible()


def answered(page: Page, client: httpx.Client) -> None:
    """The picture that the README starts with: an accepted tool with the arcs that it rests on."""
    session = simulated_session(client, captures=14)
    wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"], timeout_s=300)
    page.goto(f"/sessions/{session}#result")
    expect(page.locator(".answer-card")).to_be_visible()


def reviewed(page: Page, client: httpx.Client) -> None:
    session = simulated_session(client, captures=14, scenario="tcp-moved-sphere")
    wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"], timeout_s=300)
    page.goto(f"/sessions/{session}/review")
    expect(page.locator("sc-review-captures tbody tr")).to_have_count(14)


def access(page: Page, client: httpx.Client) -> None:
    for name, role in (("Ada", "admin"), ("robot cell 4", "capture"), ("screen in the hall", "read")):
        client.post("/tokens", json={"name": name, "role": role})
    page.goto("/access")
    page.get_by_label("Name").fill("Grace")
    page.get_by_role("button", name="Create token").click()
    expect(page.locator(".made-token")).to_be_visible()


PICTURES = {
    "start": Picture(start),
    "start-dark": Picture(start, theme="dark"),
    "measuring": Picture(measuring, height=1000, scene=True),
    "measuring-tablet": Picture(measuring, 1024, 768, touch=True),
    "measuring-upright": Picture(measuring, 768, 1024, touch=True, theme="dark"),
    "columns": Picture(columns, height=1000),
    "refused": Picture(refused),
    "unreachable": Picture(unreachable),
    "nothing-there": Picture(nothing_there, 1024, 480),
    "tour": Picture(toured),
    "result": Picture(result, height=1200),
    "result-dark": Picture(result, 1024, 1000, theme="dark", touch=True),
    "session": Picture(answered, 1600, 1000, scene=True),
    "review": Picture(reviewed, height=1000),
    "access": Picture(access),
}


def take(browser: Browser, client: httpx.Client, name: str) -> Path:
    """Take one picture and return where it lies."""
    picture = PICTURES[name]
    context = browser.new_context(
        base_url=re.sub("/api/v1/?$", "", str(client.base_url)),
        viewport={"width": picture.width, "height": picture.height},
        color_scheme=picture.theme,
        has_touch=picture.touch,
        is_mobile=picture.touch,
        reduced_motion="reduce",
    )
    context.set_default_timeout(60_000)
    if not picture.scene:
        leave_out_the_scene(context)
    page = context.new_page()
    picture.show(page, client)
    page.wait_for_function(
        "() => [...document.images].every((image) => image.complete || image.loading === 'lazy')"
    )
    if picture.scene:
        scene_frame(page)
        page.wait_for_timeout(3000)
    page.wait_for_timeout(900)
    path = FOLDER / f"page-{name}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    image = Image.open(BytesIO(page.screenshot())).convert("RGB")
    image.quantize(COLORS).save(path, optimize=True)
    context.close()
    return path


def main(names: list[str]) -> None:
    """Take the named pictures, or all."""
    expect.set_options(timeout=60_000)  # as the context's
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=BROWSER_ARGUMENTS)
        with serving(Settings(data=Path(folder), port=0, warm_up=False)) as client:
            for name in names or PICTURES:
                path = take(browser, client, name)
                print(f"{path.relative_to(ROOT)}  {path.stat().st_size / 1000:.0f} kB", flush=True)
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1:])
