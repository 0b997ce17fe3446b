"""What the page itself finds wrong, each provoked in a real browser; no entry of either catalogue is left out."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import FilePayload, Locator, Page, expect

import server.app  # noqa: F401 (brings every error with it)
from calib_core.simulation import simulate
from server.http.errors import catalogue
from tests.server.access import guarded
from tests.server.live_server import make_session, simulated_session, upload
from tests.web.browsing import SharedProfile, Watch
from tests.web.problems import PROVOKED, provokes, site_of, visiting
from tests.web.test_problems_server import WALL

SOLVED = Path(__file__).resolve().parents[1] / "releases" / "0.1.0" / "archive.zip"

pytestmark = pytest.mark.browser

TEXTS = Path(__file__).resolve().parents[2] / "web" / "texts" / "problems.json"

NOT_FROM_A_PAGE = {
    "http-400": "the page's requests are whole and of the right form; programs send others",
    "http-405": "the page asks for nothing by a method that its address does not take",
    "media-type": "the page sends each body as what it is",
    "http-413": "a browser always tells how long a body is, which is refused as too-large before it comes",
}


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1/", timeout=300, trust_env=False) as client:
        yield client


def test_every_problem_is_provoked() -> None:
    own = set(json.loads(TEXTS.read_text(encoding="utf-8")))
    assert len(own) > 20
    assert set(catalogue()) - PROVOKED - set(NOT_FROM_A_PAGE) == set()
    assert own - PROVOKED == set()
    assert PROVOKED - set(catalogue()) - own == set(), "provoked, but in no catalogue"
    assert set(NOT_FROM_A_PAGE) <= set(catalogue()) - PROVOKED


@pytest.mark.thorough
@provokes("problem.unreachable", "problem.unreachable_title")
def test_the_server_cannot_be_reached(profile: SharedProfile, api: httpx.Client, watch: Watch) -> None:
    watch.announce("ERR_INTERNET_DISCONNECTED")
    watch.allow("status of 404")  # the session x, once the server is there again
    session = simulated_session(api, captures=2)
    with visiting(profile, api, f"/sessions/{session}") as visitor:
        page = visitor.page
        expect(visitor.rows).to_have_count(2)
        page.get_by_role("button", name="Paste poses").click()
        page.get_by_label("Poses, one line per capture").fill("0 0 600 1 0 0 0")
        expect(page.locator(".match tbody tr")).to_contain_text("600.0 mm")
        page.context.set_offline(True)
        page.get_by_role("button", name="Capture the sphere").click()
        expect(visitor.toast).to_contain_text("The server cannot be reached. Nothing is lost")
        visitor.picture("unreachable")
        page.context.set_offline(False)
        page.get_by_role("button", name="Capture the sphere").click()
        expect(visitor.rows).to_have_count(3)
        expect(page.get_by_label("Poses, one line per capture")).to_have_value("0 0 600 1 0 0 0")
        # Another page that is opened meanwhile says so, too, with its title.
        page.context.set_offline(True)
        page.evaluate("history.pushState(null, '', '/sessions/x'); dispatchEvent(new PopStateEvent('popstate'))")
        expect(page.locator("section.lost")).to_contain_text("No connection")
        page.context.set_offline(False)


@provokes("problem.unreadable")
def test_something_between_page_and_server_answers(
    profile: SharedProfile, api: httpx.Client, watch: Watch
) -> None:
    watch.announce("status of 502")
    with visiting(profile, api, f"/sessions/{simulated_session(api, captures=1)}") as visitor:
        expect(visitor.rows).to_have_count(1)
        # As a proxy says it whose server is away.
        bad_gateway = {"status": 502, "content_type": "text/html", "body": "<h1>Bad Gateway</h1>"}
        visitor.page.context.route("**/sources/simulated/capture*", lambda route: route.fulfill(**bad_gateway))
        visitor.page.keyboard.press("Space")
        expect(visitor.toast).to_contain_text("The server answered 502. Try again. If this persists, check")
        visitor.picture("unreadable")
        visitor.page.context.unroute_all()
        visitor.page.keyboard.press("Space")
        expect(visitor.rows).to_have_count(2)


def drop(page: Page, files: dict[str, str]) -> None:
    """Drop a folder's files, as the folder's own picker gives them."""
    page.evaluate(
        """async (files) => {
            const transfer = new DataTransfer();
            for (const [name, text] of Object.entries(files)) transfer.items.add(new File([text], name));
            const target = document.querySelector("sc-session, sc-start");
            const how = { dataTransfer: transfer, bubbles: true, cancelable: true };
            target.dispatchEvent(new DragEvent("drop", how));
        }""",
        files,
    )


@provokes("problem.lacking", "intake.bad_json", "intake.more_problems")
def test_what_is_dropped_on_a_session(profile: SharedProfile, api: httpx.Client) -> None:
    with visiting(profile, api, f"/sessions/{make_session(api)}") as visitor:
        page, toast = visitor.page, visitor.toast
        expect(page.locator("sc-guide h1")).not_to_be_empty()
        drop(page, {"session.json": "{not json"})
        expect(toast).to_contain_text("is not valid JSON. Fix it")
        visitor.picture("intake-bad-json")
        drop(page, {"notes.docx": "?"})
        came = page.get_by_role("region", name="Files that came").first
        expect(came).to_contain_text("1 file: 1 taken for nothing")
        visitor.picture("intake-nothing")
        kinds = {"step": "tcp", "kind": "profile", "pose": [0, 0, 500, 0, 0, 0]}
        record = {
            "cell": {"pose_convention": "fanuc", "sphere_diameter_mm": 40.0},
            "captures": [{"id": f"p{k}", "files": [f"captures/p{k}.csv"], **kinds} for k in range(4)],
        }
        drop(page, {"session.json": json.dumps(record)})
        expect(page.locator(".toasts")).to_contain_text("p0: the folder lacks captures/p0.csv. Add the files")
        expect(page.locator(".toasts")).to_contain_text(
            "3 more captures could not be added. Fix the problems above"
        )
        visitor.picture("intake-lacking")
        # Nothing was stored by halves.
        assert api.get(f"/sessions/{page.url.rsplit('/', 1)[1]}/captures").json()["items"] == []


@provokes("start.no_session")
def test_what_is_dropped_on_the_first_page(profile: SharedProfile, api: httpx.Client) -> None:
    with visiting(profile, api, "/") as visitor:
        expect(visitor.page.get_by_role("heading", name="Calibrate a scanning cell")).to_be_visible()
        drop(visitor.page, {"a.txt2": "?"})
        expect(visitor.toast).to_contain_text("There is no session.json among these files. Drop the whole")
        visitor.picture("start-no-session")


@provokes(
    "new.need_convention",
    "new.need_diameter",
    "new.need_number",
    "new.metres",
    "new.need_markers",
    "new.need_board",
)
def test_a_cell_that_lacks_something(profile: SharedProfile, api: httpx.Client) -> None:
    with visiting(profile, api, "/") as visitor:
        page = visitor.page
        page.get_by_role("button", name="New session").click()
        alarm = page.locator("dialog .form-problem")

        def go_and_expect(words: str, name: str) -> None:
            page.get_by_role("button", name="Create session").click()
            expect(alarm).to_contain_text(words)
            visitor.picture(f"new-{name}")

        go_and_expect("The robot decides how a pose is read. Choose one", "convention")
        page.get_by_label("Robot", exact=True).select_option("fanuc")
        go_and_expect("Profiles need the sphere diameter. Enter it in millimetres.", "diameter")
        page.get_by_label("Sphere diameter in mm").fill("-3")
        go_and_expect("Enter a length above zero, such as 80.003.", "number")
        page.get_by_label("Sphere diameter in mm").fill("0,08")
        go_and_expect("0.08 mm looks like metres. Enter 80.", "metres")
        page.get_by_label("Sphere diameter in mm").fill("80")
        page.get_by_label("Scanner output").select_option("frame")
        go_and_expect("Camera frames need the board. Enter columns, rows and pitch.", "board")
        page.get_by_label("Pattern").select_option("charuco")
        for label, value in (("Columns", "9"), ("Rows", "6"), ("Pitch in mm", "20")):
            page.get_by_label(label, exact=True).fill(value)
        go_and_expect("A ChArUco board needs its marker size, smaller than the pitch, and", "markers")
        # All that was typed is still there, and with what was missing it is a session.
        page.get_by_label("Marker size in mm").fill("15")
        page.get_by_label("Marker dictionary").fill("DICT_5X5_100")
        page.get_by_role("button", name="Create session").click()
        expect(page).to_have_url(re.compile("/sessions/"))
        expect(page.locator("header")).to_contain_text("sphere 80 mm")


@provokes("place.need_angle")
def test_a_table_angle_that_is_none(profile: SharedProfile, api: httpx.Client) -> None:
    made = simulate("turntable", 3)
    capture = next(c for c in made.session.captures if c.step == "turntable").to_json()
    session = make_session(api, cell=made.session.to_json()["cell"])
    upload(api, session, capture, made.files[capture["files"][0]])
    with visiting(profile, api, f"/sessions/{session}#turntable") as visitor:
        page = visitor.page
        page.get_by_role("button", name=re.compile("Table at")).click()
        angle = page.get_by_label("Table angle in degrees")
        angle.fill("about ninety")
        page.get_by_role("button", name="Save").click()
        assert said(angle) == "Enter an angle in degrees, such as 45."
        visitor.picture("place-angle")
        angle.fill("90")
        page.get_by_role("button", name="Save").click()
        expect(page.get_by_role("button", name=re.compile("90°"))).to_be_visible()


@provokes("watch.unavailable")
def test_a_server_that_watches_no_folders(profile: SharedProfile, api: httpx.Client) -> None:
    with visiting(profile, api, f"/sessions/{make_session(api)}") as visitor:
        visitor.page.get_by_role("button", name="Watch a folder").click()
        expect(visitor.page.get_by_text("The operator can allow it with SCANCELL_WATCH_ROOT")).to_be_visible()
        visitor.picture("watch-unavailable")


@provokes("captures.redo_failed")
def test_what_is_taken_again_is_refused_too(profile: SharedProfile, api: httpx.Client, tmp_path: Path) -> None:
    made = simulate("tcp", 11)
    capture = made.session.captures[0].to_json()
    session = make_session(api, cell=made.session.to_json()["cell"])
    upload(api, session, capture, made.files[capture["files"][0]])
    with visiting(profile, api, f"/sessions/{session}") as visitor:
        page = visitor.page
        with page.expect_file_chooser() as chooser:
            page.get_by_role("button", name="Replace p01 with a new file").click()
        chooser.value.set_files(FilePayload(name="wall.csv", mimeType="text/csv", buffer=WALL.encode()))
        expect(visitor.toast).to_contain_text("The new capture p01-again was refused, too")
        expect(visitor.toast).to_contain_text("p01 is still used")
        visitor.picture("redo-failed")
        expect(page.get_by_role("checkbox", name="Use p01", exact=True)).to_be_checked()


@provokes("may.capture", "may.release", "may.admin")
def test_what_a_role_may_not(profile: SharedProfile, tmp_path: Path) -> None:
    with guarded(tmp_path / "data") as (client, tokens):
        client.headers["Authorization"] = f"Bearer {tokens['capture']}"
        session = simulated_session(client, captures=1)
        with visiting(profile, client, f"/login?next=/sessions/{session}") as visitor:
            page = visitor.page
            page.get_by_label("Token").fill(tokens["read"])
            page.get_by_role("button", name="Log in").click()
            expect(visitor.rows).to_have_count(1)
            page.keyboard.press("Space")
            expect(page.locator(".toast")).to_contain_text("need the role capture")
            visitor.picture("may-capture")
            page.goto(f"{site_of(client)}/access")
            expect(page.locator("main")).to_contain_text("need the role admin")
            visitor.picture("may-admin")
            expect(page.locator("sc-tokens")).to_have_count(0)
            archive = {"content": SOLVED.read_bytes(), "headers": {"Content-Type": "application/zip"}}
            solved = client.post("/archives", **archive).json()["id"]
            page.goto(f"{site_of(client)}/sessions/{solved}#tcp.result")
            approval = page.get_by_role("region", name="Approval")
            expect(approval).to_contain_text("Approving and rolling back need the role release.")
            visitor.picture("may-release")
            expect(approval.get_by_role("button")).to_have_count(0)


def said(field: Locator) -> str:
    """Return what the browser shows beside a field that is not right."""
    return field.evaluate("(one) => one.validationMessage")


@provokes("tokens.need_name", "tokens.need_days")
def test_a_token_for_nobody(profile: SharedProfile, api: httpx.Client) -> None:
    with visiting(profile, api, "/access") as visitor:
        page = visitor.page
        name, days = page.get_by_label("Name"), page.get_by_label("Valid for (days)")
        page.get_by_role("button", name="Create token").click()
        assert said(name) == "Enter the name of a person or a program."
        visitor.picture("token-name")
        name.fill("robot cell 4")
        days.fill("soon")
        page.get_by_role("button", name="Create token").click()
        assert said(days) == "Enter a number of days above zero, or nothing."
        expect(name).to_have_value("robot cell 4")
