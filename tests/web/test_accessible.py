"""axe finds nothing to object to, in both themes; and the page weighs little."""

import re
from collections.abc import Iterator

import httpx
import pytest
from playwright.sync_api import FilePayload, Page, expect

from tests.server.live_server import make_session, simulated_session, wait_for
from tests.web.browsing import LOADED, SharedProfile, Watch, in_language

pytestmark = pytest.mark.browser

_AXE = """async ([within, rules]) => {
  const where = { exclude: [["iframe"]], ...(within ? { include: [[within]] } : {}) };
  return (await axe.run(where, { iframes: false, resultTypes: ["violations"], ...rules })).violations;
}"""


@pytest.fixture
def page(profile: SharedProfile) -> Page:
    return profile.open(reduced_motion="reduce")


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        yield client


def violations(page: Page, axe: str, within: str = "") -> list[str]:
    """What axe objects to on the page, or in a part of it, in both themes; the scene has its own tests."""
    page.evaluate(axe)
    page.emulate_media(color_scheme="light")
    found = page.evaluate(_AXE, [within, {}])
    page.emulate_media(color_scheme="dark")  # nothing else than colours differs
    found += page.evaluate(_AXE, [within, {"runOnly": ["color-contrast"]}])
    return [
        f"{one['id']}: {node['html'][:160]} {node['failureSummary']}" for one in found for node in one["nodes"]
    ]


def test_start(page: Page, axe: str, api: httpx.Client) -> None:
    make_session(api, name="for the list")
    page.goto("/")
    expect(page.locator(".session-card").first).to_be_visible()
    expect(page.locator(".way sc-drawing svg")).to_have_count(3)
    assert violations(page, axe) == []
    page.get_by_role("button", name="New session").click()
    page.get_by_text("More", exact=True).click()
    page.get_by_role("button", name="Create session").click()
    assert violations(page, axe, "dialog") == []


def test_start_with_an_archive_refused_and_the_tour(page: Page, axe: str, watch: Watch) -> None:
    watch.announce("status of 422")
    page.goto("/")
    archive = FilePayload(name="cell.zip", mimeType="application/zip", buffer=b"no archive")
    page.locator("input[accept='.zip']").set_input_files(archive)
    expect(page.locator(".toast.bad")).to_be_visible()
    assert violations(page, axe) == []
    page.get_by_role("button", name="Take the tour").click()
    expect(page.locator(".tour")).to_be_visible()
    assert violations(page, axe, ".tour") == []


def test_captures_compared_and_poses_in_columns(page: Page, axe: str, api: httpx.Client) -> None:
    page.goto(f"/sessions/{simulated_session(api, captures=2)}")
    page.get_by_label("Compare p02 with").select_option("p01")
    expect(page.get_by_role("region", name="p02 beside p01")).to_contain_text("turns")
    page.get_by_role("checkbox", name="Use p01").uncheck()
    expect(page.get_by_role("button", name="Undo:")).to_be_visible()
    page.get_by_role("button", name="Paste poses").click()
    page.get_by_label("Poses, one line per capture").fill(
        "f;x;y;z;q1;q2;q3;q4\np1;1;2;3;1;0;0;0\np2;1;2;3;1;0;0;x"
    )
    expect(page.locator("sc-pose-columns thead select")).to_have_count(8)
    expect(page.locator(".match tbody tr")).to_have_count(2)
    assert violations(page, axe) == []


def test_what_is_not_there_or_not_allowed(page: Page, axe: str, api: httpx.Client, watch: Watch) -> None:
    watch.announce("status of 404")
    page.goto("/sessions/not-there")
    expect(page.get_by_role("link", name="Back to all sessions")).to_be_visible()
    assert violations(page, axe) == []
    page.goto(f"/sessions/{make_session(api)}")
    page.get_by_role("button", name="Watch a folder").click()
    expect(page.get_by_text("SCANCELL_WATCH_ROOT")).to_be_visible()
    assert violations(page, axe) == []


def test_session(page: Page, axe: str, api: httpx.Client) -> None:
    session = simulated_session(api, captures=14, scenario="tcp-moved-sphere")
    page.goto(f"/sessions/{session}")
    expect(page.locator(".captures tbody tr")).to_have_count(14)
    assert violations(page, axe) == []
    page.get_by_role("button", name="Paste poses").click()
    page.get_by_label("Poses, one line per capture").fill("1 2 3")
    expect(page.locator(".match tbody tr")).to_have_count(1)
    assert violations(page, axe, "sc-intake") == []
    page.get_by_role("button", name="Solve").click()
    expect(page.locator(".answer-card")).to_be_visible()
    assert violations(page, axe) == []
    page.get_by_role("tab", name="Measure").click()
    expect(page.locator(".captures")).to_contain_text("rejected")
    assert violations(page, axe, "sc-captures") == []


@pytest.fixture(scope="module")
def solved(address: str) -> str:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        session = simulated_session(client, captures=8)
        assert wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"])["status"] == "done"
    return session


@pytest.mark.thorough(keep=2)
@pytest.mark.parametrize("language", ["en-GB", "de-DE", "zh-CN"])
def test_weight(profile: SharedProfile, solved: str, language: str) -> None:
    """Each page, and a look at a result, without data and scene, stays below 285 kB; half of it travels."""
    measured, result = f"/sessions/{solved}#tcp", f"/sessions/{solved}#tcp.result"
    for path, ready in (
        ("/", "sc-session-cards section"),
        (measured, ".captures tbody tr"),
        (result, ".evidence-plot svg"),
    ):
        page = profile.open()
        in_language(page, language)
        page.goto(path)
        expect(page.locator(ready).first).to_be_visible()
        expect(page.locator("html")).to_have_attribute("lang", re.compile(f"^{language[:2]}"))
        size, travelled = page.evaluate(LOADED)
        assert 20_000 < size < 285_000, path
        assert travelled < 150_000, path
