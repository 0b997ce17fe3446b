"""The session page at work: files and poses, errors, undo, a server that restarts, captures that others add."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from playwright.sync_api import Page, Route, expect

from calib_core.simulation import simulate
from server.settings import Settings
from tests.server.live_server import make_session, serving, simulated_session
from tests.web.browsing import SharedProfile, Watch

pytestmark = pytest.mark.browser


@pytest.fixture
def api(address: str) -> Any:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        yield client


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A session folder as the simulator writes it, with six captures."""
    made = simulate("tcp", 11)
    record = made.session.to_json()
    record["captures"] = record["captures"][:6]
    root = tmp_path / "cell 11"
    (root / "captures").mkdir(parents=True)
    (root / "session.json").write_text(json.dumps(record))
    for capture in record["captures"]:
        for name in capture["files"]:
            (root / name).write_bytes(made.files[name])
    return root


def rows(page: Page) -> Any:
    return page.locator(".captures tbody tr")


def test_a_new_session_says_what_is_missing_and_what_looks_wrong(open_page: Callable[..., Any]) -> None:
    page, watched = open_page()
    page.get_by_role("button", name="New session").click()
    create = page.get_by_role("button", name="Create session")
    create.click()
    expect(page.get_by_role("alert").filter(has_text="choose")).to_contain_text("The robot decides")
    page.get_by_label("Robot", exact=True).select_option("fanuc")
    create.click()
    expect(page.locator(".form-problem")).to_contain_text("need the sphere diameter")
    expect(page.get_by_label("Sphere diameter in mm")).to_be_focused()
    page.get_by_label("Sphere diameter in mm").fill("0,08")
    create.click()
    expect(page.locator(".form-problem")).to_contain_text("Enter 80")
    page.get_by_label("Sphere diameter in mm").fill("80,003")
    create.click()
    expect(page.locator("sc-guide h1")).not_to_be_empty()
    expect(page.locator("header")).to_contain_text("FANUC")
    expect(page.locator("header")).to_contain_text("80.003")

    # The same form corrects it afterwards; what is emptied is taken away.
    page.get_by_role("button", name="Edit cell").click()
    expect(page.get_by_label("Sphere diameter in mm")).to_have_value("80.003")
    page.get_by_label("Robot", exact=True).select_option("kuka")
    page.get_by_label("Sphere diameter in mm").fill("25.4")
    page.get_by_role("button", name="Save").click()
    expect(page.locator("header")).to_contain_text("KUKA")
    expect(page.locator("header")).to_contain_text("sphere 25.4 mm")
    assert watched.complaints == []


def test_a_folder_becomes_a_session(open_page: Callable[..., Any], folder: Path) -> None:
    page, watched = open_page()
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Open a session folder").click()
    chooser.value.set_files(folder)
    expect(page).to_have_url(re.compile("/sessions/"))
    expect(rows(page)).to_have_count(6)
    expect(page.locator("header")).to_contain_text("sphere 40 mm")
    assert watched.complaints == []


def test_files_and_pose_lines_are_matched_before_they_are_sent(
    open_page: Callable[..., Any], api: httpx.Client, folder: Path
) -> None:
    record = json.loads((folder / "session.json").read_text())
    session = make_session(api, cell=record["cell"])
    page, watched = open_page(f"/sessions/{session}")
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Add files").click()
    chooser.value.set_files(sorted((folder / "captures").iterdir())[:4])
    lines = [" ".join(map(str, capture["pose"])) for capture in record["captures"][:3]]
    page.get_by_label("Poses, one line per capture").fill("\n".join([*lines, "1 2 3 4 5"]))
    table = page.locator(".match")
    expect(table).to_contain_text("a pose of 7 numbers")
    x_mm, y_mm, _ = record["captures"][0]["pose"][:3]
    shown = f"{x_mm:.1f}  {y_mm:.1f}".replace("-", "−")
    expect(table.locator("tbody tr").first).to_contain_text(shown.split()[0])
    page.get_by_role("button", name="Add 3 captures").click()
    expect(rows(page)).to_have_count(3)
    stored = api.get(f"/sessions/{session}/captures").json()["items"]
    assert [c["pose"] for c in stored] == [c["pose"] for c in record["captures"][:3]]
    assert watched.complaints == []


def test_lines_that_name_their_file_find_it_in_any_order(
    open_page: Callable[..., Any], api: httpx.Client, folder: Path
) -> None:
    record = json.loads((folder / "session.json").read_text())
    session = make_session(api, cell=record["cell"])
    page, _ = open_page(f"/sessions/{session}")
    page.locator("sc-intake input[type=file]").first.set_input_files(sorted((folder / "captures").iterdir())[:3])
    lines = [f"{c['id']}.csv " + " ".join(map(str, c["pose"])) for c in record["captures"][:3]]
    page.get_by_label("Poses, one line per capture").fill("\n".join(reversed(lines)))
    page.get_by_role("button", name="Add 3 captures").click()
    expect(rows(page)).to_have_count(3)
    stored = {c["id"]: c["pose"] for c in api.get(f"/sessions/{session}/captures").json()["items"]}
    assert stored == {c["id"]: c["pose"] for c in record["captures"][:3]}


def test_files_are_dropped_anywhere_on_the_page(open_page: Callable[..., Any], api: httpx.Client) -> None:
    page, watched = open_page(f"/sessions/{make_session(api)}")
    expect(page.locator("sc-guide h1")).not_to_be_empty()
    transfer = page.evaluate_handle("""() => {
        const transfer = new DataTransfer();
        const profile = "x_mm,z_mm\\n" + Array.from({ length: 40 }, (_, k) => `${k - 20},300\\n`).join("");
        for (const name of ["p10.csv", "p9.csv"]) transfer.items.add(new File([profile], name));
        transfer.items.add(new File(["PK"], "notes.docx"));
        return transfer;
    }""")
    page.locator(".work").dispatch_event("drop", {"dataTransfer": transfer})
    expect(page.locator(".match tbody tr")).to_have_count(2)
    expect(page.locator(".match tbody td:first-child")).to_have_text(["p9.csv", "p10.csv"])
    listed = page.locator("sc-file-list tbody tr")
    expect(listed).to_have_count(3)
    expect(page.get_by_label("Take notes.docx for")).to_have_value("nothing")
    expect(page.get_by_role("region", name="Files that came").first).to_contain_text("1 taken for nothing")
    assert page.locator(".toast").count() == 0
    assert watched.complaints == []


def test_a_session_removed_elsewhere_says_so(
    open_page: Callable[..., Any], api: httpx.Client, watch: Watch
) -> None:
    watch.announce("status of 404")
    session = simulated_session(api, captures=1)
    page, _ = open_page(f"/sessions/{session}")
    expect(rows(page)).to_have_count(1)
    expect(page.locator("sc-live")).to_have_text("connected")
    api.delete(f"/sessions/{session}")
    expect(page.get_by_role("link", name="Back to all sessions")).to_be_visible()


def test_a_solve_that_cannot_be_says_what_is_missing(open_page: Callable[..., Any], api: httpx.Client) -> None:
    session = simulated_session(api, captures=4)  # translations alone
    page, watched = open_page(f"/sessions/{session}")
    expect(rows(page)).to_have_count(4)
    page.keyboard.press("s")
    expect(page.locator(".toast.bad, .banner").first).to_contain_text("turn")
    assert watched.complaints == []


def test_a_refused_capture_says_what_to_do(
    open_page: Callable[..., Any],
    api: httpx.Client,
    tmp_path: Path,
    watch: Watch,
) -> None:
    watch.announce("status of 422")
    session = make_session(api)
    flat = tmp_path / "wall.csv"
    x_mm = np.linspace(-30, 30, 200)
    flat.write_text("x_mm,z_mm\n" + "\n".join(f"{x:.3f},200.0" for x in x_mm))
    broken = tmp_path / "broken.csv"
    broken.write_text("x_mm,z_mm\n1,2\n3\n")
    page, _ = open_page(f"/sessions/{session}")
    page.locator("sc-intake input[type=file]").first.set_input_files([flat, broken])
    page.get_by_label("Poses, one line per capture").fill("0 0 500 0 0 0\n10 0 500 0 0 0")
    # What holds no points is taken for nothing, until somebody says otherwise.
    expect(page.get_by_role("button", name="Add 1 capture", exact=True)).to_be_visible()
    page.get_by_label("Take broken.csv for").select_option("profiles")
    page.get_by_role("button", name="Add 2 captures").click()
    expect(page.locator(".toast.bad")).to_contain_text("broken")
    expect(rows(page)).to_have_count(1)
    expect(page.locator("sc-quality h2")).to_contain_text("refused")
    said = page.locator("sc-quality .reason").inner_text()
    measured = api.get(f"/sessions/{session}/captures/wall").json()["measured"]
    assert measured["verdict"] == "fail"
    assert measured["to_do"] in said


def test_a_capture_deleted_by_mistake_comes_back(open_page: Callable[..., Any], api: httpx.Client) -> None:
    session = simulated_session(api, captures=3)
    before = {c["id"]: c for c in api.get(f"/sessions/{session}/captures").json()["items"]}
    page, watched = open_page(f"/sessions/{session}")
    page.get_by_role("button", name="Delete p02").click()
    expect(rows(page)).to_have_count(2)
    expect(
        page.get_by_role("button", name="Undo", exact=True)
    ).to_be_visible()  # the row may go before the notice is there
    page.keyboard.press("Control+z")
    expect(rows(page)).to_have_count(3)
    after = {c["id"]: c for c in api.get(f"/sessions/{session}/captures").json()["items"]}
    assert after == before
    assert watched.complaints == []


def test_it_follows_captures_that_others_add(open_page: Callable[..., Any], api: httpx.Client) -> None:
    session = simulated_session(api)
    page, watched = open_page(f"/sessions/{session}")
    expect(page.locator("sc-live")).to_have_text("connected")
    for count in (1, 2):
        api.post(f"/sessions/{session}/sources/simulated/capture")
        expect(rows(page)).to_have_count(count)
    expect(page.locator("sc-quality h2")).to_contain_text("p02")
    api.patch(f"/sessions/{session}", json={"name": "renamed elsewhere"})
    expect(page.locator("header")).to_contain_text("renamed elsewhere")
    api.delete(f"/sessions/{session}/captures/p01")
    expect(rows(page)).to_have_count(1)
    assert watched.complaints == []


@pytest.mark.thorough
def test_a_solve_goes_on_while_the_page_is_loaded_anew(open_page: Callable[..., Any], api: httpx.Client) -> None:
    session = simulated_session(api, captures=10)
    page, watched = open_page(f"/sessions/{session}")
    expect(rows(page)).to_have_count(10)
    with page.expect_response(lambda answer: answer.url.endswith("/solve/tcp")):
        page.keyboard.press("Enter")
    page.reload()
    expect(page.locator("sc-rail .answer")).to_contain_text("±")
    page.get_by_role("tab", name="Result").click()
    page.reload()  # the view stands in the address
    expect(page.locator(".answer-card")).to_be_visible()
    assert watched.complaints == []


def test_an_address_of_nothing_says_so(open_page: Callable[..., Any], watch: Watch) -> None:
    watch.announce("status of 404")
    page, _ = open_page("/sessions/not-there")
    expect(page.locator("main")).to_contain_text("not-there")
    page.get_by_role("link", name="Back to all sessions").click()
    expect(page.get_by_role("heading", name="Calibrate a scanning cell")).to_be_visible()


def test_search_and_removal_of_sessions(open_page: Callable[..., Any], api: httpx.Client) -> None:
    for name in ("north hall", "south hall"):
        make_session(api, name=name)
    page, watched = open_page()
    page.get_by_role("searchbox").fill("north")
    expect(page.locator(".session-card")).to_have_count(1)
    page.get_by_role("button", name="Delete session north hall").click()
    page.get_by_role("button", name="Delete", exact=True).click()
    expect(page.locator(".session-card")).to_have_count(0)
    assert "north hall" not in {s["name"] for s in api.get("/sessions").json()["items"]}
    assert watched.complaints == []


def test_it_survives_a_restart_of_the_server(profile: SharedProfile, tmp_path: Path, watch: Watch) -> None:
    watch.allow("ERR_CONNECTION_REFUSED")
    settings: dict[str, Any] = {"data": tmp_path / "data", "warm_up": False}
    page = profile.open()
    with serving(Settings(port=0, **settings)) as client:
        port = client.base_url.port
        assert port is not None
        session = simulated_session(client, captures=1)
        page.goto(f"http://127.0.0.1:{port}/sessions/{session}")
        expect(page.locator("sc-live")).to_have_text("connected")
    expect(page.locator("sc-live")).to_contain_text("no connection since")
    with serving(Settings(port=port, **settings)) as client:
        client.post(f"/sessions/{session}/sources/simulated/capture")
        expect(page.locator("sc-live")).to_have_text("connected", timeout=20_000)
        expect(rows(page)).to_have_count(2)
        page.keyboard.press("Space")
        expect(rows(page)).to_have_count(3)
        page.close()


def test_a_session_is_there_before_its_guide_is(open_page: Callable[..., Any], api: httpx.Client) -> None:
    session = simulated_session(api, captures=3)
    page, watched = open_page("/")
    held: list[Route] = []
    page.route(re.compile(r"/guide$"), lambda route: held.append(route))  # a busy server's takes a minute
    page.goto(f"{page.url.rstrip('/')}/sessions/{session}")
    expect(page.locator(".session-name")).to_be_visible()
    expect(page.get_by_text("Loading the session")).to_be_hidden()
    expect(page.locator("sc-guide")).to_contain_text("Loading …")
    page.wait_for_function("() => document.querySelector('sc-session')")
    for route in held:
        route.continue_()
    expect(page.locator("sc-guide h1")).not_to_be_empty()
    expect(rows(page)).to_have_count(3)
    assert watched.complaints == []
