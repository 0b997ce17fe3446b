"""An answer is approved on its page, stands at its cell, is rolled back; who may not is offered nothing of it."""

import re
from collections.abc import Iterator

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.server.access import bearer, guarded, site_of
from tests.server.live_server import simulated_session, wait_for
from tests.web.browsing import SharedProfile
from tests.web.test_accessible import violations

pytestmark = pytest.mark.browser

NAME = "Cell of approvals"


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[httpx.Client, dict[str, str]]]:
    with guarded(tmp_path_factory.mktemp("release")) as (client, tokens):
        client.headers.update(bearer(tokens["admin"]))
        yield client, tokens


@pytest.fixture(scope="module")
def sessions(served: tuple[httpx.Client, dict[str, str]]) -> list[str]:
    """Two sessions of one cell that were solved here."""
    client, _ = served

    def solved() -> str:
        session = simulated_session(client, captures=14)
        assert wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"])["status"] == "done"
        client.patch(f"/sessions/{session}", json={"name": NAME})
        return session

    return [solved(), solved()]


def log_in(page: Page, client: httpx.Client, token: str, path: str) -> None:
    page.goto(f"{site_of(client)}/login?next={path}")
    page.get_by_label("Token").fill(token)
    page.get_by_role("button", name="Log in").click()


def approve(page: Page, why: str) -> None:
    """Approve the answer that is shown, by keyboard."""
    page.get_by_role("button", name="Approve this answer").press("Enter")
    expect(page.get_by_label("Why")).to_be_focused()
    page.keyboard.type(why)
    page.keyboard.press("Enter")
    expect(page.get_by_role("dialog")).to_have_count(0)


@pytest.mark.thorough
def test_an_answer_is_approved_stands_at_its_cell_and_is_rolled_back(
    profile: SharedProfile, served: tuple[httpx.Client, dict[str, str]], sessions: list[str], axe: str
) -> None:
    client, tokens = served
    first, second = sessions
    site = site_of(client)
    page = profile.open(reduced_motion="reduce")
    log_in(page, client, tokens["admin"], f"/sessions/{first}%23tcp.result")
    approval = page.get_by_role("region", name="Approval")
    expect(approval).to_contain_text("Not approved yet.")
    page.get_by_role("button", name="Approve this answer").click()
    assert violations(page, axe, "dialog") == []
    page.get_by_role("button", name="Cancel").click()
    approve(page, "set up after the move")
    expect(approval).to_contain_text("Approved by one who may admin")
    expect(approval).to_contain_text(": set up after the move")
    expect(approval).to_contain_text("the current answer of cell cell-of-approvals")
    expect(approval.get_by_role("heading")).to_be_focused()
    expect(approval.get_by_role("button")).to_have_count(0)
    assert violations(page, axe, ".approval") == []

    # An auditor's way on: the report tells the release, the review who decided, and it replays.
    with page.expect_popup() as opened:
        page.get_by_role("link", name="Report", exact=True).click()
    expect(opened.value.locator("body")).to_contain_text("Release 1 by one who may admin")
    opened.value.close()
    page.get_by_role("link", name="Review").click()
    expect(page.locator("sc-review-log")).to_contain_text("Reason: set up after the move")
    page.get_by_role("button", name="Recompute and compare").click()
    expect(page.locator(".recomputed .banner")).to_contain_text("All numbers are reproduced", timeout=120_000)

    page.goto(f"{site}/sessions/{second}#tcp.result")
    expect(approval).to_contain_text("Its current answer is of another session: Approved by one who may admin")
    approve(page, "new tool")
    expect(approval).to_contain_text(": new tool")

    page.goto(f"{site}/")
    at_cell = page.get_by_role("region", name="Current answer of cell cell-of-approvals")
    expect(at_cell).to_contain_text("at the workpiece")
    expect(at_cell).to_contain_text(": new tool")
    expect(at_cell.get_by_role("link")).to_have_attribute("href", f"/sessions/{second}")
    at_cell.get_by_text("Earlier approvals").press("Enter")
    expect(at_cell).to_contain_text("set up after the move")
    assert violations(page, axe, ".in-force") == []
    at_cell.get_by_role("button", name=f"Roll back to the answer of {NAME}, solved ").press("Enter")
    page.keyboard.type("scans are off")
    page.keyboard.press("Enter")
    expect(at_cell).to_contain_text("scans are off")
    expect(at_cell.locator("summary")).to_be_focused()
    expect(at_cell.get_by_role("link").first).to_have_attribute("href", f"/sessions/{first}")
    assert client.get("/cells/cell-of-approvals/history").json()["releases"][0]["action"] == "rollback"

    client.patch(f"/sessions/{second}/captures/p03", json={"excluded": True})
    page.goto(f"{site}/sessions/{second}#tcp.result")
    expect(approval).to_contain_text("Inputs changed since it was solved.")
    page.get_by_role("button", name="Approve all the same").press("Enter")
    expect(page.get_by_role("dialog")).to_contain_text("Inputs changed since it was solved.")
    page.get_by_role("button", name="Cancel").click()

    page.goto("about:blank")  # an open page whose login ends goes to the login itself
    page.context.clear_cookies()
    log_in(page, client, tokens["read"], "/")
    at_cell.get_by_text("Earlier approvals").click()
    expect(at_cell).to_contain_text("new tool")
    expect(at_cell.get_by_role("button")).to_have_count(0)
    page.goto(f"{site}/sessions/{first}#tcp.result")
    expect(approval).to_contain_text("Put in force again by one who may admin")
    expect(approval.get_by_role("button")).to_have_count(0)
    # Another puts the other session's answer in force meanwhile: the open page tells it.
    releases = client.get("/cells/cell-of-approvals/history").json()["releases"]
    theirs = {"number": next(r["number"] for r in releases if r["session"] == second), "why": "from elsewhere"}
    client.post("/cells/cell-of-approvals/rollback", json=theirs).raise_for_status()
    expect(approval).to_contain_text("Its current answer is of another session")
    expect(approval).to_contain_text(": from elsewhere")


def test_limits_are_set_before_the_first_capture(
    profile: SharedProfile, served: tuple[httpx.Client, dict[str, str]], axe: str
) -> None:
    client, tokens = served
    session = simulated_session(client, scenario="verify")
    page = profile.open(reduced_motion="reduce")
    log_in(page, client, tokens["capture"], f"/sessions/{session}%23verify")
    limits = page.get_by_role("region", name="Limits")
    limits.get_by_text("More limits and what they are measured with").press("Enter")
    limits.get_by_label("Probing form, limit in mm").fill("0.2")
    assert violations(page, axe, "sc-limits") == []
    limits.get_by_role("button", name="Set limits").press("Enter")
    expect(page.locator(".toast")).to_contain_text("Limits set")
    assert client.get(f"/sessions/{session}").json()["cell"]["verification"]["form_mm"] == 0.2
    taken = client.post(f"/sessions/{session}/sources/simulated/capture?step=verify")
    assert taken.status_code == 201, taken.text
    expect(limits).to_contain_text("Figures are judged by these limits:")
    expect(limits.locator("dl > div", has_text="Probing form, limit in mm")).to_have_text(re.compile("0.2$"))
    expect(limits.get_by_role("textbox")).to_have_count(0)

    limits.get_by_text("Change limits …").press("Enter")
    expect(limits).to_contain_text("a change is kept with its date, name and both values")
    limits.get_by_text("More limits and what they are measured with").press("Enter")
    limits.get_by_label("Probing form, limit in mm").fill("0.35")
    assert violations(page, axe, "sc-limits") == []
    limits.get_by_role("button", name="Change limits").press("Enter")
    asked = page.get_by_role("dialog")
    asked.get_by_role("textbox").fill("the part became coarser")
    asked.get_by_role("textbox").press("Enter")
    expect(limits.locator("dl > div", has_text="Probing form, limit in mm")).to_have_text(re.compile("0.35$"))
    (kept,) = client.get(f"/sessions/{session}").json()["cell"]["verification"]["changes"]
    assert (kept["field"], kept["before_mm"], kept["after_mm"], kept["captures"]) == ("form_mm", 0.2, 0.35, 1)
    assert kept["why"] == "the part became coarser"
