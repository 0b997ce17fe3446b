"""A merge over REST: its cloud and mesh are stored, given in every format, kept in archives, and cancelled."""

import io
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

import server.jobs.worker
from tests.server.live_server import assert_problem, upload, wait_for
from tests.server.slow_work import solve_on_a_full_disk

RADIUS_MM, SIGMA_MM, VIEWS = 20.0, 0.02, 3
FORMATS = {"ply": "model/ply", "pcd": "application/octet-stream", "xyz": "text/plain", "e57": "model/e57"}


def dome(seed: int, pitch_mm: float) -> bytes:
    """A sphere's upper side on a grid, as an organised PCD; z grows away from the scanner."""
    steps = np.arange(-15.0, 15.0 + pitch_mm / 2, pitch_mm)
    x, y = np.meshgrid(steps, steps)
    z = 150 - np.sqrt(np.maximum(RADIUS_MM**2 - x**2 - y**2, 0))
    z += np.random.default_rng(seed).normal(0, SIGMA_MM, z.shape)
    z[x**2 + y**2 > 15**2] = np.nan
    rows, columns = z.shape
    header = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {columns}\nHEIGHT {rows}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {z.size}\nDATA binary\n"
    )
    return header.encode() + np.stack([x, y, z], axis=-1).astype("<f4").tobytes()


def scanned_session(client: httpx.Client, pitch_mm: float = 1.0, **merge: Any) -> str:
    """A session whose scanner is known on the flange, with scans of a sphere."""
    cell = {
        "pose_convention": "matrix",
        "scanner": {"point_sigma_mm": SIGMA_MM},
        "known": {"tool0_from_laser": np.eye(4).tolist()},
        "merge": {"voxel_mm": 1.0, **merge},
    }
    answer = client.post("/sessions", json={"name": "part", "cell": cell})
    assert answer.status_code == 201, answer.text
    session = answer.json()["id"]
    for number in range(VIEWS):
        record = {
            "id": f"s{number}",
            "step": "scan",
            "kind": "cloud",
            "files": [f"captures/s{number}.pcd"],
            "pose": np.eye(4).ravel().tolist(),
        }
        taken = upload(client, session, record, dome(number, pitch_mm))
        assert taken.status_code == 201, taken.text
    return session


def merged(client: httpx.Client, session: str) -> dict[str, Any]:
    ended = wait_for(client, client.post(f"/sessions/{session}/solve/merge").json()["id"])
    assert ended["status"] == "done", ended
    return client.get(f"/sessions/{session}/results/merge").json()


@pytest.mark.thorough
def test_a_merge_stores_its_cloud_and_its_mesh_in_every_format(client: httpx.Client, tmp_path: Path) -> None:
    import open3d as o3d  # a second or more, for this test alone
    import trimesh

    session = scanned_session(client, mesh="grid")
    assert_problem(client.get(f"/sessions/{session}/clouds/merged.ply"), 404, "solve/merge")
    assert_problem(client.get(f"/sessions/{session}/exports/ply"), 422, "clouds/merged.ply")
    result = merged(client, session)
    assert (result["cloud"], result["mesh"]) == ("clouds/merged.ply", "clouds/mesh.ply")

    listed = client.get(f"/sessions/{session}/clouds").json()["items"]
    assert [item["name"] for item in listed] == ["merged.ply", "mesh.ply"]
    stored = client.get(f"/sessions/{session}/clouds/merged.ply")
    assert len(stored.content) == listed[0]["bytes"] == int(stored.headers["content-length"])
    (tmp_path / "merged.ply").write_bytes(stored.content)
    points = np.asarray(o3d.io.read_point_cloud(str(tmp_path / "merged.ply")).points)
    assert len(points) == result["points"]
    # Ordinary noise of each point, and the sphere's centre is known: 150 mm before the scanner.
    distance = np.linalg.norm(points - [0, 0, 150], axis=1) - RADIUS_MM
    assert np.sqrt(np.mean(distance**2)) < 2 * SIGMA_MM

    for ending, media_type in FORMATS.items():
        answers = [
            client.get(f"/sessions/{session}/clouds/merged.{ending}"),
            client.get(f"/sessions/{session}/clouds/merged", params={"format": ending}),
        ]
        for answer in answers:
            assert answer.status_code == 200, answer.text
            assert answer.headers["content-type"].split(";")[0] == media_type
            assert answer.headers["content-disposition"] == f'attachment; filename="merged.{ending}"'
        if ending in ("pcd", "xyz"):
            (tmp_path / f"again.{ending}").write_bytes(answers[0].content)
            again = np.asarray(o3d.io.read_point_cloud(str(tmp_path / f"again.{ending}")).points)
            np.testing.assert_allclose(again, points, atol=1e-4)
    mesh = client.get(f"/sessions/{session}/clouds/mesh.stl")
    surface = trimesh.load_mesh(io.BytesIO(mesh.content), file_type="stl")
    assert len(surface.faces) == result["triangles"]

    assert_problem(client.get(f"/sessions/{session}/clouds/merged.stl"), 422, "mesh")
    assert_problem(client.get(f"/sessions/{session}/clouds/mesh.e57"), 422, "cloud")
    assert_problem(client.get(f"/sessions/{session}/clouds/merged.docx"), 404, "e57")
    assert_problem(client.get(f"/sessions/{session}/clouds/other.ply"), 404, "merged.ply")
    assert_problem(client.get("/sessions/none/clouds/merged.ply"), 404, "none")


def test_a_new_merge_takes_the_place_of_the_former(client: httpx.Client) -> None:
    session = scanned_session(client, mesh="grid")
    merged(client, session)
    first = client.get(f"/sessions/{session}/clouds").json()["items"]
    assert client.patch(f"/sessions/{session}", json={"cell": {"merge": {"mesh": "none"}}}).status_code == 200
    assert client.patch(f"/sessions/{session}/captures/s0", json={"excluded": True}).status_code == 200
    result = merged(client, session)
    second = client.get(f"/sessions/{session}/clouds").json()["items"]
    assert result["mesh"] is None
    assert [item["name"] for item in second] == ["merged.ply"]
    assert second[0]["sha256"] != first[0]["sha256"]


def test_an_archive_keeps_cloud_and_mesh(client: httpx.Client) -> None:
    session = scanned_session(client, mesh="grid")
    merged(client, session)
    archive = client.get(f"/sessions/{session}/archive", params={"scene": False})
    assert archive.status_code == 200, archive.text
    headers = {"Content-Type": "application/zip"}
    imported = client.post("/archives", content=archive.content, headers=headers)
    assert imported.status_code == 201, imported.text
    other = imported.json()["id"]
    assert client.get(f"/sessions/{other}/clouds").json() == client.get(f"/sessions/{session}/clouds").json()
    for name in ("merged.ply", "mesh.ply"):
        one, two = (client.get(f"/sessions/{s}/clouds/{name}").content for s in (session, other))
        assert one == two
    assert client.get(f"/sessions/{other}/results/merge").json()["stale"] is False


def until(client: httpx.Client, job: str, words: str) -> dict[str, Any]:
    """Wait until a job says that it does something, and return all that it has said."""
    end_s = time.monotonic() + 300
    while time.monotonic() < end_s:
        answer = client.get(f"/jobs/{job}").json()
        if words in answer["message"] or answer["status"] not in ("queued", "running"):
            return answer
        time.sleep(0.01)
    raise AssertionError(answer)


@pytest.mark.thorough
def test_a_merge_is_cancelled_at_once_leaves_nothing_and_runs_again(start: Callable[..., Any]) -> None:
    with start() as client:
        session = scanned_session(client, pitch_mm=0.08, mesh="poisson", voxel_mm=0.12)
        job = client.post(f"/sessions/{session}/solve/merge").json()["id"]
        running = until(client, job, "Building the mesh")
        assert (running["status"], running["progress"]) == ("running", pytest.approx(0.84, abs=0.01))
        begun_s = time.monotonic()
        assert client.post(f"/jobs/{job}/cancel").json()["status"] == "cancelled"
        short = client.patch(f"/sessions/{session}", json={"cell": {"merge": {"mesh": "none", "voxel_mm": 1.0}}})
        assert short.status_code == 200, short.text
        other = client.post(f"/sessions/{session}/solve/merge").json()["id"]
        until(client, other, "started")  # one worker: it is free again
        assert time.monotonic() - begun_s < 5  # most of it is a new process
        assert client.get(f"/sessions/{session}/clouds").json() == {"items": []}
        assert client.get(f"/sessions/{session}/results").json() == {}
        assert wait_for(client, other)["status"] == "done"
        assert len(client.get(f"/sessions/{session}/clouds").json()["items"]) == 1


@pytest.mark.thorough
def test_a_full_disk_stops_the_merge_with_a_sentence_and_touches_nothing(
    start: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    with start() as client:
        session = scanned_session(client, mesh="none")
        first = merged(client, session)
        monkeypatch.setattr(server.jobs.worker, "solve", solve_on_a_full_disk)
        job = wait_for(client, client.post(f"/sessions/{session}/solve/merge").json()["id"])
        assert job["status"] == "failed"
        assert "room in the data folder for clouds/merged.ply, got file too large" in job["error"]["detail"]
        assert "untouched" in job["error"]["to_do"]
        assert client.get(f"/sessions/{session}/results/merge").json() == first
        cloud = client.get(f"/sessions/{session}/clouds/merged.ply")
        assert (cloud.status_code, len(cloud.content) > 1000) == (200, True)
