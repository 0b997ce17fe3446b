"""Every problem of the server that a user of the page can meet, provoked by a real cause in a real browser.

Each says what was needed, what was there and what to do, and loses nothing.
"""

import json
import os
import signal
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import FilePayload, Route, expect

import server.jobs.ends
import server.jobs.jobs
import server.jobs.worker
from server.settings import Settings
from tests.server.access import bearer, guarded, site_of
from tests.server.live_server import make_session, serving, simulated_session, wait_for
from tests.server.slow_work import faulty_solve, slow_solve
from tests.server.test_faults import server as server_process
from tests.server.test_faults import small_disk  # noqa: F401 (a fixture)
from tests.server.test_jobs import until_elsewhere, wait_until_it_runs
from tests.web.broken_line import broken_line
from tests.web.browsing import SharedProfile, Watch
from tests.web.problems import Visitor, provokes, require_said, visiting

pytestmark = pytest.mark.browser

WALL = "x_mm,z_mm\n" + "\n".join(f"{x / 10:.1f},200.0" for x in range(-300, 300)) + "\n"


@pytest.fixture
def start(tmp_path: Path) -> Callable[..., Any]:
    def begin(**changes: Any) -> Any:
        return serving(Settings(**{"data": tmp_path / "data", "port": 0, "warm_up": False, **changes}))

    return begin


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1/", timeout=300, trust_env=False) as client:
        yield client


def file(name: str, text: str) -> FilePayload:
    return FilePayload(name=name, mimeType="text/csv", buffer=text.encode())


def offer(visitor: Visitor, *files: FilePayload) -> None:
    """Choose files and paste a pose for each, up to the click that sends them."""
    visitor.page.locator("sc-intake input[type=file]").first.set_input_files(list(files))
    expect(visitor.page.locator("sc-file-list tbody tr")).to_have_count(len(files))
    poses = "\n".join(f"{100 + 10 * place} 200 600 180 0 {place}" for place in range(len(files)))
    visitor.page.get_by_label("Poses, one line per capture").fill(poses)
    expect(visitor.page.locator(".match tbody tr").last).to_contain_text("600.0 mm")


def solve_and_fail(visitor: Visitor, client: httpx.Client, kind: str) -> None:
    """Solve; the job's own problem is told."""
    with visitor.page.expect_response(lambda answer: answer.url.endswith("/solve/tcp")) as asked:
        visitor.page.keyboard.press("s")
    error = wait_for(client, asked.value.json()["id"])["error"]
    assert error["type"].endswith(f":{kind}")
    require_said(error, visitor.toast)


@provokes("conflict")
def test_nothing_is_left_to_capture(profile: SharedProfile, api: httpx.Client, watch: Watch) -> None:
    watch.announce("status of 409")
    sweeps = simulated_session(api, captures=6, scenario="tcp-sweep")  # has no more than these
    with visiting(profile, api, f"/sessions/{sweeps}") as visitor:
        expect(visitor.rows).to_have_count(6)
        visitor.page.keyboard.press("Space")
        visitor.told("conflict")
        visitor.picture("conflict")
        expect(visitor.rows).to_have_count(6)


@provokes("input")
def test_a_file_of_no_use_is_refused_and_the_good_one_beside_it_is_kept_once(
    profile: SharedProfile, api: httpx.Client, watch: Watch
) -> None:
    watch.announce("status of 422")
    with visiting(profile, api, f"/sessions/{make_session(api)}") as visitor:
        offer(visitor, file("a.csv", WALL), file("b.csv", "x_mm,z_mm\nhello,world\n"))
        visitor.page.get_by_label("Take b.csv for").select_option("profiles")
        visitor.page.get_by_role("button", name="Add 2 captures").click()
        visitor.told("input")
        visitor.picture("input")
        expect(visitor.rows).to_have_count(1)
        # What was stored is not sent twice; what was refused is still there with its pose.
        expect(visitor.page.locator(".match tbody tr").first).to_contain_text("already added")
        again = visitor.page.get_by_role("button", name="Add 1 capture")
        expect(again).to_be_visible()
        again.click()
        expect(visitor.page.locator(".toast.bad")).to_have_count(1)  # said once
        expect(visitor.rows).to_have_count(1)


@provokes("motion")
def test_too_few_motions(profile: SharedProfile, api: httpx.Client) -> None:
    with visiting(profile, api, f"/sessions/{simulated_session(api, captures=2)}") as visitor:
        expect(visitor.rows).to_have_count(2)
        solve_and_fail(visitor, api, "motion")
        visitor.picture("motion")
        visitor.page.keyboard.press("Space")
        expect(visitor.rows).to_have_count(3)


@provokes("measurement")
def test_no_capture_shows_the_sphere(profile: SharedProfile, api: httpx.Client) -> None:
    session = make_session(api)
    for place in range(6):
        pose = [10 * place, 0, 500, 0, 0, 20 * place]
        record = json.dumps({"id": f"w{place}", "step": "tcp", "kind": "profile", "pose": pose})
        api.post(f"/sessions/{session}/captures", data={"record": record}, files={"files": ("w.csv", WALL)})
    with visiting(profile, api, f"/sessions/{session}") as visitor:
        expect(visitor.rows).to_have_count(6)
        solve_and_fail(visitor, api, "measurement")
        visitor.picture("measurement")
        expect(visitor.rows).to_have_count(6)


@provokes("not-found")
def test_the_session_was_removed_meanwhile(profile: SharedProfile, api: httpx.Client, watch: Watch) -> None:
    watch.announce("status of 404")
    session = simulated_session(api, captures=1)
    with visiting(profile, api, f"/sessions/{session}") as visitor:
        expect(visitor.rows).to_have_count(1)
        api.delete(f"/sessions/{session}")
        gone = visitor.page.locator("section.lost")
        visitor.told("not-found", gone)
        visitor.picture("not-found")
        gone.get_by_role("link", name="Back to all sessions").click()
        expect(visitor.page.get_by_role("heading", name="Calibrate a scanning cell")).to_be_visible()


def test_the_session_was_removed_before_its_events_were_followed(
    profile: SharedProfile, api: httpx.Client, watch: Watch
) -> None:
    watch.announce("status of 404|ERR_FAILED")
    session = simulated_session(api, captures=1)
    page = profile.open(reduced_motion="reduce")
    page.route("**/events?*", lambda route: route.abort())
    page.goto(f"{site_of(api)}/sessions/{session}")
    expect(page.locator("table.captures tbody tr")).to_have_count(1)
    api.delete(f"/sessions/{session}")
    expect(page.locator("section.lost")).to_be_visible()


@provokes("http-404", "lost.title", "lost.words")
def test_an_address_of_nothing(profile: SharedProfile, api: httpx.Client, watch: Watch) -> None:
    watch.announce("status of 404")
    with visiting(profile, api, "/nowhere") as visitor:
        gone = visitor.page.locator("section.lost")
        expect(gone).to_contain_text("Page not found")
        expect(gone).to_contain_text("may be old")
        visitor.picture("http-404")
        gone.get_by_role("link", name="Back to all sessions").click()
        expect(visitor.page.get_by_role("heading", name="Calibrate a scanning cell")).to_be_visible()


def edit_diameter(visitor: Visitor, diameter: str) -> None:
    visitor.page.get_by_role("button", name="Edit cell").click()
    visitor.page.get_by_label("Sphere diameter in mm").fill(diameter)


@provokes("problem.outdated")
def test_two_change_the_cell_at_once(profile: SharedProfile, api: httpx.Client) -> None:
    session = make_session(api)
    with (
        visiting(profile, api, f"/sessions/{session}") as one,
        visiting(profile, api, f"/sessions/{session}") as other,
    ):
        edit_diameter(one, "50")
        edit_diameter(other, "60")
        one.page.get_by_role("button", name="Save").click()
        expect(one.page.locator("header")).to_contain_text("sphere 50 mm")
        other.page.get_by_role("button", name="Save").click()
        alarm = other.page.locator("dialog .form-problem")
        expect(alarm).to_contain_text("Someone else changed this in the meantime: sphere_diameter_mm")
        expect(alarm).to_contain_text("Save again to overwrite their change")
        expect(other.page.get_by_label("Sphere diameter in mm")).to_have_value("60")
        assert api.get(f"/sessions/{session}").json()["cell"]["sphere_diameter_mm"] == 50
        other.picture("outdated")
        other.page.get_by_role("button", name="Save").click()
        expect(other.page.locator("header")).to_contain_text("sphere 60 mm")


@provokes("outdated")
def test_somebody_is_faster_by_a_moment(profile: SharedProfile, api: httpx.Client, watch: Watch) -> None:
    """The change of another comes between this one's look and its change: refused, looked at again, told."""
    watch.announce("status of 412")
    session = make_session(api)
    with visiting(profile, api, f"/sessions/{session}") as visitor:
        edit_diameter(visitor, "60")

        done: list[str] = []

        def be_faster(route: Route) -> None:
            if route.request.method == "PATCH" and not done:
                done.append(route.request.url)
                api.patch(f"/sessions/{session}", json={"cell": {"sphere_diameter_mm": 50}})
            route.continue_()

        visitor.page.route(f"**/api/v1/sessions/{session}", be_faster)
        visitor.page.get_by_role("button", name="Save").click()
        alarm = visitor.page.locator("dialog .form-problem")
        expect(alarm).to_contain_text("Someone else changed this in the meantime: sphere_diameter_mm.")
        assert api.get(f"/sessions/{session}").json()["cell"]["sphere_diameter_mm"] == 50
        visitor.page.get_by_role("button", name="Save").click()
        expect(visitor.page.locator("header")).to_contain_text("sphere 60 mm")


def test_a_capture_that_comes_meanwhile_is_no_conflict(profile: SharedProfile, api: httpx.Client) -> None:
    session = make_session(api)
    with visiting(profile, api, f"/sessions/{session}") as visitor:
        edit_diameter(visitor, "50")
        record = json.dumps({"id": "w", "step": "tcp", "kind": "profile", "pose": [0, 0, 500, 0, 0, 0]})
        api.post(f"/sessions/{session}/captures", data={"record": record}, files={"files": ("w.csv", WALL)})
        expect(visitor.rows).to_have_count(1)
        visitor.page.get_by_role("button", name="Save").click()
        expect(visitor.page.locator("dialog")).to_have_count(0)
        expect(visitor.page.locator("header")).to_contain_text("sphere 50 mm")


@provokes("too-large")
def test_more_than_the_server_takes(profile: SharedProfile, start: Callable[..., Any], watch: Watch) -> None:
    watch.announce("status of 413")
    with start(max_upload_bytes=40_000) as client:
        session = make_session(client)
        with visiting(profile, client, f"/sessions/{session}") as visitor:
            offer(visitor, file("small.csv", WALL), file("large.csv", WALL * 10))
            visitor.page.get_by_role("button", name="Add 2 captures").click()
            visitor.told("too-large")
            visitor.picture("too-large")
            expect(visitor.rows).to_have_count(1)
            expect(visitor.page.get_by_role("button", name="Add 1 capture")).to_be_visible()


@provokes("login", "problem.login_ended")
def test_the_login_ends_in_the_middle_and_nothing_typed_is_lost(
    profile: SharedProfile, tmp_path: Path, watch: Watch
) -> None:
    watch.announce("status of 401")
    with guarded(tmp_path / "data") as (client, tokens):
        admin = bearer(tokens["admin"])
        client.headers.update(bearer(tokens["capture"]))
        session = make_session(client)
        made = client.post("/tokens", json={"name": "guest", "role": "capture"}, headers=admin).json()
        with visiting(profile, client, f"/login?next=/sessions/{session}") as visitor:
            page = visitor.page
            page.get_by_label("Token").fill("scancell_wrong")
            page.get_by_role("button", name="Log in").click()
            visitor.told("login", page.get_by_role("alert"))
            visitor.picture("login")
            page.get_by_label("Token").fill(made["token"])
            page.get_by_role("button", name="Log in").click()
            page.get_by_role("button", name="Paste poses").click()
            page.get_by_label("Poses, one line per capture").fill("1 2 3 180 0 0")
            expect(page.locator(".match tbody tr")).to_have_count(1)
            client.delete(f"/tokens/{made['id']}", headers=admin)
            expect(page.get_by_label("Token")).to_be_visible()
            expect(page.locator("main")).to_contain_text("Your login has expired. Log in again")
            visitor.picture("login-ended")
            page.get_by_label("Token").fill(tokens["capture"])
            page.get_by_role("button", name="Log in").click()
            expect(page.get_by_label("Poses, one line per capture")).to_have_value("1 2 3 180 0 0")


@provokes("forbidden")
def test_a_role_that_was_taken_away(profile: SharedProfile, tmp_path: Path, watch: Watch) -> None:
    watch.announce("status of 403")
    with guarded(tmp_path / "data") as (client, tokens):
        client.headers.update(bearer(tokens["capture"]))
        session = simulated_session(client, captures=1)
        with visiting(profile, client, f"/login?next=/sessions/{session}") as visitor:
            page = visitor.page
            page.get_by_label("Token").fill(tokens["capture"])
            page.get_by_role("button", name="Log in").click()
            expect(visitor.rows).to_have_count(1)
            # In another tab of the same browser somebody logs in who may only look.
            tab = page.context.new_page()
            tab.goto(site_of(client))
            origin = {"Origin": page.url.split("/sessions")[0]}
            assert tab.request.post(
                f"{site_of(client)}/api/v1/login", data={"token": tokens["read"]}, headers=origin
            ).ok
            page.keyboard.press("Space")
            visitor.told("forbidden")
            visitor.picture("forbidden")
            expect(visitor.rows).to_have_count(1)


@provokes("too-many")
def test_too_many_tries_to_log_in(profile: SharedProfile, tmp_path: Path, watch: Watch) -> None:
    watch.announce("status of 401")
    watch.announce("status of 429")
    with guarded(tmp_path / "data") as (client, _), visiting(profile, client, "/login") as visitor:
        alarm = visitor.page.get_by_role("alert")
        for _ in range(9):
            client.post("/login", json={"token": "scancell_no"}, headers={"Origin": visitor.page.url[:-6]})
        for _ in range(3):
            visitor.page.get_by_label("Token").fill("scancell_wrong")
            with visitor.page.expect_response(lambda answer: answer.url.endswith("/login")):
                visitor.page.get_by_role("button", name="Log in").click()
        visitor.told("too-many", alarm)
        visitor.picture("too-many")


def test_more_requests_than_there_is_room_for(
    profile: SharedProfile, start: Callable[..., Any], watch: Watch
) -> None:
    """A flood from the same address leaves no room: who is told to wait long is told, not kept waiting."""
    watch.announce("status of 429")
    with start(rate_per_s=0.0005, rate_burst=60) as client:  # tenfold on this machine; none comes back meanwhile
        session = simulated_session(client, captures=1)
        with visiting(profile, client, f"/sessions/{session}") as visitor:
            expect(visitor.rows).to_have_count(1)
            while client.get("/health").status_code == 200:
                pass
            visitor.page.keyboard.press("Space")
            visitor.told("too-many")
            visitor.picture("too-many-requests")
            expect(visitor.rows).to_have_count(1)


@pytest.mark.thorough
@provokes("damaged")
def test_a_stored_file_was_damaged(
    profile: SharedProfile, start: Callable[..., Any], tmp_path: Path, watch: Watch
) -> None:
    watch.announce("status of 503")  # nor can the causes be looked for
    with start() as client:
        session = simulated_session(client, captures=10)
        stored = client.get(f"/sessions/{session}/captures/p05").json()["files"][0]
        digest = client.get(f"/sessions/{session}/captures/p05/files/{stored}").headers["ETag"].strip('"')
        blob = tmp_path / "data" / "blobs" / digest[:2] / digest
        content = bytearray(blob.read_bytes())
        content[100] ^= 1
        blob.write_bytes(content)
        with visiting(profile, client, f"/sessions/{session}") as visitor:
            expect(visitor.rows).to_have_count(10)
            solve_and_fail(visitor, client, "damaged")
            visitor.picture("damaged")
            # Without the damaged capture it goes on.
            visitor.page.get_by_role("checkbox", name="Use p05").uncheck()
            expect(visitor.rows.nth(4)).to_contain_text("excluded")
            visitor.page.keyboard.press("s")
            expect(visitor.page.locator(".answer-card")).to_be_visible()


@pytest.mark.thorough
@provokes("unavailable")
def test_another_program_holds_the_database(
    profile: SharedProfile, start: Callable[..., Any], tmp_path: Path, watch: Watch
) -> None:
    watch.announce("status of 503")
    with start(database_wait_s=0.3) as client:
        session = simulated_session(client, captures=1)
        with visiting(profile, client, f"/sessions/{session}") as visitor:
            expect(visitor.rows).to_have_count(1)
            with closing(sqlite3.connect(tmp_path / "data" / "scancell.db", isolation_level=None)) as other:
                other.execute("BEGIN IMMEDIATE")
                visitor.page.keyboard.press("Space")
                visitor.told("unavailable")
                visitor.picture("unavailable")
                other.execute("ROLLBACK")
            visitor.page.keyboard.press("Space")
            expect(visitor.rows).to_have_count(2)


@pytest.mark.thorough
@provokes("http-504")
def test_no_answer_in_time_and_it_may_still_end_well(
    profile: SharedProfile, start: Callable[..., Any], tmp_path: Path, watch: Watch
) -> None:
    watch.announce("status of 504")
    with start(database_wait_s=30, answer_timeout_s=1.0) as client:
        session = simulated_session(client, captures=1)
        with visiting(profile, client, f"/sessions/{session}") as visitor:
            expect(visitor.rows.first).to_be_visible()  # before the session itself is there, keys do nothing
            with closing(sqlite3.connect(tmp_path / "data" / "scancell.db", isolation_level=None)) as other:
                other.execute("BEGIN IMMEDIATE")
                visitor.page.keyboard.press("Space")
                visitor.told("http-504")
                visitor.picture("http-504")
                other.execute("ROLLBACK")
            # As the page says: look at the session, it ended well after all.
            expect(visitor.rows).to_have_count(2)


@pytest.mark.thorough
def test_a_solve_that_takes_too_long(profile: SharedProfile, start: Callable[..., Any]) -> None:
    with start(job_timeout_s=0.01) as client:
        session = simulated_session(client, captures=10)
        with visiting(profile, client, f"/sessions/{session}") as visitor:
            expect(visitor.rows).to_have_count(10)
            solve_and_fail(visitor, client, "http-504")
            visitor.picture("http-504-solve")


@provokes("http-500")
def test_a_solve_meets_an_error_of_the_program(
    profile: SharedProfile, start: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server.jobs.worker, "solve", faulty_solve)
    with start() as client:
        session = simulated_session(client, captures=2)
        with visiting(profile, client, f"/sessions/{session}") as visitor:
            expect(visitor.rows).to_have_count(2)
            solve_and_fail(visitor, client, "http-500")
            visitor.picture("http-500")


@pytest.mark.thorough
@provokes("http-503")
def test_the_worker_of_a_solve_is_killed(
    profile: SharedProfile, start: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It begins anew; whose worker is killed each time ends, and says so."""
    monkeypatch.setattr(server.jobs.worker, "solve", slow_solve)
    for module in (server.jobs.jobs, server.jobs.ends):
        monkeypatch.setattr(module, "MOST_ATTEMPTS", 2)
    with start() as client:
        session = simulated_session(client, captures=6)
        with visiting(profile, client, f"/sessions/{session}") as visitor:
            expect(visitor.rows).to_have_count(6)
            with visitor.page.expect_response(lambda answer: answer.url.endswith("/solve/tcp")) as asked:
                visitor.page.keyboard.press("s")
            job = asked.value.json()["id"]
            first = wait_until_it_runs(client, job)
            os.kill(first, signal.SIGKILL)
            os.kill(until_elsewhere(client, job, first), signal.SIGKILL)
            error = wait_for(client, job)["error"]
            assert error["type"].endswith(":http-503")
            require_said(error, visitor.toast)
            visitor.picture("http-503-solve")
            expect(visitor.rows).to_have_count(6)


@pytest.mark.thorough
@provokes("http-507")
def test_the_disk_is_full(
    profile: SharedProfile,
    small_disk: Path,  # noqa: F811
    watch: Watch,
) -> None:
    if not os.path.ismount(small_disk):
        pytest.skip("no disk may be mounted here")
    watch.announce("status of 507")
    with server_process(small_disk / "data") as client:
        session = simulated_session(client, captures=2)
        with visiting(profile, client, f"/sessions/{session}") as visitor:
            expect(visitor.rows).to_have_count(2)
            ballast = small_disk / "ballast"
            space = os.statvfs(small_disk)
            ballast.write_bytes(b"0" * max(0, space.f_bavail * space.f_bsize - 4096))
            visitor.page.keyboard.press("Space")
            visitor.told("http-507")
            visitor.picture("http-507")
            expect(visitor.rows).to_have_count(2)
            ballast.unlink()
            visitor.page.keyboard.press("Space")
            expect(visitor.rows).to_have_count(3)


@pytest.mark.thorough
@provokes("http-408")
def test_a_body_that_stops_on_its_way(profile: SharedProfile, start: Callable[..., Any], watch: Watch) -> None:
    watch.announce("status of 408")
    with start(body_timeout_s=1.0) as client, broken_line(client.base_url.port or 0) as line:
        session = make_session(client)
        with visiting(profile, client, f"/sessions/{session}", line.site) as visitor:
            offer(visitor, file("a.csv", WALL))
            line.most_up = 4000
            visitor.page.get_by_role("button", name="Add 1 capture").click()
            visitor.told("http-408")
            visitor.picture("http-408")
            expect(visitor.rows).to_have_count(0)
            line.most_up = None
            visitor.page.get_by_role("button", name="Add 1 capture").click()
            expect(visitor.rows).to_have_count(1)
