"""What the page promises: few actions, no long task, use by several, on slow and broken links."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Browser, Page, expect

from server.settings import Settings
from tests.benchmarks.bench_page import fresh_page, longest_tasks_ms, many_captures
from tests.real.conftest import data_folder  # noqa: F401 — the fixture
from tests.server.live_server import make_session, serving, simulated_session
from tests.web.browsing import Hand, SharedProfile, Watch

pytestmark = pytest.mark.browser

# A link of the kind that a hall has at its far end.
SLOW_LINK = {"offline": False, "latency": 300, "downloadThroughput": 90_000, "uploadThroughput": 40_000}


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        yield client


def rows(page: Page) -> Any:
    return page.locator(".captures tbody tr")


@pytest.mark.thorough
def test_a_real_set_takes_few_actions(open_page: Callable[..., Any], data_folder: Path) -> None:  # noqa: F811
    page, watched = open_page()
    by = Hand(page)
    with page.expect_file_chooser() as chooser:
        by.click("Open a session folder")
    by.actions += 1
    chooser.value.set_files(data_folder / "tcp-sphere-80mm")
    expect(rows(page)).to_have_count(15)
    by.click("Solve")
    expect(page.locator(".answer-card")).to_be_visible(timeout=120_000)
    expect(page.locator("sc-rail .answer")).to_contain_text("±")
    with page.context.expect_page() as report:
        by.actions += 1
        page.get_by_role("link", name="Report").click()
    expect(report.value.locator("body")).to_contain_text("line sensor on an arm, 80 mm sphere")
    assert by.actions <= 4
    assert watched.complaints == []


@pytest.mark.thorough
def test_two_browsers_on_one_session(open_page: Callable[..., Any], api: httpx.Client) -> None:
    session = simulated_session(api, captures=9)
    (one, first), (two, second) = (open_page(f"/sessions/{session}") for _ in range(2))
    for page in (one, two):
        expect(rows(page)).to_have_count(9)
        expect(page.locator("sc-live")).to_have_text("connected")
    one.keyboard.press("Space")
    expect(rows(two)).to_have_count(10)
    two.get_by_role("checkbox", name="Use p03").uncheck()
    expect(one.get_by_role("checkbox", name="Use p03")).not_to_be_checked()
    two.get_by_role("button", name="p04", exact=True).click()
    one.get_by_role("button", name="Delete p04").click()
    expect(rows(two)).to_have_count(9)
    expect(two.locator("sc-quality h2")).to_contain_text("Last capture p10")
    one.keyboard.press("s")
    for page in (one, two):
        expect(page.locator("sc-rail .answer")).to_contain_text("±")
    one.keyboard.press("Control+z")  # takes back what this page did: the deletion
    for page in (one, two):
        expect(rows(page)).to_have_count(10)
        expect(page.locator("sc-rail")).to_contain_text("out of date")
    assert first.complaints == second.complaints == []


@pytest.mark.thorough
def test_many_captures_are_picked_changed_and_solved(browser: Browser, address: str, api: httpx.Client) -> None:
    """How long the page's tasks take is held by `scancell bench page`: a busy machine says nothing of it."""
    with fresh_page(browser, address) as page:
        assert len(longest_tasks_ms(page, api, many_captures(api, 110), 110)) == 9


@pytest.mark.thorough
def test_a_slow_link_says_what_it_waits_for(open_page: Callable[..., Any], api: httpx.Client) -> None:
    session = simulated_session(api, captures=3)
    page, watched = open_page("/")
    expect(page.locator("sc-session-cards section")).to_be_visible()
    link = page.context.new_cdp_session(page)
    link.send("Network.enable")
    link.send("Network.emulateNetworkConditions", SLOW_LINK)
    page.goto(f"{page.url}sessions/{session}", wait_until="commit")
    expect(page.get_by_text("Loading the session …")).to_be_visible()
    expect(rows(page)).to_have_count(3)
    expect(page.get_by_text("Loading the session …")).to_be_hidden()
    page.keyboard.press("Space")
    expect(rows(page)).to_have_count(4)
    assert watched.complaints == []


@pytest.mark.thorough
def test_without_a_server_nothing_is_lost(open_page: Callable[..., Any], api: httpx.Client, watch: Watch) -> None:
    watch.announce("ERR_INTERNET_DISCONNECTED")
    session = make_session(api)
    page, _ = open_page(f"/sessions/{session}")
    expect(page.locator("sc-live")).to_have_text("connected")
    page.get_by_role("button", name="Paste poses").click()
    page.get_by_label("Poses, one line per capture").fill("0 0 500 0 0 0")
    expect(page.locator(".match tbody tr")).to_have_count(1)
    page.context.set_offline(True)
    page.get_by_label("Poses, one line per capture").fill("0 0 600 0 0 0")
    expect(page.locator(".toast.bad")).to_contain_text("The server cannot be reached. Nothing is lost")
    page.context.set_offline(False)
    page.reload()
    expect(page.get_by_label("Poses, one line per capture")).to_have_value("0 0 600 0 0 0")
    expect(page.locator(".match tbody tr")).to_contain_text("600.0 mm")


@pytest.mark.thorough
def test_a_restart_in_the_middle_of_a_solve(profile: SharedProfile, tmp_path: Path, watch: Watch) -> None:
    watch.allow("ERR_CONNECTION_REFUSED")
    settings: dict[str, Any] = {"data": tmp_path / "data", "warm_up": False}
    page = profile.open()
    with serving(Settings(port=0, **settings)) as client:
        port = client.base_url.port
        assert port is not None
        session = simulated_session(client, captures=10)
        page.goto(f"http://127.0.0.1:{port}/sessions/{session}")
        expect(page.locator("sc-live")).to_have_text("connected")
        page.keyboard.press("s")
        expect(page.locator(".job")).to_be_visible()
    expect(page.locator("sc-live")).to_contain_text("no connection since")
    with serving(Settings(port=port, **settings)):
        expect(page.locator("sc-live")).to_have_text("connected", timeout=20_000)
        expect(page.locator(".job")).to_be_hidden()
        if page.get_by_role("tab", name="Measure").get_attribute("aria-selected") == "true":
            page.keyboard.press("s")
        expect(page.locator(".answer-card")).to_contain_text("accepted", timeout=120_000)
        page.close()
