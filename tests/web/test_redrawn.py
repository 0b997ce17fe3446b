"""What is pressed or has the focus while news come is not lost, though the page draws its place anew."""

from collections.abc import Callable, Iterator

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.server.live_server import simulated_session, wait_for
from tests.web.browsing import SharedProfile

pytestmark = pytest.mark.browser


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        yield client


def by_mouse(page: Page, name: str, news: Callable[[], None]) -> None:
    page.get_by_role("button", name=name).hover()
    page.mouse.down()
    news()
    page.mouse.up()


def by_space(page: Page, name: str, news: Callable[[], None]) -> None:
    page.get_by_role("button", name=name).focus()
    page.keyboard.down(" ")
    news()
    page.keyboard.up(" ")


def by_enter(page: Page, name: str, news: Callable[[], None]) -> None:
    page.get_by_role("button", name=name).focus()
    news()
    page.keyboard.press("Enter")


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("press", [by_mouse, by_space, by_enter])
def test_a_press_counts_though_a_capture_comes_meanwhile(
    profile: SharedProfile, api: httpx.Client, press: Callable[[Page, str, Callable[[], None]], None]
) -> None:
    session = simulated_session(api, captures=3)
    page = profile.open(f"/sessions/{session}", reduced_motion="reduce")
    shown, rows = page.locator("sc-quality h2"), page.locator("table.captures tbody tr")
    expect(shown).to_contain_text("p03")

    def capture() -> None:
        api.post(f"/sessions/{session}/sources/simulated/capture").raise_for_status()
        expect(rows).to_have_count(4)
        if press is by_enter:
            expect(shown).to_contain_text("p04")

    press(page, "Full size", capture)
    expect(page.get_by_role("dialog")).to_be_visible()
    expect(shown).to_contain_text("p04")


def test_approving_counts_though_the_answer_grows_old_meanwhile(profile: SharedProfile, api: httpx.Client) -> None:
    session = simulated_session(api, captures=8)
    assert wait_for(api, api.post(f"/sessions/{session}/solve/tcp").json()["id"])["status"] == "done"
    page = profile.open(f"/sessions/{session}#tcp.result", reduced_motion="reduce")
    notes = page.locator(".answer-card details", has=page.get_by_text("Notes ("))
    notes.locator("summary").first.click()

    def exclude() -> None:
        api.patch(f"/sessions/{session}/captures/p03", json={"excluded": True}).raise_for_status()
        expect(page.locator(".answer-card")).to_contain_text("Inputs changed")

    by_mouse(page, "Approve this answer", exclude)
    expect(page.get_by_role("dialog")).to_contain_text("Approve")
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_role("button", name="Approve all the same")).to_be_visible()
    expect(notes).to_have_attribute("open", "")
