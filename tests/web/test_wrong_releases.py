"""Each way to a wrong release is refused or marked with its reason: by REST, by the command line and by the page.

The page says what is wrong beforehand; its person is logged in once for all ways.
"""

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from tests.server import wrong_releases as by
from tests.server.access import site_of
from tests.server.wrong_releases import World, command, world
from tests.verified import verified_session
from tests.web.browsing import SharedProfile, leave_out_the_scene, watching
from tests.web.test_release import log_in

pytestmark = pytest.mark.browser

TEXTS = json.loads((Path(__file__).parents[2] / "web" / "texts" / "release.json").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Person:
    """Who tries, at one page, logged in."""

    page: Page
    here: World

    def result(self, cell: str, stage: str = "tcp") -> Locator:
        """Open a result; its approval."""
        self.page.goto("about:blank")  # an address that differs behind the # alone loads nothing
        self.page.goto(f"{site_of(self.here.client)}{self.here.paths[cell]}#{stage}.result")
        return self.page.get_by_role("region", name="Approval")

    def at_start(self) -> None:
        self.page.goto(f"{site_of(self.here.client)}/")

    def in_force(self, cell: str) -> Locator:
        self.at_start()
        return self.page.get_by_role("region", name=f"Current answer of cell {cell}")

    def why(self, go: str) -> Locator:
        """Do what asks why, and say it; the dialog, which stays where the server refuses."""
        self.page.get_by_role("button", name=go).first.press("Enter")
        self.page.keyboard.type("it will do")
        self.page.keyboard.press("Enter")
        return self.page.get_by_role("dialog")


Way = Callable[[Person], None]


def told(cell: str, fault: str) -> Way:
    """Return the way whose approval says the fault, and says it again before it is gone on with."""

    def go(one: Person) -> None:
        approval, said = one.result(cell), TEXTS[f"release.fault.{fault}"]
        expect(approval).to_contain_text(said)
        if fault not in ("stale", "fail", "differs"):  # these are the result's own verdict
            expect(one.page.locator(".answer-card.against")).to_contain_text(said)
        if fault == "verify-fail":
            expect(one.page.locator("[data-step=tcp].status-failing")).to_have_attribute("title", said)
        expect(one.page.locator(".answer-card .mark-pass")).to_have_count(0)
        one.page.get_by_role("button", name="Approve all the same").press("Enter")
        expect(one.page.get_by_role("dialog")).to_contain_text(said)
        one.page.get_by_role("button", name="Cancel").click()

    return go


def decided_before(cell: str, words: str) -> Way:
    """Return the way whose approval says the decision before, and what was changed since."""

    def go(one: Person) -> None:
        approval = one.result(cell)
        expect(approval).to_contain_text("was: failed")
        expect(approval).to_contain_text(words)
        expect(one.page.get_by_role("button", name="Approve all the same")).to_be_visible()

    return go


def exported(one: Person) -> None:
    one.result("failed")
    one.page.get_by_label("Export …").select_option("kuka")
    asked = one.page.get_by_role("dialog")
    asked.get_by_role("button", name="Save file").press("Enter")
    expect(asked.get_by_role("alert")).to_contain_text("verification")


def rolled_back(one: Person) -> None:
    expect(one.in_force("rolled")).to_contain_text(TEXTS["release.fault.verify-fail"])
    expect(one.result("rolled")).to_contain_text(TEXTS["release.fault.verify-fail"])
    better = one.here.session("rolled", verified_session(21))
    one.here.release(better, allow="drift").raise_for_status()
    at_cell = one.in_force("rolled")
    at_cell.get_by_text("Earlier approvals").press("Enter")
    expect(one.why("Roll back to the answer of").get_by_role("alert")).to_contain_text("verify-fail")
    assert one.here.client.get("/cells/rolled/history").json()["releases"][0]["session"] in better


def one_wrong_pose(one: Person) -> None:
    one.result("one", "verify")
    (said, *_) = one.here.client.get(f"{one.here.paths['one']}/results/verify").json()["findings"]
    expect(one.page.get_by_text(said["text"].partition(":")[0]).filter(visible=True).first).to_be_visible()


def by_who_captured(one: Person) -> None:
    one.result("eyes")
    expect(one.why("Approve this answer").get_by_role("alert")).to_contain_text("four eyes")


def deleted(one: Person) -> None:
    one.at_start()
    card = one.page.locator(".session-card", has=one.page.locator(f"a[href='{one.here.paths['kept']}']")).first
    card.locator("button.trash").first.press("Enter")
    one.page.get_by_role("dialog").get_by_role("button", name="Delete").press("Enter")
    expect(one.page.locator(".toast.bad")).to_contain_text("in force")
    one.here.client.get(one.here.paths["kept"]).raise_for_status()


def edited(one: Person) -> None:
    one.at_start()
    one.page.locator("input[accept='.zip']").set_input_files(one.here.folder / "edited.zip")
    expect(one.page.locator(".toast.bad")).to_be_visible()


def of_a_folder_edited(one: Person) -> None:
    newest = one.here.client.get("/sessions").json()["items"][0]["id"]
    one.here.paths["imported"] = f"/sessions/{newest}"
    for _ in range(600):  # until its replay is done
        if one.here.answer(one.here.paths["imported"])["faults"] == ["differs"]:
            break
        time.sleep(0.2)
    told("imported", "differs")(one)


BY_PAGE: Mapping[Callable[[World], str], Way] = {
    by.an_archive_whose_result_was_edited: edited,
    by.a_folder_whose_result_was_edited: of_a_folder_edited,
    by.release_of_a_failed_verification: told("failed", "verify-fail"),
    by.export_of_a_failed_verification: exported,
    by.rollback_to_it: rolled_back,
    by.a_capture_left_out_after_the_decision: decided_before("picked", "left out"),
    by.a_limit_widened_after_the_decision: decided_before("widened", "limits were changed"),
    by.a_limit_taken_away_after_the_decision: decided_before("unlimited", "limits were changed"),
    by.the_verification_deleted: told("deleted", "verify-fail"),
    by.a_stale_answer: told("stale", "stale"),
    by.an_answer_that_failed: told("wrong", "fail"),
    by.captures_that_calibrated_verify: told("copied", "verify-undecided"),
    by.two_captures_verify: told("few", "verify-undecided"),
    by.no_verification_where_the_policy_needs_one: told("unverified", "verify-undecided"),
    by.one_wrong_pose_among_those_that_verify: one_wrong_pose,
    by.a_tool_that_was_bumped: told("bumped", "drift"),
    by.another_scanner: told("replaced", "equipment-changed"),
    by.an_answer_that_is_overdue: told("late", "overdue"),
    by.released_by_who_captured: by_who_captured,
    by.evidence_in_force_deleted: deleted,
}
"""The others are no page's: it sets no policy, and allows nothing that it does not name."""
OF_THE_SESSION = {"failed": "verify-fail", "stale": "stale", "wrong": "fail"}
"""What an archive by itself knows; the rest is its cell's, of which the command line releases nothing."""


MAKES = {
    "bumped": by.a_tool_that_was_bumped,
    "failed": by.release_of_a_failed_verification,
    "stale": by.a_stale_answer,
    "wrong": by.an_answer_that_failed,
}


def made(here: World, cell: str) -> None:
    """Make a cell's session, unless the way that makes it went before: tests run alone and in any process."""
    if cell not in here.paths:
        MAKES[cell](here)


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    with world(tmp_path_factory.mktemp("channels")) as made:
        yield made


@pytest.fixture(scope="module")
def person(here: World, chromium: Browser, shared_profile: SharedProfile) -> Iterator[Person]:
    """Who may do all, at a page that is watched until all was tried."""
    with watching(chromium) as watch:
        watch.allow("status of (409|422)")  # not every way ends in one, and workers share the ways
        watch.follow(shared_profile.context)
        page = shared_profile.open(reduced_motion="reduce")
        log_in(page, here.client, here.tokens["admin"], "/")
        page.wait_for_url(f"{site_of(here.client)}/")
        yield Person(page, here)
        shared_profile.clear()


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("way", by.WAYS, ids=lambda way: way.__name__)
def test_it_is_refused_or_marked(way: Callable[[World], str], here: World, person: Person) -> None:
    for channel in (way, by.BY_COMMAND.get(way)):
        assert channel is None or channel(here).startswith(("refused", "marked"))
    if way in BY_PAGE:
        BY_PAGE[way](person)


@pytest.mark.thorough
def test_who_only_captures_is_offered_no_approval(here: World, browser: Browser) -> None:
    # A profile of its own: at the shared one's pages somebody stays logged in, who would be sent away.
    with browser.new_context(reduced_motion="reduce") as profile:
        leave_out_the_scene(profile)
        page = profile.new_page()
        log_in(page, here.client, here.tokens["capture"], "/")
        page.wait_for_url(f"{site_of(here.client)}/")
        for cell in ("bumped", "failed"):
            made(here, cell)
            approval = Person(page, here).result(cell)
            expect(approval).to_contain_text("need the role release")
            expect(approval.get_by_role("button")).to_have_count(0)


@pytest.mark.thorough
def test_an_archive_tells_what_it_knows_by_itself(here: World, tmp_path: Path) -> None:
    for cell, fault in OF_THE_SESSION.items():
        made(here, cell)
        packed, path = tmp_path / f"{cell}.zip", here.failed if cell == "failed" else here.paths[cell]
        packed.write_bytes(here.client.get(f"{path}/archive", params={"scene": False}).raise_for_status().content)
        status, said = command("export", str(packed), "--format", "kuka")
        assert status == 1, said
        status, said = command("answer", str(packed), "--json")
        assert status == 1
        assert fault in json.loads(said)["faults"]
