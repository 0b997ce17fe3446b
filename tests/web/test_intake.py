"""Getting captures in: tables with any columns, what a convention makes of them in the scene, a watched folder."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Page, Route, expect

from calib_core.robots import parse_pose, to_pose
from calib_core.simulation import simulate
from server.settings import Settings
from tests.server.live_server import make_session, serving
from tests.web.browsing import SharedProfile, Watched

pytestmark = pytest.mark.browser

MADE = simulate("tcp", 11)
RECORD: Any = MADE.session.to_json()
CAPTURES: list[Any] = RECORD["captures"]


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        yield client


@pytest.fixture
def profiles(tmp_path: Path) -> list[Path]:
    files = [tmp_path / f"{capture['id']}.csv" for capture in CAPTURES[:3]]
    for file, capture in zip(files, CAPTURES, strict=False):
        file.write_bytes(MADE.files[capture["files"][0]])
    return files


def paste(page: Page, text: str) -> None:
    page.get_by_label("Poses, one line per capture").fill(text)


def test_a_table_with_its_columns_in_any_order(
    open_page: Callable[..., Any], api: httpx.Client, profiles: list[Path]
) -> None:
    session = make_session(api, cell=RECORD["cell"])
    page, watched = open_page(f"/sessions/{session}")
    page.locator("sc-intake input[type=file]").first.set_input_files(profiles)
    # A German spreadsheet: semicolons, decimal commas, a counter, the quaternion before the place, the file last.
    head = "nr;q1;q2;q3;q4;x [mm];y [mm];z [mm];file"
    rows = [
        ";".join([str(k), *(f"{v}".replace(".", ",") for v in c["pose"][3:] + c["pose"][:3]), f"{c['id']}.csv"])
        for k, c in enumerate(CAPTURES[:3], start=1)
    ]
    paste(page, "\n".join([head, *reversed(rows)]))
    roles = page.locator("sc-pose-columns thead select")
    expect(roles).to_have_count(9)
    chosen = [role.input_value() for role in roles.all()]
    assert chosen == ["ignore", "q1", "q2", "q3", "q4", "x", "y", "z", "file"]
    expect(page.get_by_role("heading", name="Files and poses")).to_be_in_viewport()
    expect(page.get_by_role("button", name="Add 3 captures")).to_be_in_viewport()  # however much is above it
    page.get_by_role("button", name="Add 3 captures").click()
    expect(page.locator(".captures tbody tr")).to_have_count(3)
    stored = {c["id"]: c["pose"] for c in api.get(f"/sessions/{session}/captures").json()["items"]}
    assert stored == {c["id"]: c["pose"] for c in CAPTURES[:3]}
    assert watched.complaints == []


@pytest.mark.thorough
def test_nothing_is_solved_while_captures_are_on_their_way(
    open_page: Callable[..., Any], api: httpx.Client, profiles: list[Path]
) -> None:
    session = make_session(api, cell=RECORD["cell"])
    page, watched = open_page(f"/sessions/{session}")
    held: list[Route] = []

    def hold(route: Route) -> None:  # the second
        stored = api.get(f"/sessions/{session}/captures").json()["items"]
        return held.append(route) if route.request.method == "POST" and stored and not held else route.continue_()

    page.route("**/captures", hold)
    page.locator("sc-intake input[type=file]").first.set_input_files(profiles)
    paste(page, "\n".join(" ".join(map(str, capture["pose"])) for capture in CAPTURES[:3]))
    page.get_by_role("button", name="Add 3 captures").click()
    expect(page.locator(".captures tbody tr")).to_have_count(1)
    solve = page.locator("sc-actions button.solve")
    expect(solve).to_have_attribute("aria-disabled", "true")
    held[0].continue_()
    expect(page.locator(".captures tbody tr")).to_have_count(3)
    expect(solve).to_have_attribute("aria-disabled", "false")
    # What a solve of too few is told leaves with more captures.
    solve.click()
    refusal = page.locator(".toast.bad")
    expect(refusal).to_contain_text("5 captures")
    for capture in CAPTURES[3:5]:
        name = capture["files"][0]
        sent = {"record": json.dumps(capture)}, {"files": (Path(name).name, MADE.files[name])}
        assert api.post(f"/sessions/{session}/captures", data=sent[0], files=sent[1]).status_code == 201
    expect(page.locator(".captures tbody tr")).to_have_count(5)
    expect(refusal).to_have_count(0)
    assert watched.complaints == []


def test_metres_are_offered_to_be_read_as_such_before_anything_is_stored(
    open_page: Callable[..., Any], api: httpx.Client, profiles: list[Path]
) -> None:
    session = make_session(api, cell=RECORD["cell"])
    page, watched = open_page(f"/sessions/{session}")
    # Files in metres without a header that tells so: another unit is one click, with a picture of what it gives.
    bare = [
        {"name": f.name, "mimeType": "text/csv", "buffer": in_metres(f.read_text(encoding="utf-8")).encode()}
        for f in profiles
    ]
    page.locator("sc-intake input[type=file]").first.set_input_files(bare)
    page.get_by_role("button", name="Read as m", exact=True).click()
    expect(page.locator("sc-file-reading .reading-preview svg")).to_be_visible()
    expect(page.get_by_role("button", name="Read as m", exact=True)).to_have_count(0)
    poses = [[v / 1000 for v in c["pose"][:3]] + c["pose"][3:] for c in CAPTURES[:3]]
    paste(page, "\n".join(" ".join(map(str, pose)) for pose in poses))
    page.get_by_role("button", name="Read as metres").click()
    expect(page.locator(".match tbody tr").first).to_contain_text(
        f"{CAPTURES[0]['pose'][0]:.1f}".replace("-", "−")
    )
    page.get_by_role("button", name="Add 3 captures").click()
    expect(page.locator(".captures tbody tr")).to_have_count(3)
    stored = api.get(f"/sessions/{session}/captures").json()["items"]
    assert [c["pose"] for c in stored] == [pytest.approx(c["pose"]) for c in CAPTURES[:3]]
    assert {c["measured"]["verdict"] for c in stored} <= {"pass", "warn"}
    assert watched.complaints == []


def test_a_wrong_convention_is_offered_to_be_read_otherwise_before_anything_is_stored(
    open_page: Callable[..., Any], api: httpx.Client
) -> None:
    session = make_session(api, cell={"pose_convention": "kuka", "sphere_diameter_mm": 40.0})
    page, watched = open_page(f"/sessions/{session}")
    page.get_by_role("button", name="Paste poses").click()
    poses = [parse_pose(RECORD["cell"]["pose_convention"], c["pose"]) for c in CAPTURES]
    paste(page, "\n".join(" ".join(f"{v:.4f}" for v in to_pose("fanuc", pose)) for pose in poses))
    looks, offer = page.locator(".match tbody tr td:last-child").first, page.locator("sc-pose-offers .pose-offer")
    expect(offer).to_contain_text("The poses look at one place within ±")
    expect(offer).to_contain_text("Read as KUKA, that place wanders by ±")
    as_kuka = looks.inner_text()
    with page.expect_request(re.compile("/trial$")) as trial:  # the scene shows them as well
        offer.get_by_role("button", name="Read as FANUC").click()
    assert trial.value.post_data_json["poses"][0] == [pytest.approx(row, abs=1e-3) for row in poses[0].matrix]
    expect(looks).not_to_have_text(as_kuka)
    expect(offer).to_contain_text("Read as FANUC: the poses look at one place")
    offer.get_by_role("button", name="Read as KUKA").click()
    expect(looks).to_have_text(as_kuka)
    expect(offer.get_by_role("button", name="Read as FANUC")).to_be_visible()
    assert api.get(f"/sessions/{session}").json()["cell"]["pose_convention"] == "kuka"
    # Of poses in the cell's convention with two columns swapped, the swap is offered, with the same preview.
    rows = [to_pose("kuka", pose) for pose in poses]
    paste(page, "\n".join(" ".join(f"{row[k]:.4f}" for k in (1, 0, 2, 3, 4, 5)) for row in rows))
    expect(offer).to_contain_text("Read as Y X Z A B C instead of X Y Z A B C")
    with page.expect_request(re.compile("/trial$")) as trial:
        offer.get_by_role("button", name="Swap them").click()
    assert trial.value.post_data_json["poses"][0] == [pytest.approx(row, abs=1e-3) for row in poses[0].matrix]
    expect(offer).to_contain_text("The columns are swapped.")
    offer.get_by_role("button", name="Read them as they stand").click()
    expect(offer.get_by_role("button", name="Swap them")).to_be_visible()
    assert watched.complaints == []


def in_metres(profile: str) -> str:
    """Return a profile's rows in metres, without the header that tells the unit."""
    rows = [line.split(",") for line in profile.splitlines()[1:]]
    return "\n".join(",".join(f"{float(v) / 1000:.8f}" if v else "" for v in row) for row in rows)


def test_columns_are_told_by_hand_and_the_convention_is_seen_before_it_counts(
    open_page: Callable[..., Any], api: httpx.Client
) -> None:
    session = make_session(api, cell={"pose_convention": "fanuc", "sphere_diameter_mm": 40.0})
    page, watched = open_page(f"/sessions/{session}")
    page.get_by_role("button", name="Paste poses").click()
    with page.expect_request(re.compile("/trial$")) as trial:
        paste(page, "100 200 300 90 0 0\n110 200 300 90 0 0")
    shown = trial.value.post_data_json["poses"]
    assert [pose[0][3] for pose in shown] == [100, 110]
    first = page.locator(".match tbody tr").first
    expect(first).to_contain_text("100.0  200.0  300.0 mm")
    expect(first).to_contain_text("to −y")  # FANUC: W turns about x first, so the flange's z looks to −y
    page.get_by_label("Read as").select_option("kuka")  # A turns about z: the flange looks up
    expect(first).to_contain_text("up, 0° off")
    page.get_by_label("Column 1", exact=True).select_option("Z")  # trades places with the third
    expect(first).to_contain_text("300.0  200.0  100.0 mm")
    assert api.get(f"/sessions/{session}").json()["cell"]["pose_convention"] == "fanuc"
    assert watched.complaints == []


def test_the_convention_that_was_looked_at_becomes_the_cells(
    open_page: Callable[..., Any], api: httpx.Client, profiles: list[Path]
) -> None:
    session = make_session(api, cell={**RECORD["cell"], "pose_convention": "kuka"})
    page, _ = open_page(f"/sessions/{session}")
    page.locator("sc-intake input[type=file]").first.set_input_files(profiles[:2])
    paste(page, "\n".join(" ".join(map(str, capture["pose"])) for capture in CAPTURES[:2]))
    page.get_by_label("Read as").select_option("abb")
    page.get_by_role("button", name="Add 2 captures").click()
    expect(page.locator(".captures tbody tr")).to_have_count(2)
    expect(page.locator("header")).to_contain_text("ABB")
    expect(page.locator("sc-quality h2")).not_to_contain_text("refused")


@pytest.mark.thorough
def test_a_watched_folder_is_followed(profile: SharedProfile, tmp_path: Path) -> None:
    folder = tmp_path / "scans" / "cell 4"
    folder.mkdir(parents=True)
    settings = Settings(data=tmp_path / "data", port=0, warm_up=False, watch_root=tmp_path / "scans")
    page = profile.open()
    watched = Watched(page)
    with serving(settings) as client:
        session = make_session(client, cell=RECORD["cell"])
        page.goto(f"{str(client.base_url).removesuffix('/api/v1/')}/sessions/{session}")
        page.get_by_role("button", name="Watch a folder").click()
        page.get_by_label("Folder on the server").select_option("cell 4")
        page.get_by_role("button", name="Watch folder").click()
        status = page.get_by_role("region", name="Watched folder")
        expect(status).to_contain_text("Watching cell 4")
        (folder / "a.csv").write_bytes(MADE.files[CAPTURES[0]["files"][0]])
        expect(status).to_contain_text("Write a.txt with the pose line")
        (folder / "a.txt").write_text(" ".join(map(str, CAPTURES[0]["pose"])))
        expect(page.locator(".captures tbody tr")).to_have_count(1)
        expect(page.locator("sc-quality h2")).to_contain_text("Last capture a")
        expect(status).not_to_contain_text("Write a.txt")
        page.reload()
        expect(status).to_contain_text("1 capture")
        page.get_by_role("button", name="Stop watching").click()
        expect(status).to_be_hidden()
        page.close()
    assert watched.complaints == []


def test_a_server_that_watches_nothing_says_how_to_allow_it(
    open_page: Callable[..., Any], api: httpx.Client
) -> None:
    page, _ = open_page(f"/sessions/{make_session(api)}")
    page.get_by_role("button", name="Watch a folder").click()
    expect(page.get_by_text("SCANCELL_WATCH_ROOT")).to_be_visible()


def a_stick(folder: Path) -> list[Path]:
    """Lay down a cell's files as two other programs leave them: profiles in OpenCV's YAML, poses in a text."""
    folder.mkdir()
    for number, capture in enumerate(CAPTURES, start=1):
        rows = [line.split(",") for line in MADE.files[capture["files"][0]].decode().splitlines()[1:]]
        numbers = [f"{float(x):.6e}, 0., {float(z):.6e}" for x, z, *_ in rows if x and z]
        text = f"%YAML:1.0\n---\nscan_line: [ {', '.join(numbers)} ]\n"
        (folder / f"p{number}.yml").write_text(text, encoding="ascii")
    poses = [to_pose("fanuc", parse_pose(RECORD["cell"]["pose_convention"], c["pose"])) for c in CAPTURES]
    (folder / "Robot.txt").write_text("".join(" ".join(f"{v:.4f}" for v in pose) + "\n" for pose in poses))
    (folder / "cell.sec").write_text('{"CalibObj": {"Name": "Sphere", "Radius": 20.0}, "Config": {}}')
    (folder / "notes.txt").write_text("cable was loose\n")
    return sorted(folder.iterdir())


def test_files_as_they_lie_are_listed_paired_and_added(
    open_page: Callable[..., Any], api: httpx.Client, tmp_path: Path
) -> None:
    files = a_stick(tmp_path / "stick")
    page, watched = open_page("/")
    page.locator("sc-start input[webkitdirectory]").set_input_files(tmp_path / "stick")
    expect(page.get_by_label("Sphere diameter in mm", exact=True)).to_have_value("40")
    assert page.get_by_label("Robot", exact=True).input_value() == "fanuc"
    page.get_by_role("button", name="Create session").click()
    listed = page.locator("sc-file-list tbody tr")
    expect(listed).to_have_count(len(files))
    told = {"p1.yml": "profiles", "Robot.txt": "poses", "cell.sec": "nothing", "notes.txt": "nothing"}
    for name, kind in told.items():
        expect(page.get_by_label(f"Take stick/{name} for")).to_have_value(kind)
    paired = f"{len(CAPTURES)} measurements with their poses, paired by order"
    expect(page.locator("sc-file-list")).to_contain_text(paired)
    pairs = page.locator(".match tbody tr")
    expect(pairs).to_have_count(len(CAPTURES))
    expect(pairs.first.locator("svg.profile-plot")).to_be_visible()
    # What a file is taken for can be changed, and changed back.
    page.get_by_label("Take stick/p2.yml for").select_option("nothing")
    expect(pairs).to_have_count(len(CAPTURES))  # a pose without its measurement
    expect(page.get_by_role("button", name=f"Add {len(CAPTURES) - 1} captures")).to_be_visible()
    page.get_by_label("Take stick/p2.yml for").select_option("profiles")
    page.get_by_role("button", name=f"Add {len(CAPTURES)} captures", exact=True).click()
    expect(page.locator(".captures tbody tr")).to_have_count(len(CAPTURES))
    session = page.url.rsplit("/", 1)[1].partition("#")[0].partition("?")[0]
    stored = {c["id"]: c for c in api.get(f"/sessions/{session}/captures").json()["items"]}
    for number, capture in enumerate(CAPTURES, start=1):
        mine = stored[f"p{number}"]
        theirs = to_pose("fanuc", parse_pose(RECORD["cell"]["pose_convention"], capture["pose"]))
        assert mine["pose"] == pytest.approx(theirs, abs=1e-3)
        assert mine["source"] == f"stick/Robot.txt:{number}"
    assert watched.complaints == []
