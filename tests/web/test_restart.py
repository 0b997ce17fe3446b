"""The server killed and back under an open page: everything is right within five seconds, without a reload."""

import re
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Browser, Page, expect

from server.simulated_cell.devices import SimulatedDevices
from tests.benchmarks.kill_server import ServerProcess
from tests.server.live_server import make_session, simulated_session
from tests.web.browsing import SharedProfile, Watch

pytestmark = pytest.mark.browser
BACK_MS = 5000
QUIET = (
    "Failed to load resource|WebSocket connection|ERR_|closed before the connection|status of (404|502|503)|net::"
)
SCENE = "document.querySelector('iframe').contentWindow"
PROBLEMS = "need a scene|cannot be reached|No connection to the server"


class Outage:
    """A server that is killed as by a power cut, and starts again on its data and its port."""

    def __init__(self, data: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self._data = data
        self.start()

    def start(self) -> None:
        self.process = ServerProcess(self._data, forked=True, port=self.port).wait()

    def kill(self) -> None:
        self.process.kill()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"


@pytest.fixture
def outage(tmp_path: Path) -> Iterator[Outage]:
    made = Outage(tmp_path / "data")
    yield made
    made.kill()


@pytest.fixture
def api(outage: Outage) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{outage.address}/api/v1", timeout=120, trust_env=False) as client:
        yield client


@pytest.fixture
def visit(browser: Browser, outage: Outage, watch: Watch) -> Iterator[Callable[..., Page]]:
    watch.allow(QUIET)
    profile = SharedProfile(browser, outage.address, "")
    watch.follow(profile.context)

    def open_page(path: str, scene: bool = False) -> Page:
        return profile.open(path, scene=scene)

    yield open_page
    profile.context.close()


def link(page: Page) -> None:
    expect(page.locator("sc-live")).to_have_text("connected", timeout=BACK_MS)


def told_lost(page: Page) -> None:
    expect(page.locator("sc-live")).to_have_text(re.compile(r"no connection since \d\d:\d\d:\d\d"), timeout=3000)


def all_is_right(page: Page) -> None:
    link(page)
    expect(page.locator(".toasts").get_by_text(re.compile(PROBLEMS))).to_have_count(0, timeout=BACK_MS)


@pytest.mark.thorough
def test_guide_scene_and_rows_come_back(outage: Outage, api: httpx.Client, visit: Callable[..., Page]) -> None:
    session = simulated_session(api, captures=3)
    page = visit(f"/sessions/{session}", scene=True)
    expect(page.locator("table.captures tbody tr")).to_have_count(3)
    page.wait_for_function(f"() => {SCENE}.scancellScene?.layers()", timeout=60_000)
    outage.kill()
    told_lost(page)
    page.keyboard.press("Space")  # asked for while nobody answers: it is taken once somebody does
    outage.start()
    all_is_right(page)
    expect(page.locator("table.captures tbody tr")).to_have_count(4)  # its first capture loads the kernels
    page.locator(".scene-tools select").select_option("Top")
    page.wait_for_function(
        f"() => Object.keys({SCENE}.__viserSceneTree.getState()).some((one) => one.startsWith('/frames/p04'))",
        timeout=2 * BACK_MS,
    )
    all_is_right(page)


@pytest.mark.thorough
def test_a_solve_is_asked_for_again(outage: Outage, api: httpx.Client, visit: Callable[..., Page]) -> None:
    session = simulated_session(api, captures=14)
    page = visit(f"/sessions/{session}")
    expect(page.locator("table.captures tbody tr")).to_have_count(14)
    with page.expect_response("**/solve/tcp"):
        page.keyboard.press("s")
    outage.kill()
    told_lost(page)
    outage.start()
    all_is_right(page)
    expect(page.locator("#answer-title")).to_be_visible(timeout=60_000)
    assert len({job["id"] for job in api.get("/jobs").json()["items"] if job["status"] == "done"}) == 1


@pytest.mark.thorough
def test_parts_that_are_asked_for_while_it_is_away_come_later(
    outage: Outage, api: httpx.Client, visit: Callable[..., Page]
) -> None:
    """What draws results is loaded with the first look at one: that look may be while the server is away."""
    page = visit(f"/sessions/{simulated_session(api, captures=4)}")
    expect(page.locator("table.captures tbody tr")).to_have_count(4)
    expect(page.locator("sc-live")).to_have_text("connected")
    outage.kill()
    expect(page.locator("sc-live")).to_contain_text("no connection since")
    page.get_by_role("tab", name="Result").click()
    outage.start()
    expect(page.locator("sc-result")).to_contain_text("Not solved yet", timeout=60_000)


@pytest.mark.thorough
def test_an_upload_goes_on(outage: Outage, api: httpx.Client, visit: Callable[..., Page], tmp_path: Path) -> None:
    archive = tmp_path / "cell.zip"
    archive.write_bytes(api.get(f"/sessions/{simulated_session(api, captures=3)}/archive").content)
    page = visit("/")
    expect(page.locator("sc-start")).to_be_visible()
    outage.kill()
    page.locator("input[type=file][accept*=zip]").first.set_input_files(archive)
    expect(page.locator(".toast")).to_contain_text("No connection to the server")
    outage.start()
    page.wait_for_url("**/sessions/*", timeout=20_000)
    link(page)
    expect(page.locator("table.captures tbody tr").first).to_be_visible()


@pytest.mark.thorough
def test_a_live_cell_says_since_when_and_goes_on(
    outage: Outage, api: httpx.Client, visit: Callable[..., Page]
) -> None:
    cell = SimulatedDevices("turntable", 3, rate_hz=10.0)
    try:
        session = make_session(api, name="live", cell=cell.simulated.session.to_json()["cell"])
        for device, body in cell.sources().items():
            api.put(f"/sessions/{session}/devices/{device}", json=dict(body)).raise_for_status()
        page = visit(f"/sessions/{session}")
        page.get_by_role("button", name="Devices").click()
        rows, sign = page.locator(".live-devices li"), page.locator("sc-live-sign")
        expect(page.locator(".live-devices li[data-status=live]")).to_have_count(3)
        page.locator("#live-automatic").check()
        outage.kill()
        expect(sign).to_contain_text(
            re.compile(r"Nothing is captured\. No connection to the server since \d\d:"), timeout=4000
        )
        expect(rows.first).to_have_class("old")
        expect(rows.first).to_contain_text("since")
        expect(page.locator(".live-rate")).to_contain_text("nothing new since", timeout=3000)
        outage.start()
        all_is_right(page)
        expect(page.locator(".live-devices li[data-status=live]:not(.old)")).to_have_count(3, timeout=BACK_MS)
        expect(sign).not_to_have_attribute("data-state", "bad", timeout=BACK_MS)
    finally:
        cell.stop()


@pytest.mark.thorough
def test_a_dialog_keeps_what_was_typed(outage: Outage, api: httpx.Client, visit: Callable[..., Page]) -> None:
    session = make_session(api, name="dialog")
    page = visit(f"/sessions/{session}")
    page.get_by_role("button", name="Edit cell").click()
    diameter = page.get_by_label("Sphere diameter in mm")
    diameter.fill("50.003")
    outage.kill()
    told_lost(page)
    outage.start()
    link(page)
    expect(diameter).to_have_value("50.003")
    page.locator("dialog button.primary").click()
    expect(page.locator("dialog")).to_have_count(0, timeout=BACK_MS)
    expect(page.locator(".session-title")).to_contain_text("sphere 50.003 mm", timeout=BACK_MS)


@pytest.mark.thorough
def test_a_silent_line_is_told_within_three_seconds(
    outage: Outage, api: httpx.Client, visit: Callable[..., Page]
) -> None:
    """A server that hangs closes nothing: only that its sign of life is missing says so."""
    page = visit(f"/sessions/{simulated_session(api)}")
    link(page)
    outage.process.process.send_signal(19)  # SIGSTOP
    began_s = time.monotonic()
    told_lost(page)
    assert time.monotonic() - began_s < 3.5
    outage.process.process.send_signal(18)
    link(page)
