"""The first page: sessions found and filtered, archives brought in or refused with a reason, the tour."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.server.live_server import make_session, simulated_session, wait_for
from tests.web.browsing import Watch

pytestmark = pytest.mark.browser


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        yield client


@pytest.fixture
def archive(api: httpx.Client, tmp_path: Path) -> Path:
    """An archive of a session with two captures."""
    session = simulated_session(api, captures=2)
    api.patch(f"/sessions/{session}", json={"name": "from the archive"})
    path = tmp_path / "cell.zip"
    path.write_bytes(api.get(f"/sessions/{session}/archive?scene=false").content)
    return path


def drop(page: Page, name: str, content: bytes) -> None:
    """Let a file fall on the page."""
    transfer = page.evaluate_handle(
        """([name, bytes]) => {
            const transfer = new DataTransfer();
            transfer.items.add(new File([new Uint8Array(bytes)], name));
            return transfer;
        }""",
        [name, list(content)],
    )
    page.locator("sc-start").dispatch_event("drop", {"dataTransfer": transfer})


def test_an_archive_dropped_on_the_page_becomes_a_session(open_page: Callable[..., Any], archive: Path) -> None:
    page, watched = open_page()
    drop(page, archive.name, archive.read_bytes())
    expect(page).to_have_url(re.compile("/sessions/"))
    expect(page.locator("header")).to_contain_text("from the archive")
    expect(page.locator(".captures tbody tr")).to_have_count(2)
    assert watched.complaints == []


def test_an_archived_session_is_out_of_sight_and_comes_back(
    open_page: Callable[..., Any], api: httpx.Client
) -> None:
    session = make_session(api, name="set aside")
    page, watched = open_page()
    cards = page.locator(".session-card", has_text="set aside")
    cards.get_by_role("button", name="Move session set aside to the archived ones").click()
    expect(cards).to_have_count(0)
    assert api.get(f"/sessions/{session}").json()["archived"] is True
    page.get_by_label("Show sessions by verdict").select_option("archived")
    cards.get_by_role("button", name="Bring back session set aside").click()
    expect(cards).to_have_count(0)
    page.get_by_label("Show sessions by verdict").select_option("all")
    expect(cards).to_have_count(1)
    assert api.get(f"/sessions/{session}").json()["archived"] is False
    assert watched.complaints == []


def test_a_damaged_archive_is_refused_with_its_reason(
    open_page: Callable[..., Any],
    archive: Path,
    api: httpx.Client,
    watch: Watch,
) -> None:
    watch.announce("status of 422")
    before = len(api.get("/sessions?limit=1000").json()["items"])
    page, _ = open_page()
    drop(page, archive.name, archive.read_bytes()[:-300])
    expect(page.locator(".toast.bad")).to_contain_text("Copy the archive again")
    expect(page.locator("sc-progress")).to_be_hidden()
    assert page.url.endswith("/")
    assert len(api.get("/sessions?limit=1000").json()["items"]) == before


def test_a_slow_import_says_how_far_it_is(open_page: Callable[..., Any], archive: Path) -> None:
    page, _ = open_page()
    said: list[str] = []

    def note(words: str) -> None:
        said.append(words)

    page.expose_function("note", note)
    page.locator("sc-progress").wait_for(state="attached")
    page.evaluate("""() => {
        const progress = document.querySelector("sc-progress");
        const told = new MutationObserver(() => note(progress.innerText));
        told.observe(progress, { subtree: true, childList: true, characterData: true });
    }""")
    drop(page, archive.name, archive.read_bytes())
    expect(page).to_have_url(re.compile("/sessions/"))
    assert any("Checking" in words for words in said), said


def test_sessions_are_filtered_by_their_verdict_and_show_a_picture(
    open_page: Callable[..., Any], api: httpx.Client
) -> None:
    solved, empty = simulated_session(api, captures=14), make_session(api, name="nothing yet")
    api.patch(f"/sessions/{solved}", json={"name": "solved one"})
    job = wait_for(api, api.post(f"/sessions/{solved}/solve/tcp").json()["id"])
    assert job["status"] == "done"
    page, watched = open_page()
    page.get_by_role("searchbox").fill("one")
    page.get_by_label("Show sessions by verdict").select_option("accepted")
    card = page.locator(".session-card", has_text="solved one")
    expect(card).to_have_count(1)
    picture = card.locator("img.picture")
    expect(picture).to_be_visible()
    page.wait_for_function("(image) => image.complete && image.naturalWidth === 240", arg=picture.element_handle())
    page.get_by_role("searchbox").fill("nothing yet")
    expect(page.locator(".session-card")).to_have_count(0)
    expect(page.get_by_text("No session matches")).to_be_visible()
    page.get_by_label("Show sessions by verdict").select_option("not solved yet")
    expect(page.locator(".session-card sc-drawing svg")).to_be_visible()
    api.patch(f"/sessions/{solved}/captures/p03", json={"excluded": True})
    page.reload()  # a verdict on captures that have changed since is none
    page.get_by_role("searchbox").fill("one")
    expect(page.locator(".session-card", has_text="solved one").locator(".verdicts")).to_contain_text(
        "out of date"
    )
    page.get_by_label("Show sessions by verdict").select_option("accepted")
    expect(page.locator(".session-card")).to_have_count(0)
    assert watched.complaints == []
    api.delete(f"/sessions/{empty}")


def test_the_tour_is_offered_once_and_walks_by_keyboard(open_page: Callable[..., Any]) -> None:
    page, watched = open_page()
    expect(page.get_by_text("New here?")).to_be_visible()
    page.get_by_role("button", name="Take the tour").click()
    tour = page.locator(".tour")
    expect(tour).to_contain_text("Tour, 1 of 5")
    expect(tour.get_by_role("button", name="Next")).to_be_focused()
    for number in (2, 3, 2, 3, 4, 5):
        page.keyboard.press("ArrowLeft" if number == 2 and "3 of" in tour.inner_text() else "ArrowRight")
        expect(tour).to_contain_text(f"Tour, {number} of 5")
        box = tour.bounding_box()
        assert box is not None
        assert 0 <= box["x"] <= 1280 - box["width"]
        assert 0 <= box["y"] <= 800 - box["height"]
    page.keyboard.press("Escape")
    expect(tour).to_have_count(0)
    page.keyboard.press("Space")  # the page is at work again
    expect(page.locator(".captures tbody tr")).to_have_count(1)
    page.goto("/".join(page.url.split("/")[:3]))
    expect(page.get_by_role("button", name="Take the tour")).to_be_visible()
    expect(page.get_by_text("New here?")).to_have_count(0)
    assert watched.complaints == []
