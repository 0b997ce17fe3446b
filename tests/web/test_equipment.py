"""The page: the register of equipment, what a session says of its circumstances, reasons after a decision."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.server.access import bearer, guarded, site_of
from tests.server.live_server import simulated_session
from tests.server.test_equipment import DCC
from tests.server.wrong_releases import World
from tests.verified import verified_session
from tests.web.browsing import SharedProfile
from tests.web.test_accessible import violations

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    with guarded(tmp_path_factory.mktemp("equipment")) as (client, tokens):
        client.headers.update(bearer(tokens["admin"]))
        yield World(client, tokens, Path())


def log_in(page: Page, client: httpx.Client, token: str, path: str) -> None:
    page.goto(f"{site_of(client)}/login?next={path}")
    page.get_by_label("Token").fill(token)
    page.get_by_role("button", name="Log in").click()


@pytest.mark.thorough
def test_a_piece_is_registered_and_a_session_refers_to_it(
    profile: SharedProfile, world: World, axe: str, tmp_path: Path
) -> None:
    client = world.client
    (tmp_path / "K-123.xml").write_bytes(DCC)
    here = f"/sessions/{client.post('/sessions', json={'cell': {'pose_convention': 'ur'}}).json()['id']}"
    page = profile.open(reduced_motion="reduce")
    log_in(page, client, world.tokens["admin"], "/")
    page.get_by_role("button", name="More", exact=True).press("Enter")
    page.get_by_role("link", name="Equipment").press("Enter")
    expect(page.get_by_role("heading", name="Equipment", exact=True)).to_be_visible()
    page.get_by_role("button", name="Enter a piece").press("Enter")
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Read a digital certificate").click()
    chooser.value.set_files(tmp_path / "K-123.xml")
    expect(page.get_by_label("Serial number")).to_have_value("S-4711")
    page.get_by_label("Due").fill("2020-03-01")
    page.get_by_label("Expansion").fill("11,5")
    assert violations(page, axe, "dialog") == []
    page.get_by_label("Laboratory").press("Enter")
    row = page.get_by_role("region", name="Register").locator("tbody tr")
    expect(row).to_contain_text("overdue since 2020-03-01")
    (piece,) = client.get("/equipment").json()["items"]
    assert (piece["name"], piece["certificate"]["number"]) == ("Sphere 80 mm", "K-123")
    assert piece["expansion_per_k"] == pytest.approx(11.5e-6)
    assert violations(page, axe) == []
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Keep the certificate of").click()
    chooser.value.set_files(tmp_path / "K-123.xml")
    expect(row.get_by_role("link", name="K-123")).to_be_visible()

    page.goto(f"{site_of(client)}{here}")
    page.get_by_role("button", name="Equipment and circumstances").press("Enter")
    dialog = page.get_by_role("dialog")
    dialog.get_by_role("button", name="Add", exact=True).first.click()
    expect(dialog).to_contain_text("Sphere 80 mm · S-4711")
    dialog.get_by_text("Another piece").click()
    dialog.get_by_label("Kind").select_option("scanner")
    dialog.get_by_label("Serial number").fill("L-9")  # not added by hand: it is meant all the same
    dialog.get_by_label("Sphere (°C)").fill("24,5")
    dialog.get_by_label("Operator").fill("A. Weber")
    dialog.get_by_label("Further lines").fill("order: 4711")
    assert violations(page, axe, "dialog") == []
    dialog.get_by_role("button", name="Save").click()
    expect(dialog).to_have_count(0)
    session = client.get(here).json()
    assert [(one["kind"], one["serial"]) for one in session["cell"]["equipment"]] == [
        ("sphere", "S-4711"),
        ("scanner", "L-9"),
    ]
    assert session["environment"] == {"ball_c": 24.5}
    assert session["documentation"] == {"operator": "A. Weber", "order": "4711"}

    page.goto("about:blank")
    page.context.clear_cookies()
    log_in(page, client, world.tokens["capture"], "/equipment")
    expect(page.get_by_role("button", name="Enter a piece")).to_have_attribute("aria-disabled", "true")


@pytest.mark.thorough
def test_after_a_decision_the_page_asks_why(profile: SharedProfile, world: World) -> None:
    client = world.client
    here = world.session("asked", replace(verified_session(3)))
    *_, bad, last = (one["id"] for one in client.get(f"{here}/captures", params={"limit": 200}).json()["items"])
    page = profile.open(reduced_motion="reduce")
    log_in(page, client, world.tokens["admin"], f"{here}%23verify")
    use = page.get_by_label(f"Use {last}")
    use.uncheck()
    page.get_by_role("button", name="Cancel").click()
    expect(use).to_be_checked()
    use.uncheck()
    page.get_by_label("Why").fill("somebody leaned on the table")
    page.keyboard.press("Enter")
    expect(page.get_by_role("dialog")).to_have_count(0)
    expect(use).not_to_be_checked()
    because = client.get(f"{here}/captures/{last}").json()["excluded_because"]
    assert (because["who"], because["why"]) == ("one who may admin", "somebody leaned on the table")

    page.get_by_role("button", name=f"Delete {bad}").press("Enter")
    dialog = page.get_by_role("dialog", name="Delete after a decision")
    dialog.get_by_label("Why").fill("the ball was wet")
    page.keyboard.press("Enter")
    expect(page.get_by_label(f"Use {bad}")).to_have_count(0)
    (removed,) = client.get(here).json()["removed"]
    told = {name: removed[name] for name in ("capture", "step", "who", "why")}
    assert told == {"capture": bad, "step": "verify", "who": "one who may admin", "why": "the ball was wet"}

    world.solve(here, "verify")
    client.patch(f"{here}/captures/{last}", json={"excluded": False, "excluded_because": {"why": "it was fine"}})
    client.patch(here, json={"cell": {"verification": {"tool_mm": 5.0}}, "why": "the drawing says 5"})
    world.solve(here, "verify")
    before = client.get(f"{here}/answer").json()["decided_before"]
    why = {one["capture"]: one["because"]["why"] for one in before[0]["left_out"]}
    assert why == {bad: "the ball was wet", last: "somebody leaned on the table"}
    assert before[1]["taken_back"][0]["because"]["why"] == "it was fine"
    assert "reason: it was fine" in before[1]["text"]
    items = client.get(f"{here}/timeline").json()["items"]
    (limit,) = (one for one in items if one["kind"] == "limit")
    assert limit["message"].endswith("By one who may admin, reason: the drawing says 5.")
    report = client.get(f"{here}/report").text
    assert "By one who may admin, reason: the drawing says 5." in report
    page.goto(f"{site_of(client)}{here}/review")
    expect(page.locator("sc-review-log")).to_contain_text("reason: the drawing says 5")
    expect(page.locator("sc-review-log")).to_contain_text("it was fine")
    expect(page.locator("sc-review-log")).to_contain_text(f"Capture {bad} deleted")
    expect(page.locator("sc-review-log")).to_contain_text("the ball was wet")
    page.goto(f"{site_of(client)}{here}#tcp.result")
    expect(page.get_by_role("region", name="Approval")).to_contain_text("somebody leaned on the table")

    page.get_by_role("tab", name="Measure").click()
    first = client.get(f"{here}/captures").json()["items"][0]
    content = client.get(f"{here}/captures/{first['id']}/files/{first['files'][0]}").content
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name=f"Replace {first['id']} with a new file").click()
    chooser.value.set_files({"name": "again.csv", "mimeType": "text/csv", "buffer": content})
    page.get_by_label("Why").fill("the clamp was loose")
    page.keyboard.press("Enter")
    expect(page.get_by_role("dialog")).to_have_count(0)
    replaced = client.get(f"{here}/captures/{first['id']}").json()
    assert replaced["excluded_because"]["why"] == "the clamp was loose"


@pytest.mark.thorough
def test_the_first_capture_after_a_decision_asks_why_and_the_next_ones_keep_it(
    profile: SharedProfile, world: World
) -> None:
    client = world.client
    session = simulated_session(client, scenario="verify", captures=0)
    here, take = f"/sessions/{session}", f"/sessions/{session}/sources/simulated/capture"
    for step in (*["tcp"] * 8, *["verify"] * 4):
        client.post(take, params={"step": step}).raise_for_status()
    world.solve(here, "all")
    page = profile.open(reduced_motion="reduce")
    log_in(page, client, world.tokens["admin"], f"{here}%23verify")
    capture = page.get_by_role("button", name="Capture to verify")
    capture.press("Enter")
    dialog = page.get_by_role("dialog", name="Add after a decision")
    dialog.get_by_role("button", name="Cancel").click()
    expect(capture).to_be_enabled()
    capture.press("Enter")
    dialog.get_by_label("Why").fill("too few decide")
    page.keyboard.press("Enter")
    rows = page.locator("table.captures tbody tr")
    expect(rows).to_have_count(5)
    capture.press("Enter")
    expect(rows).to_have_count(6)
    expect(page.get_by_role("dialog")).to_have_count(0)
    items = client.get(f"{here}/captures", params={"limit": 200}).json()["items"]
    told = [(one["added_because"]["who"], one["added_because"]["why"]) for one in items if "added_because" in one]
    assert told == [("one who may admin", "too few decide")] * 2
