"""Captures at work: everything that is done can be taken back; two of them side by side; one taken again."""

import os
from collections.abc import Callable, Iterator
from time import sleep
from typing import Any

import httpx
import numpy as np
import pytest
from playwright.sync_api import Page, Route, expect

from calib_core.frames import vector_from_rotation
from calib_core.records.described import DescribedCell
from calib_core.robots import parse_pose
from calib_core.simulation import simulate, simulate_described
from tests.server.live_server import make_session, simulated_session, upload

pytestmark = pytest.mark.browser


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        yield client


def rows(page: Page) -> Any:
    return page.locator(".captures tbody tr")


def stored(api: httpx.Client, session: str) -> dict[str, dict[str, Any]]:
    return {c["id"]: c for c in api.get(f"/sessions/{session}/captures").json()["items"]}


def test_every_deed_is_taken_back_in_turn(open_page: Callable[..., Any], api: httpx.Client) -> None:
    session = simulated_session(api, captures=3, scenario="turntable")
    page, watched = open_page(f"/sessions/{session}")
    expect(rows(page)).to_have_count(3)
    before = stored(api, session)
    page.get_by_role("checkbox", name="Use p01").uncheck()
    expect(page.get_by_role("button", name="Undo: p01 excluded")).to_be_visible()
    page.locator("sc-actions .capture").click()
    expect(rows(page)).to_have_count(4)
    page.get_by_role("button", name="Delete p02").click()
    expect(rows(page)).to_have_count(3)

    page.get_by_role("button", name="Undo: Capture p02 deleted").click()
    expect(rows(page)).to_have_count(4)
    page.locator("h2#captures-title").click()
    page.keyboard.press("Control+z")  # the capture that was taken
    expect(rows(page)).to_have_count(3)
    page.keyboard.press("Control+z")
    expect(page.get_by_role("checkbox", name="Use p01")).to_be_checked()
    expect(page.get_by_role("button", name="Undo:")).to_have_count(0)
    now = stored(api, session)
    assert now["p01"].pop("included_because")["when"]  # what was left out and taken in again stays told
    before["p01"].pop("included_because", None)
    assert now == before
    assert watched.complaints == []


def answer_late(route: Route) -> None:
    """Let a request wait as on a busy server."""
    sleep(0.5)
    route.continue_()


def test_an_edited_cell_and_added_files_are_taken_back(
    open_page: Callable[..., Any], api: httpx.Client, tmp_path: Any
) -> None:
    made = simulate("tcp", 11)
    record = made.session.to_json()
    session = make_session(api, cell=record["cell"])
    page, watched = open_page(f"/sessions/{session}")
    names = [capture["files"][0] for capture in record["captures"][:2]]
    for name in names:
        (tmp_path / name.split("/")[-1]).write_bytes(made.files[name])
    page.locator("sc-intake input[type=file]").first.set_input_files(sorted(tmp_path.iterdir()))
    poses = "\n".join(" ".join(map(str, capture["pose"])) for capture in record["captures"][:2])
    page.get_by_label("Poses, one line per capture").fill(poses)
    page.route("**/guide*", answer_late)
    page.get_by_role("button", name="Add 2 captures").dblclick()  # sent once
    told = page.wait_for_function(
        "() => document.querySelector('.toast') && document.querySelectorAll('table.captures tbody tr').length"
    )
    assert told.json_value() == 2, "what is told is shown"
    page.unroute("**/guide*")
    assert len(stored(api, session)) == 2
    cell = api.get(f"/sessions/{session}").json()["cell"]
    page.get_by_role("button", name="Edit cell").click()
    page.get_by_label("Sphere diameter in mm").fill("25.4")
    page.get_by_role("button", name="Save").click()
    expect(page.locator("header")).to_contain_text("sphere 25.4 mm")
    page.get_by_role("button", name="Undo: Cell changed").click()
    expect(page.locator("header")).to_contain_text("sphere 40 mm")
    assert api.get(f"/sessions/{session}").json()["cell"] == cell
    page.get_by_role("button", name="Undo: 2 captures added").click()
    expect(rows(page)).to_have_count(0)
    assert stored(api, session) == {}
    assert watched.complaints == []


def test_a_capture_taken_again_takes_the_place_of_the_old_one(
    open_page: Callable[..., Any], api: httpx.Client, tmp_path: Any
) -> None:
    made = simulate("tcp", 11)
    capture = {**made.session.captures[0].to_json(), "taken": "2025-03-30T01:00:00+01:00"}
    session = make_session(api, cell=made.session.to_json()["cell"])
    upload(api, session, capture, made.files[capture["files"][0]])
    again = tmp_path / "new.csv"
    again.write_bytes(made.files[capture["files"][0]] + b"\n")
    os.utime(again, (1_772_352_000, 1_772_352_000))
    page, watched = open_page(f"/sessions/{session}")
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Replace p01 with a new file").click()
    chooser.value.set_files(again)
    expect(rows(page)).to_have_count(2)
    expect(page.get_by_role("checkbox", name="Use p01", exact=True)).not_to_be_checked()
    now = stored(api, session)
    assert now["p01-again"]["pose"] == capture["pose"]
    assert now["p01-again"]["taken"] == "2026-03-01T08:00:00.000Z"  # by its file, not of the one that it replaces
    assert now["p01-again"]["clock"] == "file"
    assert now["p01"]["taken"] == capture["taken"]
    assert not now["p01-again"].get("excluded")
    page.get_by_role("button", name="Undo: p01 replaced").click()
    expect(rows(page)).to_have_count(1)
    expect(page.get_by_role("checkbox", name="Use p01", exact=True)).to_be_checked()
    assert watched.complaints == []


def test_the_simulated_cell_takes_a_capture_again(open_page: Callable[..., Any], api: httpx.Client) -> None:
    session = simulated_session(api, captures=3)
    page, watched = open_page(f"/sessions/{session}")
    page.get_by_role("button", name="Take p02 again from the same pose").click()
    expect(rows(page)).to_have_count(4)
    expect(page.get_by_role("checkbox", name="Use p02", exact=True)).not_to_be_checked()
    now = stored(api, session)
    assert now["p02-again"]["pose"] == now["p02"]["pose"]
    assert now["p02-again"]["measured"]["center_mm"] != now["p02"]["measured"]["center_mm"]
    page.get_by_role("button", name="Undo: p02 replaced").click()
    expect(rows(page)).to_have_count(3)
    expect(page.get_by_role("checkbox", name="Use p02", exact=True)).to_be_checked()
    page.get_by_role("button", name="Capture the sphere").click()
    expect(rows(page)).to_have_count(4)
    assert "p04" in stored(api, session)
    assert watched.complaints == []


def test_standstill_is_told_of_several_exposures_and_of_one_that_it_cannot_be(
    open_page: Callable[..., Any], api: httpx.Client
) -> None:
    made = simulate("tcp", 11)
    capture = made.session.captures[0].to_json()
    content = made.files[capture["files"][0]].decode()
    session = make_session(api, cell=made.session.to_json()["cell"])
    upload(api, session, capture, content.encode())
    page, watched = open_page(f"/sessions/{session}")
    quality = page.locator("sc-quality")
    expect(quality).to_contain_text("not known from one exposure")
    head, *lines = content.splitlines()
    for name, lift_mm in (("still", 0.0), ("shaken", 0.4)):
        files = []
        for place in range(6):
            # The same profile, and where it shakes every other one a little nearer.
            up_mm = lift_mm * (place % 2)
            moved = [f"{x},{float(z) - up_mm:.4f}" if z else f"{x}," for x, z in (row.split(",") for row in lines)]
            files.append("\n".join([head, *moved]).encode())
        names = [f"captures/{name}-{place}.csv" for place in range(6)]
        record = {"id": name, "step": "tcp", "kind": "sweep", "files": names, "poses": [capture["pose"]] * 6}
        assert upload(api, session, record, *files).status_code == 201
        expect(quality.locator("h2")).to_contain_text(name)
        if not lift_mm:
            expect(quality).to_contain_text("still")
            continue
        expect(quality.locator(".figures")).to_contain_text("moved")
        # Every other one by 0.4 mm is 0.2 √(6/5) mm root mean square about the mean of six.
        moved_mm = stored(api, session)[name]["measured"]["still"]["movement_mm"]
        assert moved_mm == pytest.approx(0.2 * np.sqrt(6 / 5), abs=0.005)
        expect(quality.locator(".figures")).to_contain_text(f"{1000 * moved_mm:.0f}\u202fµm beyond")
        expect(quality.locator(".reason")).to_contain_text("Let the arm settle before the capture")
    assert watched.complaints == []


def test_two_captures_side_by_side_with_the_motion_between_them(
    open_page: Callable[..., Any], api: httpx.Client
) -> None:
    session = simulated_session(api, captures=6)
    page, watched = open_page(f"/sessions/{session}")
    page.get_by_label("Compare p06 with").select_option("p01")
    both = page.get_by_role("region", name="p06 beside p01")
    expect(both.locator("svg.profile-plot")).to_have_count(2)
    captures = stored(api, session)
    zones = [f"{captures[name]['measured']['zone']:.2f}" for name in ("p06", "p01")]
    expect(both.get_by_role("row", name="r/R").locator("td")).to_have_text(zones)
    a, b = (parse_pose("abb", captures[name]["pose"]) for name in ("p06", "p01"))
    distance_mm = np.linalg.norm(b.translation_mm - a.translation_mm)
    turn_deg = np.rad2deg(np.linalg.norm(vector_from_rotation(a.rotation.T @ b.rotation)))
    expect(both).to_contain_text(f"moves {distance_mm:.1f}")
    expect(both).to_contain_text(f"turns {turn_deg:.2f}°")
    assert watched.complaints == []


def test_captures_of_several_scanners_and_axes_have_columns_of_their_own(
    open_page: Callable[..., Any], api: httpx.Client
) -> None:
    rail = {"name": "rail", "kind": "linear", "carries": "robot"}
    told = {"scanners": {"arm": {}, "gate": {"on": "base"}}, "axes": [rail]}
    simulated = simulate_described(DescribedCell.model_validate(told), "columns", 1)
    record = simulated.session.to_json()
    session = make_session(api, cell=record["cell"])
    for name in ("arm", "gate"):
        capture = next(one for one in record["captures"] if one["scanner"] == name)
        upload(api, session, capture, simulated.files[capture["files"][0]])
    page, watched = open_page(f"/sessions/{session}")
    expect(rows(page)).to_have_count(2)
    heads = [head.strip() for head in page.locator(".captures thead th").all_inner_texts()]
    cells = [row.locator("th, td").all_inner_texts() for row in rows(page).all()]
    scanner, axes = (heads.index(name) for name in ("Scanner", "Axes"))
    assert sorted(row[scanner] for row in cells) == ["arm", "gate"]
    assert all(row[axes].startswith("rail ") and row[axes].endswith("mm") for row in cells)
    assert watched.complaints == []
