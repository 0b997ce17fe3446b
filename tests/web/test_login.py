"""A server that demands a login, in a real browser: in, about, out; and what somebody sees who may only look."""

import re
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Page, Route, expect

from tests.server.access import bearer, guarded, site_of
from tests.server.live_server import simulated_session
from tests.web.browsing import SharedProfile, Watch, Watched
from tests.web.test_accessible import violations

pytestmark = pytest.mark.browser

REASON = "Your login can only view. Capturing, changing and solving need the role capture."


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[httpx.Client, dict[str, str], str]]:
    with guarded(tmp_path_factory.mktemp("login")) as (client, tokens):
        client.headers.update(bearer(tokens["capture"]))
        session = simulated_session(client, captures=2)
        yield client, tokens, session


def log_in(page: Page, token: str) -> None:
    page.get_by_label("Token").fill(token)
    page.get_by_role("button", name="Log in").click()


def test_in_and_out(profile: SharedProfile, served, axe: str, watch: Watch) -> None:
    watch.announce("status of 401")
    client, tokens, session = served
    page = profile.open()
    watched = Watched(page)
    page.goto(f"{site_of(client)}/sessions/{session}")
    expect(page).to_have_url(f"{site_of(client)}/login?next=%2Fsessions%2F{session}")
    expect(page.get_by_label("Token")).to_be_focused()
    log_in(page, "scancell_wrong")
    expect(page.get_by_role("alert")).to_contain_text("Check that all of it was pasted")
    assert [line for line in watched.complaints if "401" not in line] == []
    watched.complaints.clear()
    page.get_by_label("Token").fill(tokens["capture"])
    page.get_by_label("Token").press("Enter")
    expect(page).to_have_url(f"{site_of(client)}/sessions/{session}")
    expect(page.locator(".captures tbody tr")).to_have_count(2)
    assert page.evaluate("document.cookie") == ""
    page.keyboard.press("Space")
    expect(page.locator(".captures tbody tr")).to_have_count(3)
    page.get_by_role("button", name="More", exact=True).click()
    expect(page.get_by_role("group", name="More")).to_contain_text("one who may capture")
    page.get_by_role("button", name="Log out").click()
    expect(page.get_by_label("Token")).to_be_visible()
    page.goto(site_of(client))
    expect(page.get_by_label("Token")).to_be_visible()
    assert watched.complaints == []
    assert watched.hosts == {site_of(client).removeprefix("http://")}


def test_the_login_leads_nowhere_else(profile: SharedProfile, served) -> None:
    client, tokens, _ = served
    page = profile.open()
    for next_page in ("https://evil.example/", "//evil.example/", "javascript:alert(1)", "/login"):
        page.goto(f"{site_of(client)}/login?next={next_page}")
        log_in(page, tokens["read"])
        expect(page).to_have_url(f"{site_of(client)}/")
        page.goto("about:blank")  # a page that is logged out in the middle of loading goes to the login itself
        page.context.clear_cookies()
    page.goto(f"{site_of(client)}/login")
    log_in(page, tokens["read"])
    expect(page).to_have_url(f"{site_of(client)}/")
    page.goto(f"{site_of(client)}/login?next=/docs")  # who is logged in already goes on at once
    expect(page).to_have_url(f"{site_of(client)}/docs")


def test_a_request_from_before_the_login_ends_nothing(profile: SharedProfile, served, watch: Watch) -> None:
    watch.allow("status of 401")
    client, tokens, session = served
    site = site_of(client)
    page = profile.open(f"{site}/login?next=/sessions/{session}")
    log_in(page, tokens["capture"])
    rows = page.locator(".captures tbody tr")
    expect(rows.first).to_be_visible()
    before = rows.count()
    refused: list[str] = []

    def refuse(route: Route) -> None:
        refused.append(route.request.url)
        route.fulfill(status=401, content_type="application/problem+json", body='{"status": 401, "detail": "no"}')

    page.route(re.compile("/sources/simulated/capture"), refuse, times=1)
    page.keyboard.press("Space")  # refused, as if it had been sent before the login: it is sent again
    expect(rows).to_have_count(before + 1)
    expect(page).to_have_url(f"{site}/sessions/{session}")
    assert len(refused) == 1


def test_a_page_that_is_being_left_does_not_turn_the_way(profile: SharedProfile, served, watch: Watch) -> None:
    watch.allow("status of 401")
    client, tokens, session = served
    site = site_of(client)
    page = profile.open(f"{site}/login?next=/sessions/{session}")
    log_in(page, tokens["capture"])
    expect(page.locator(".captures tbody tr").first).to_be_visible()

    def come_late(route: Route) -> None:
        page.context.clear_cookies()
        page.keyboard.press("Space")  # the page that is still there asks, and is refused
        page.wait_for_timeout(500)
        route.continue_()

    page.route(f"{site}/docs", come_late)
    page.evaluate("() => { window.location.assign('/docs'); }")
    expect(page).to_have_url(f"{site}/login?next=%2Fdocs")


def test_accessible_and_for_one_who_may_look(profile: SharedProfile, served, axe: str, watch: Watch) -> None:
    watch.announce("status of 401")
    client, tokens, session = served
    page = profile.open(f"{site_of(client)}/login", reduced_motion="reduce")
    expect(page.get_by_label("Token")).to_be_visible()
    page.get_by_text("I have no token").click()
    assert violations(page, axe) == []
    log_in(page, "wrong")
    expect(page.get_by_role("alert")).to_be_visible()
    assert violations(page, axe) == []
    log_in(page, tokens["read"])
    start = page.get_by_role("button", name="Start the simulated cell")
    expect(start).to_have_attribute("aria-disabled", "true")
    expect(start).to_have_accessible_description(REASON)
    start.click(force=True)
    expect(page.locator(".toast")).to_contain_text(REASON)
    expect(page.get_by_role("button", name="Delete session").first).to_have_attribute("aria-disabled", "true")
    page.get_by_role("button", name="More", exact=True).click()
    assert violations(page, axe) == []
    page.goto(f"{site_of(client)}/sessions/{session}")
    expect(page.locator(".captures tbody tr").first).to_be_visible()
    for name in ("Solve", "Capture", "Add files", "Paste poses"):
        button = page.locator("sc-actions").get_by_role("button", name=name).first
        expect(button).to_have_attribute("aria-disabled", "true")
    before = len(client.get(f"/sessions/{session}/captures").json()["items"])
    page.keyboard.press("Space")
    expect(page.locator(".toast")).to_contain_text(REASON)
    page.keyboard.press("s")
    use = page.get_by_role("checkbox", name=re.compile("^Use ")).first
    use.click(force=True)
    expect(use).to_be_checked()
    assert len(client.get(f"/sessions/{session}/captures").json()["items"]) == before
    assert violations(page, axe) == []


def test_a_revoked_token_ends_an_open_page(profile: SharedProfile, served, watch: Watch) -> None:
    watch.allow("status of 401")  # it may ask once more, or be told first
    client, tokens, session = served
    admin = bearer(tokens["admin"])
    made = client.post("/tokens", json={"name": "guest", "role": "read"}, headers=admin).json()
    page = profile.open(f"{site_of(client)}/login?next=/sessions/{session}")
    log_in(page, made["token"])
    expect(page.locator("sc-live")).to_contain_text("connected")
    start_s = time.monotonic()
    client.delete(f"/tokens/{made['id']}", headers=admin)
    expect(page.get_by_label("Token")).to_be_visible()
    assert time.monotonic() - start_s < 15


def test_the_scene_needs_the_login_too(profile: SharedProfile, served, tmp_path: Path, watch: Watch) -> None:
    watch.announce("status of 401")
    client, tokens, session = served
    page = profile.open(scene=True)
    watched = Watched(page)
    assert page.goto(f"{site_of(client)}/scenes/{session}/").status == 401
    watched.complaints.clear()
    page.goto(f"{site_of(client)}/login?next=/sessions/{session}")
    log_in(page, tokens["read"])
    scene = page.frame_locator("iframe")
    expect(scene.locator("#scancell-legend")).not_to_be_empty()
    expect(scene.locator("canvas").first).to_be_visible()
    assert [line for line in watched.complaints if "Content Security" in line] == []
