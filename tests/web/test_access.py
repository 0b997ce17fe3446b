"""The admin's page: tokens by keyboard alone, the log, and nothing of it for others."""

from collections.abc import Iterator

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.server.access import bearer, guarded, site_of
from tests.web.browsing import SharedProfile, Watch
from tests.web.test_accessible import violations

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[httpx.Client, dict[str, str]]]:
    with guarded(tmp_path_factory.mktemp("access")) as (client, tokens):
        yield client, tokens


@pytest.fixture
def page(profile: SharedProfile) -> Page:
    return profile.open(reduced_motion="reduce")


def log_in(page: Page, client: httpx.Client, token: str, path: str = "/access") -> None:
    page.goto(f"{site_of(client)}/login?next={path}")
    page.get_by_label("Token").fill(token)
    page.get_by_role("button", name="Log in").click()


def test_a_token_is_made_used_and_revoked_by_keyboard(page: Page, served, axe: str) -> None:
    client, tokens = served
    log_in(page, client, tokens["admin"], "/")
    page.get_by_role("button", name="More", exact=True).press("Enter")
    page.get_by_role("link", name="Access").press("Enter")
    expect(page.get_by_role("heading", name="Access")).to_be_visible()
    table = page.get_by_role("region", name="Tokens")
    expect(table.locator("tbody tr").first).to_be_visible()
    assert violations(page, axe) == []

    name = "robot cell 4"
    page.get_by_label("Name").focus()
    page.keyboard.type(name)
    page.keyboard.press("Tab")
    page.keyboard.type("capture")
    page.keyboard.press("Tab")
    page.keyboard.type("30")
    page.keyboard.press("Enter")
    shown = page.locator(".made-token code")
    expect(shown).to_contain_text("scancell_")
    expect(page.locator(".made-token")).to_contain_text("cannot be shown again")
    assert violations(page, axe) == []
    page.get_by_role("button", name="Copy token").press("Enter")
    token = shown.inner_text()
    assert page.evaluate("navigator.clipboard.readText()") == token
    me = client.get("/me", headers=bearer(token)).json()
    assert (me["name"], me["role"]) == (name, "capture")

    row = table.locator("tr", has_text=name)
    expect(row).to_contain_text("active")
    row.get_by_role("button", name=f"Revoke the token of {name}").press("Enter")
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_role("button", name="Cancel")).to_be_focused()
    assert violations(page, axe) == []
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    expect(row).to_contain_text("revoked")
    assert client.get("/me", headers=bearer(token)).status_code == 401
    log = page.get_by_role("region", name="Log")
    expect(log.locator("tbody tr", has_text="DELETE /api/v1/tokens/").first).to_be_visible()
    expect(log).to_contain_text("one who may admin")
    client.put("/cells/seen/policy", json={"four_eyes": True}, headers=bearer(tokens["admin"])).raise_for_status()
    page.reload()
    log.get_by_text("What changed").first.click()
    expect(log).to_contain_text("four_eyes: – → true")
    expect(table.locator("tr", has_text=name)).to_contain_text("revoked")
    expect(page.locator("body")).not_to_contain_text(token)


def test_ones_own_token_is_not_revoked(page: Page, served, watch: Watch) -> None:
    watch.announce("status of 409")
    log_in(page, served[0], served[1]["admin"])
    page.get_by_role("button", name="Revoke the token of one who may admin").first.click()
    page.get_by_role("dialog").get_by_role("button", name="Revoke").click()
    expect(page.locator(".toast.bad")).to_be_visible()
    page.reload()
    expect(page.get_by_role("region", name="Tokens")).to_contain_text("one who may admin")


@pytest.mark.parametrize("role", ["read", "capture"])
def test_others_see_nothing_of_it(page: Page, served, axe: str, role: str) -> None:
    client, tokens = served
    log_in(page, client, tokens[role])
    expect(page.locator("main")).to_contain_text("need the role admin")
    expect(page.locator("table")).to_have_count(0)
    page.get_by_role("button", name="More", exact=True).click()
    expect(page.get_by_role("group", name="More")).to_contain_text("one who may")
    expect(page.get_by_role("link", name="Access")).to_have_count(0)
    assert violations(page, axe) == []
    for path in ("/tokens", "/audit"):
        assert client.get(path, headers=bearer(tokens[role])).status_code == 403


def test_the_log_goes_back_as_far_as_one_likes(page: Page, served) -> None:
    client, tokens = served
    body, headers = {"cell": {"pose_convention": "abb"}}, bearer(tokens["capture"])
    for _ in range(130):
        assert client.post("/sessions", json=body, headers=headers).is_success
    log_in(page, client, tokens["admin"])
    rows = page.get_by_role("region", name="Log").locator("tbody tr")
    expect(rows).to_have_count(100)
    page.get_by_role("button", name="Show earlier").click()
    expect(rows.nth(129)).to_be_visible()


def test_without_a_login_the_page_says_so(profile: SharedProfile) -> None:
    page = profile.open("/access")
    expect(page.locator("main")).to_contain_text("asks for no login")


def test_who_is_not_logged_in_is_asked_to(profile: SharedProfile, served) -> None:
    page = profile.open(f"{site_of(served[0])}/access")
    expect(page).to_have_url(f"{site_of(served[0])}/login?next=%2Faccess")
