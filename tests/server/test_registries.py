"""The lists of what exists, from which the page builds its choices and forms."""

from pathlib import Path

import httpx
import jsonschema_rs
import pytest

from server.cli import main
from tests.server.live_server import make_session, simulated_session, upload, wait_for
from tests.server.test_captures import POSE, arc_csv


@pytest.mark.parametrize(
    ("what", "there"),
    [
        ("formats", {"ply", "pcd"}),
        ("conventions", {"fanuc", "matrix", "ur"}),
        ("exports", {"json"}),
        ("sources", {"simulated", "folder"}),
        ("stages", {"tcp", "turntable", "merge"}),
    ],
)
def test_every_list_has_names_titles_and_the_schema_of_each_entrys_settings(
    client: httpx.Client, what: str, there: set[str]
) -> None:
    items = client.get(f"/{what}").json()["items"]
    names = [item["name"] for item in items]
    assert there <= set(names)
    assert len(set(names)) == len(names)
    for item in items:
        assert item["title"]
        jsonschema_rs.meta.validate(item["settings"])


def test_every_listed_convention_makes_a_session(client: httpx.Client) -> None:
    for convention in client.get("/conventions").json()["items"]:
        session = make_session(client, cell={"pose_convention": convention["name"]})
        answer = client.post(f"/sessions/{session}/pose-lines", json={"text": "1 2 3"}).json()
        assert answer["items"][0].get("problem") or len(convention["numbers"]) == 3


def test_a_check_says_what_blocks_solving_and_what_does_not(client: httpx.Client) -> None:
    session = make_session(client)
    assert client.get(f"/sessions/{session}/check").json()["blocks_solving"]
    upload(client, session, {"id": "p01", "step": "tcp", "kind": "profile", "pose": POSE}, arc_csv())
    found = client.get(f"/sessions/{session}/check").json()
    assert found["items"][0]["level"] == "error"
    assert any("can be used: 1. At least 5" in f["sentence"] for f in found["items"])
    simulated = simulated_session(client, captures=14)
    assert not client.get(f"/sessions/{simulated}/check").json()["blocks_solving"]


def test_jobs_are_listed_by_page_session_and_status(client: httpx.Client) -> None:
    session = simulated_session(client, captures=2)
    jobs = [client.post(f"/sessions/{session}/solve/tcp").json()["id"] for _ in range(3)]
    for job in jobs:
        wait_for(client, job)
    first = client.get("/jobs", params={"session": session, "limit": 2}).json()
    rest = client.get("/jobs", params={"session": session, "limit": 2, "cursor": first["next"]}).json()
    assert rest["next"] is None
    listed = [*first["items"], *rest["items"]]
    assert {job["id"] for job in listed} == set(jobs)
    assert [job["created"] for job in listed] == sorted((job["created"] for job in listed), reverse=True)
    failed = client.get("/jobs", params={"session": session, "status": "failed"}).json()["items"]
    assert {job["id"] for job in failed} == set(jobs)
    assert client.get("/jobs", params={"session": session, "status": "running"}).json()["items"] == []


@pytest.mark.parametrize("path", ["/exports", "/formats", "/brands", "/robot-programs"])
def test_lists_tell_what_proved_each(client: httpx.Client, path: str) -> None:
    for one in client.get(path).json()["items"]:
        assert one["experimental"] is (one["proof"] == "manual only"), one["name"]


def test_downloads_and_files_that_were_read_tell_it_too(
    client: httpx.Client, solved: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = {name: client.get(f"/sessions/{solved}/exports/{name}").headers for name in ("denso", "kuka", "json")}
    assert [one.get("Scancell-Proof") for one in told.values()] == ["manual only", "real files", None]
    (tmp_path / "a.src").write_text("DEF a()\nPTP {X 900.0, Y 0.0, Z 700.0, A 0.0, B 90.0, C 0.0}\nEND\n")
    assert main(["poses", str(tmp_path / "a.src")]) == 0
    assert "Its reader is proved by real files." in capsys.readouterr().out
