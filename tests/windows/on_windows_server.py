"""The server on a Windows Python: page, uploads, live devices, jobs, sign-in; see `on_windows.py`."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from calib_core.library.archives import replay
from tests.server.live_rig import rig, until
from tests.server.live_server import assert_problem, make_session, simulated_session, upload, wait_for
from tests.server.test_batches import one, send, wait_until_measured
from tests.server.test_live_devices import ABB_CELL, both_live, captures
from tests.server.test_watched_folder import pose_line, profile, wait_for_captures, watched_session
from tests.windows.visit import page_of, scene_shown
from tests.windows.windows_python import Figure, ran, serving, there


@pytest.fixture(scope="module")
def client(program: list[str], place: Path) -> Iterator[httpx.Client]:
    (place / "scans" / "hall" / "cell 4").mkdir(parents=True)
    with serving(program, place, SCANCELL_WATCH_ROOT=there(place / "scans")) as client:
        yield client


def solved(client: httpx.Client, session: str, stage: str) -> None:
    job = client.post(f"/sessions/{session}/solve/{stage}").json()["id"]
    assert wait_for(client, job)["status"] == "done"


def arc(seed: int) -> bytes:
    x = np.linspace(-12, 12, 200)
    z = 200 - np.sqrt(20.0**2 - x**2) + np.random.default_rng(seed).normal(0, 0.02, 200)
    return b"x_mm,z_mm\r\n" + b"".join(b"%.4f,%.4f\r\n" % row for row in zip(x, z, strict=True))


def record(name: str) -> dict[str, Any]:
    return {
        "id": name,
        "step": "tcp",
        "kind": "profile",
        "pose": [600, 0, 500, 180, 0, 0],
        "files": [f"{name}.csv"],
    }


def test_the_page_and_all_its_modules_are_served(client: httpx.Client, figure: Figure) -> None:
    site = str(client.base_url).removesuffix("/api/v1/")
    page = client.get(site)
    assert page.status_code == 200
    seen, todo = set[str](), re.findall(r'(?:src|href)="(/web/[^"]+)"', page.text)
    while todo:
        name = todo.pop()
        if name in seen:
            continue
        seen.add(name)
        answer = client.get(site + name)
        assert answer.status_code == 200, name
        if name.endswith(".js"):
            assert answer.headers["content-type"].startswith("text/javascript")
            wanted = re.findall(r'(?:from|import)\s*\(?"(\.[^"]+)"', answer.text)
            todo += [str(httpx.URL(site + name).join(path).path) for path in wanted]
    assert len(seen) > 80
    figure("the page, its styles and modules", "all served", f"{len(seen)} files")


def test_the_page_shows_a_solved_session_with_its_scene(
    client: httpx.Client, tmp_path: Path, figure: Figure
) -> None:
    session = simulated_session(client, captures=14)
    solved(client, session, "tcp")
    site = str(client.base_url).removesuffix("/api/v1/")
    with page_of(f"{site}/sessions/{session}") as page:
        drawn = scene_shown(page, tmp_path / "page.png")
    what = "a solved session's page with its 3-D scene, in Chromium"
    figure(what, "shown, no complaints", f"shown, {drawn:.0%} of its middle drawn")


def test_twenty_captures_are_stored_one_by_one_and_twenty_in_one_body(
    client: httpx.Client, figure: Figure
) -> None:
    cell = {"pose_convention": "fanuc", "sphere_diameter_mm": 40.0, "scanner": {"kind": "profile"}}
    session = client.post("/sessions", json={"name": "uploads", "cell": cell}).json()["id"]
    for k in range(20):
        answer = upload(client, session, record(f"p{k:02d}"), arc(k))
        assert answer.status_code == 201, answer.text
    body = b"".join(one(f"b{k:02d}", arc(100 + k)) for k in range(20))
    assert send(client, session, body).json()["stored"] == 20
    captures = wait_until_measured(client, session)
    assert len(captures) == 40
    content = client.get(f"/sessions/{session}/captures/p07/files/p07.csv").content
    assert content == arc(7)  # byte for byte, its line ends too
    figure("20 captures one by one, 20 in one body; a file read back", "stored; equal", "stored; byte for byte")


def test_a_solve_is_cancelled_and_the_next_one_done(client: httpx.Client, figure: Figure) -> None:
    session = simulated_session(client, captures=14, seed=8)
    job = client.post(f"/sessions/{session}/solve/tcp").json()["id"]
    client.post(f"/jobs/{job}/cancel")
    assert wait_for(client, job)["status"] in ("cancelled", "done")
    job = client.post(f"/sessions/{session}/solve/tcp").json()["id"]
    assert wait_for(client, job)["status"] == "done"
    figure("a solve is cancelled there, and the next one done", "done", "both")


def test_a_session_goes_out_as_an_archive_and_comes_in_again(
    client: httpx.Client, tmp_path: Path, figure: Figure
) -> None:
    session = simulated_session(client, captures=14, seed=9)
    solved(client, session, "tcp")
    archive = client.get(f"/sessions/{session}/archive", params={"scene": False}).content
    answer = client.post("/archives", content=archive, headers={"Content-Type": "application/zip"})
    assert answer.status_code == 201, answer.text
    assert len(client.get(f"/sessions/{answer.json()['id']}/captures").json()["items"]) == 14
    (tmp_path / "session.zip").write_bytes(archive)
    assert replay(tmp_path / "session.zip").equal  # here, on Linux
    figure("a solved session of the server: archive, import, replayed on Linux", "equal", "equal")


def test_scans_are_merged(client: httpx.Client, figure: Figure) -> None:
    session = simulated_session(client, captures=3, scenario="part", seed=3)
    solved(client, session, "merge")
    result = client.get(f"/sessions/{session}/results/merge").json()
    assert result["verdict"] in ("pass", "warn")
    cloud = client.get(f"/sessions/{session}/clouds/merged.ply")
    assert cloud.content.startswith(b"ply")
    assert result["mesh"]
    figure("a merge by the server, with its mesh", "done", f"{result['points']:,} points")


def test_captures_come_from_live_devices_and_from_a_watched_folder(
    client: httpx.Client, place: Path, tmp_path: Path, figure: Figure
) -> None:
    with rig(tmp_path / "exposures") as made:
        session = make_session(client, name="live", cell=ABB_CELL)
        robot = {"host": "127.0.0.1", "port": made.robot.port, "convention": "abb"}
        for device, source, settings in (
            ("robot", "pose-lines", robot),
            ("scanner", "frame-folder", {"folder": there(made.folder)}),
        ):
            body = {"source": source, "settings": settings}
            client.put(f"/sessions/{session}/devices/{device}", json=body).raise_for_status()
        both_live(client, session)
        client.put(f"/sessions/{session}/live", json={"automatic": True, "step": "tcp"})
        for count, number in enumerate(made.good[:3], start=1):
            made.go(number)
            until(
                lambda n=count: len(captures(client, session)) >= n,
                lambda: client.get(f"/sessions/{session}/devices").text,
            )
        for device in ("robot", "scanner"):
            client.delete(f"/sessions/{session}/devices/{device}")
    session = watched_session(client)
    folder = place / "scans" / "hall" / "cell 4"
    (folder / "a.txt").write_text(pose_line(0), encoding="utf-8")
    (folder / "a.csv").write_bytes(profile(0))
    assert len(wait_for_captures(client, session, 1, 60)) == 1
    figure("captures of live devices and of a watched folder", "taken", "3 and 1")


def test_nobody_comes_in_without_a_token_and_a_pdf_needs_a_browser(
    program: list[str], place: Path, figure: Figure
) -> None:
    words = ["token", "create", "--name", "Zoë", "--role", "admin", "--data", "signed", "--quiet"]
    token = ran(program, place, *words).decode().strip()
    with serving(program, place, "signed", SCANCELL_REQUIRE_LOGIN="true") as client:
        assert_problem(client.get("/sessions"), 401, "/login")
        client.headers["Authorization"] = f"Bearer {token}"
        session = simulated_session(client, captures=14)
        solved(client, session, "tcp")
        report = client.get(f"/sessions/{session}/report")
        assert report.status_code == 200
        printed = client.get(f"/sessions/{session}/report", params={"format": "pdf"})
        if printed.status_code != 200:
            assert_problem(printed, 422, "Edge")
    how = "printed" if printed.status_code == 200 else "no browser there: told"
    figure("sign-in by a token; a report, and as PDF", "works; printed or told", f"works; {how}")
