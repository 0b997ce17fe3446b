"""A session's past in a real Chromium: time line, recomputing, history, results side by side, paper."""

import re
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest
from playwright.sync_api import Page, Request, Route, expect

from tests.core.archives import changed
from tests.server.live_server import simulated_session, wait_for
from tests.web.browsing import SharedProfile, Watch
from tests.web.test_accessible import violations

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        yield client


@pytest.fixture(scope="module")
def session(api: httpx.Client) -> str:
    """Fourteen captures of which one was spoiled, a solve, one left out, and a second solve."""
    session = simulated_session(api, captures=14, scenario="tcp-moved-sphere")
    for excluded in ([], ["p03"]):
        for capture in excluded:
            api.patch(f"/sessions/{session}/captures/{capture}", json={"excluded": True})
        assert wait_for(api, api.post(f"/sessions/{session}/solve/tcp").json()["id"])["status"] == "done"
    return session


@pytest.fixture
def page(profile: SharedProfile) -> Page:
    return profile.open(reduced_motion="reduce")


@pytest.mark.thorough
def test_keys_move_through_time_and_everything_follows(open_page: Callable[..., Any], session: str) -> None:
    page, watched = open_page(f"/sessions/{session}/review")
    words = page.locator(".timeline-words")
    # It opens at the last solve, as that was.
    expect(words).to_contain_text("16 of 17 · TCP solved, usable")
    expect(page.locator("sc-review-captures tbody tr")).to_have_count(14)
    expect(page.locator("sc-review-captures tr", has_text="p03")).to_contain_text("excluded")
    newest = page.locator("sc-result .frame-numbers dd").first.inner_text()

    slider = page.get_by_role("slider")
    slider.focus()
    page.keyboard.press("ArrowLeft")
    expect(words).to_contain_text("15 of 17 · TCP solved")
    expect(page.locator("sc-review-captures tr", has_text="p03")).to_contain_text("used")
    expect(page.locator("sc-result .frame-numbers dd").first).not_to_have_text(newest)
    for _ in range(4):
        page.keyboard.press("ArrowLeft")
    expect(words).to_contain_text("11 of 17 · Capture p11")
    expect(page.locator("sc-review-captures tbody tr")).to_have_count(11)
    expect(page.locator("sc-result")).to_contain_text("Not solved yet")
    expect(page.locator("sc-rail .status-working")).to_contain_text("TCP")
    assert slider.get_attribute("aria-valuetext") == words.inner_text()

    # The log and the arrows lead there as well; a capture picked in the table stays picked.
    page.get_by_role("button", name="p02").first.click()
    expect(page.locator("sc-review-captures tr.picked")).to_contain_text("p02")
    page.get_by_role("button", name=re.compile("Capture p04, ")).click()
    expect(page.locator("sc-review-captures tbody tr")).to_have_count(4)
    expect(page.locator("sc-review-captures tr.picked")).to_contain_text("p02")
    page.get_by_role("button", name="One step back").click()
    expect(page.locator("sc-review-captures tbody tr")).to_have_count(3)
    page.get_by_role("button", name="Play").first.click()
    # It goes on while it is looked at: the fifth is seen, and perhaps more.
    expect(page.locator("sc-review-captures tbody tr").nth(4)).to_be_visible()
    page.get_by_role("button", name="Pause").click()
    # Nothing on this page changes the session.
    assert not page.locator("sc-review input[type=checkbox]:not(.scene-layer-list input)").count()
    assert watched.complaints == []


def test_recomputing_shows_stored_and_new(open_page: Callable[..., Any], session: str) -> None:
    page, watched = open_page(f"/sessions/{session}/review")
    page.get_by_role("button", name="Recompute and compare").click()
    expect(page.locator(".recomputed .banner")).to_contain_text("All numbers are reproduced", timeout=120_000)
    page.get_by_text("TCP: stored and new side by side").click()
    expect(page.locator(".side-by-side")).to_contain_text("Identical")
    assert watched.complaints == []


def test_a_session_that_is_not_there_says_so(open_page: Callable[..., Any], watch: Watch) -> None:
    watch.announce("status of 404")
    page, _ = open_page("/sessions/none/review")
    expect(page.get_by_role("link", name="Back to all sessions")).to_be_visible()


@pytest.mark.thorough
def test_from_a_result_to_its_history_and_to_the_comparison(
    open_page: Callable[..., Any],
    session: str,
    api: httpx.Client,
    watch: Watch,
) -> None:
    watch.announce("status of 404")
    page, watched = open_page(f"/sessions/{session}#result")
    # The answer's number and the table that tells it axis by axis are one and the same.
    answer = page.locator(".answer-card .first dd").inner_text().replace("\u202f", " ")
    assert re.fullmatch(r"±0\.\d+ mm", answer)
    workpiece = page.get_by_role("region", name="At the workpiece", exact=True)
    expect(workpiece.locator("tbody tr").first).to_contain_text(answer.removesuffix(" mm"))
    # A plot over the captures, one over the orientation, one of the drift; the spoiled one is crossed in two.
    expect(page.locator("sc-result sc-plot")).to_have_count(3)
    for shape in ("captures", "xy"):
        expect(page.locator(f".plot-{shape} .dot.out")).to_have_attribute("data-capture", "p08")
    # What excluding a capture would do is told before anything is solved again.
    page.locator(".plot-captures .dot[data-capture=p05]").hover()
    expect(page.locator("sc-plot .tip:visible .without")).to_contain_text("Excluding p05 would move the answer by")
    # The same captures in millimetres, in parts along the base's axes, and a piece of them about the one in focus.
    residuals = page.locator("sc-plot", has=page.locator(".plot-captures"))
    shown, fifth = residuals.get_by_label("Figures shown"), residuals.locator(".dot[data-capture=p05]")
    shown.select_option("Distance in mm")
    expect(fifth).to_have_attribute("aria-label", re.compile(r"^p05, \d[\d.]*\smm$"))
    shown.select_option("x in base, y in base, z in base")
    expect(fifth).to_have_count(3)
    shown.select_option("In standard deviations")
    fifth.press("+")
    fifth.press("+")
    expect(residuals.locator(".dot[data-capture=p01]")).to_have_count(0)
    expect(fifth).to_be_focused()
    fifth.press("0")
    expect(residuals.locator(".dot[data-capture=p01]")).to_have_count(1)
    page.get_by_text("History", exact=True).click()
    expect(page.locator(".history tbody tr")).to_have_count(2)
    expect(page.get_by_role("link", name="Report")).to_have_attribute("target", "_blank")

    page.locator(".history").get_by_role("link", name="Compare").click()
    expect(page).to_have_url(re.compile(r"/compare\?stage=tcp&left="))
    # One sentence decides; without one capture nothing really changed.
    expect(page.locator(".decision")).to_contain_text("No real difference")
    expect(page.locator(".changes")).to_contain_text("Capture p03 was excluded")
    frame = page.get_by_role("region", name="Difference: scanner on the flange")
    expect(frame).to_contain_text("combined sigmas")
    expect(frame).to_contain_text("At the workpiece")
    expect(frame.locator("tbody tr")).to_have_count(6)
    residuals = page.get_by_role("region", name="Residuals", exact=True)
    expect(residuals.locator("tbody tr")).to_have_count(14)
    expect(residuals.locator("tr", has_text="p08").locator(".mark-fail")).to_have_count(2)

    # Another session, chosen in the form: the address keeps what is compared.
    other = simulated_session(api, captures=14, seed=8)
    wait_for(api, api.post(f"/sessions/{other}/solve/tcp").json()["id"])
    page.reload()
    page.get_by_label("Second session").select_option(other)
    expect(page.locator(".decision")).to_contain_text("Really different")
    expect(page.locator(".comparison")).to_contain_text("differ by more than their uncertainty")
    expect(page).to_have_url(re.compile(f"right={other}"))
    # What was not solved is said where the answer would be.
    page.get_by_label("Step").select_option("turntable")
    expect(page.get_by_role("alert").filter(has_text="not solved")).to_be_visible()
    assert [c for c in watched.complaints if "404" not in c] == []


@pytest.mark.thorough
def test_axe_and_paper(page: Page, axe: str, session: str, api: httpx.Client) -> None:
    page.goto(f"/sessions/{session}/review")
    expect(page.locator("sc-review-captures tbody tr")).to_have_count(14)
    page.locator(".scene-layers summary", has_text="Layers").click()
    assert violations(page, axe) == []
    # On paper there are neither controls nor scene, and all of the columns.
    page.emulate_media(media="print")
    expect(page.locator("sc-scene")).to_be_hidden()
    expect(page.get_by_role("slider")).to_be_hidden()
    work = page.locator(".review-work").bounding_box()
    assert work is not None
    assert work["height"] > 1200
    page.emulate_media(media="screen")

    page.goto(f"/sessions/{session}#result")
    expect(page.locator(".result-links")).to_be_visible()
    page.get_by_text("History", exact=True).click()
    expect(page.locator(".history tbody tr")).to_have_count(2)
    assert violations(page, axe) == []
    # Others work on meanwhile: the answer is drawn anew, and what was opened stays open.
    drawn = page.locator(".answer-card").element_handle()
    api.patch(f"/sessions/{session}/captures/p05", json={"excluded": True})
    page.wait_for_function("drawn => !drawn.isConnected", arg=drawn)
    expect(page.locator(".history tbody tr")).to_have_count(2)

    items = api.get(f"/sessions/{session}/results/tcp/history").json()["items"]
    sides = "&".join(
        f"{side}={session}:{item['number']}" for side, item in zip(("left", "right"), items, strict=True)
    )
    page.goto(f"/compare?{sides}")  # the stage that both have, where none is named
    expect(page.locator("#compare-stage")).to_have_value("tcp")
    expect(page.locator(".comparison section")).to_have_count(4)
    assert violations(page, axe) == []


def test_who_chooses_before_the_steps_are_there_is_compared_once_they_are(
    open_page: Callable[..., Any], session: str
) -> None:
    page, watched = open_page("/")
    held: list[Route] = []
    page.route(re.compile(r"/stages$"), lambda route: held.append(route))
    page.goto(f"/compare?left={session}")
    page.locator("#compare-right-solve").dispatch_event("change")
    page.wait_for_timeout(200)
    for route in held:
        route.continue_()
    expect(page.locator("#compare-stage")).to_have_value("tcp")
    expect(page.locator("#compare-left-solve option").nth(1)).to_be_attached()
    assert watched.complaints == []


@pytest.mark.thorough
def test_what_came_with_an_archive_is_shown_and_given_back(
    open_page: Callable[..., Any], api: httpx.Client, session: str
) -> None:
    archive = api.get(f"/sessions/{session}/archive").content
    answer = api.post("/archives", content=archive, headers={"Content-Type": "application/zip"})
    assert answer.status_code == 201, answer.text
    imported = answer.json()["id"]
    page, watched = open_page(f"/sessions/{imported}/review")
    kept = page.get_by_role("region", name="Other files from the archive")
    listed = api.get(f"/sessions/{imported}/kept").json()["items"]
    expect(kept.get_by_role("listitem")).to_have_count(len(listed))
    assert {"report.html", "scene.html"} <= {item["name"] for item in listed}
    with page.expect_download() as download:
        kept.get_by_role("link", name="report.html", exact=True).click()
    content = download.value.path().read_bytes()
    assert len(content) == next(item["bytes"] for item in listed if item["name"] == "report.html")
    with page.context.expect_page() as opened:
        kept.get_by_role("link", name="Open report.html in a new window").click()
    expect(opened.value.frame_locator("iframe").locator("h1").first).to_be_visible()
    assert kept.get_by_role("link", name="Open scene.html in a new window").count() == 0
    # A session that came with nothing shows no empty section.
    page.goto(page.url.replace(imported, session))
    expect(page.locator("sc-review-captures tbody tr").first).to_be_visible()
    expect(page.get_by_role("region", name="Other files from the archive")).to_have_count(0)
    assert watched.complaints == []


HOSTILE = b"""<!doctype html><meta http-equiv="refresh" content="0;url=/api/v1/health">
<h1>Report</h1><script>parent.document.title = "ran"; location = "/api/v1/me"</script>
<img src="/api/v1/jobs" onerror="document.querySelector('h1').textContent = 'ran'">
<iframe src="/docs"></iframe>
<form action="/api/v1/sessions" method="post" target="_top"><button>Send</button></form>
<p><a href="/api/v1/cells" target="_top">Top</a> <a href="/api/v1/cells" target="_blank">New</a>
<a href="/api/v1/cells">Here</a>"""


def test_a_kept_page_runs_nothing_and_leads_nowhere(
    profile: SharedProfile, api: httpx.Client, session: str, watch: Watch
) -> None:
    watch.announce("Refused to execute the redirect")
    watch.announce("Blocked script execution")
    watch.announce("Blocked form submission")
    watch.announce("Unsafe attempt to initiate navigation")
    watch.announce("Blocked opening")
    watch.announce('violates the following Content Security Policy directive: "(img|frame)-src')
    archive = api.get(f"/sessions/{session}/archive", params={"scene": False}).content
    hostile = changed(archive, "data/report.html", lambda _: HOSTILE)
    made = api.post("/archives", content=hostile, headers={"Content-Type": "application/zip"})
    assert made.status_code == 201, made.text
    address = str(api.base_url.join(f"sessions/{made.json()['id']}/kept/report.html?show=true"))
    page, others = profile.open(), len(profile.context.pages)
    asked: list[Request] = []
    page.on("request", lambda request: asked.append(request))
    page.goto(address)
    shown = page.frame_locator("iframe")
    expect(shown.locator("h1")).to_have_text("Report")
    for action in ("Send", "Top", "New", "Here"):
        role: Any = "button" if action == "Send" else "link"
        shown.get_by_role(role, name=action).click(no_wait_after=True)
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert (page.url, page.title(), len(profile.context.pages)) == (address, "report.html", others)
    # Of an image the browser may tell before it blocks it.
    reached = [one.url for one in asked if one.url != address and "CSP" not in (one.failure or "").upper()]
    assert reached == []
