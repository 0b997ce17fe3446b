"""Captures over REST: stored as they came, measured, corrected, removed; refused where they are of no use."""

import json
import time
from hashlib import sha256
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from server.jobs.measuring_processes import Measuring
from server.sources.simulated import next_capture
from server.sources.simulated import simulated_session as simulated_cell
from tests.server.live_server import assert_problem, make_session, simulated_session, upload

POSE = [-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635]


def record(capture: str = "p01", **fields: Any) -> dict[str, Any]:
    return {"id": capture, "step": "tcp", "kind": "profile", "pose": POSE, **fields}


def arc_csv(radius_mm: float = 15.0, seed: int = 0) -> bytes:
    """The near side of a circle about (0, 150), as a scanner sees a sphere: z grows away from it."""
    x = np.arange(-0.85 * radius_mm, 0.85 * radius_mm, 0.1)
    z = 150.0 - np.sqrt(radius_mm**2 - x**2) + np.random.default_rng(seed).normal(0, 0.02, x.size)
    return ("x_mm,z_mm\n" + "\n".join(f"{a:.5f},{b:.5f}" for a, b in zip(x, z, strict=True))).encode()


def test_a_capture_is_stored_byte_for_byte_and_measured(client: httpx.Client) -> None:
    session = make_session(client)
    content = arc_csv()
    answer = upload(client, session, record(files=["captures/p01.csv"], mount="by hand"), content)
    assert answer.status_code == 201, answer.text
    measured = answer.json()["measured"]
    assert measured["verdict"] == "pass", measured
    # 255 points of 0.02 mm on a 115° arc give the circle to a few micrometres.
    assert measured["radius_mm"] == pytest.approx(15.0, abs=0.05)
    assert measured["center_mm"] == pytest.approx([0.0, 150.0], abs=0.05)
    stored = client.get(f"/sessions/{session}/captures/p01")
    assert stored.json() == answer.json()
    assert stored.json()["mount"] == "by hand"
    for name in ("captures/p01.csv", "p01.csv"):
        file = client.get(f"/sessions/{session}/captures/p01/files/{name}")
        assert file.content == content
        assert file.headers["etag"] == f'"{sha256(content).hexdigest()}"'
    inside = client.get(f"/sessions/{session}").json()["captures"]
    assert inside == [{name: value for name, value in answer.json().items() if name != "measured"}]


def test_a_capture_without_a_sphere_is_kept_and_says_why(client: httpx.Client) -> None:
    session = make_session(client)
    x = np.linspace(-20, 20, 300)
    line = ("x_mm,z_mm\n" + "\n".join(f"{v:.3f},150.0" for v in x)).encode()
    measured = upload(client, session, record(), line).json()["measured"]
    assert measured["verdict"] == "fail"
    assert measured["reason"]
    assert measured["to_do"]
    assert client.get(f"/sessions/{session}/captures").json()["items"][0]["measured"] == measured


@pytest.mark.parametrize(
    ("fields", "content", "words"),
    [
        ({"pose": POSE[:5]}, arc_csv(), ["5"]),
        ({"kind": "hologram"}, arc_csv(), ["kind", "hologram"]),
        ({"id": "../p01"}, arc_csv(), ["id"]),
        ({"files": ["/etc/passwd"]}, arc_csv(), ["inside the session folder"]),
        ({"files": ["captures/../../p01.csv"]}, arc_csv(), ["inside the session folder"]),
        ({"files": ["a.csv", "b.csv"]}, arc_csv(), ["names: 2, got 1"]),
        ({"files": ["a.csv", "a.csv"]}, arc_csv(), ["stands twice"]),
        ({"files": "a.csv"}, arc_csv(), ["list of file names"]),
        ({}, b"", []),
        ({}, b"x_mm,z_mm\nfour,five\nsix,seven\n", []),
        ({}, b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (9, 2)}", []),
    ],
)
def test_unusable_captures_are_refused_and_leave_nothing(
    client: httpx.Client, fields: dict[str, Any], content: bytes, words: list[str]
) -> None:
    session = make_session(client)
    assert_problem(upload(client, session, record(**fields), content), 422, *words)
    assert client.get(f"/sessions/{session}/captures").json() == {"items": [], "next": None}


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('{"id": "p01", "step": "tcp", "kind": "profile", "pose": [NaN, 1, 2, 3, 4, 5]}', "NaN"),
        ("[]", "object"),
        ("not json", "JSON"),
    ],
)
def test_unusable_records_are_refused(client: httpx.Client, text: str, word: str) -> None:
    session = make_session(client)
    files = [("record", (None, text)), ("files", ("a.csv", arc_csv()))]
    assert_problem(client.post(f"/sessions/{session}/captures", files=files), 422, word)


def test_a_capture_without_its_record_is_refused(client: httpx.Client) -> None:
    session = make_session(client)
    answer = client.post(f"/sessions/{session}/captures", files=[("files", ("a.csv", arc_csv()))])
    assert_problem(answer, 422, "record")
    answer = client.post(
        f"/sessions/{session}/captures", content=b"--x\r\nrubbish", headers={"Content-Type": "multipart/form-data"}
    )
    assert_problem(answer, 400)


def test_a_second_capture_of_the_same_id_is_refused(client: httpx.Client) -> None:
    session = make_session(client)
    assert upload(client, session, record(), arc_csv()).status_code == 201
    assert_problem(upload(client, session, record(), arc_csv(seed=1)), 409, "p01")
    other = record("p02", files=["captures/p01.csv"])
    assert_problem(upload(client, session, other, arc_csv(seed=1)), 409, "captures/p01.csv")
    assert upload(client, session, other, arc_csv()).status_code == 201  # the same bytes may be shared


def test_a_repeated_upload_is_answered_again_and_stored_once(client: httpx.Client) -> None:
    session = make_session(client)
    key = {"Idempotency-Key": "upload-1"}
    first = upload(client, session, record(), arc_csv(), headers=key)
    again = upload(client, session, record(), arc_csv(), headers=key)
    assert (first.status_code, again.status_code) == (201, 201)
    assert again.json() == first.json()
    assert again.headers["idempotency-replayed"] == "true"
    assert len(client.get(f"/sessions/{session}/captures").json()["items"]) == 1
    assert_problem(upload(client, session, record("p02"), arc_csv(), headers=key), 409, "Idempotency-Key")
    assert_problem(upload(client, session, record(), arc_csv(seed=1), headers=key), 409, "Idempotency-Key")


def test_centres_need_no_file(client: httpx.Client) -> None:
    session = make_session(client)
    center = {"id": "c01", "step": "tcp", "kind": "center", "center_mm": [1.0, 2.0, 150.0], "pose": POSE}
    answer = upload(client, session, center)
    assert answer.status_code == 201, answer.text
    assert answer.json()["measured"]["center_mm"] == [1.0, 2.0, 150.0]


def test_files_are_matched_by_name_else_by_order(client: httpx.Client) -> None:
    session = make_session(client)
    contents = [arc_csv(seed=number) for number in range(2)]
    for capture, uploaded in (("s1", ["b.csv", "a.csv"]), ("s2", ["1.csv", "0.csv"])):
        names = [f"captures/{capture}/a.csv", f"captures/{capture}/b.csv"]
        sweep = {**record(capture), "kind": "sweep", "files": names, "poses": [POSE, POSE]}
        parts = [("record", (None, json.dumps(sweep)))]
        parts += [("files", (name, content)) for name, content in zip(uploaded, contents, strict=True)]
        assert client.post(f"/sessions/{session}/captures", files=parts).status_code == 201
    a, b = (client.get(f"/sessions/{session}/captures/{capture}/files/a.csv").content for capture in ("s1", "s2"))
    assert (a, b) == (contents[1], contents[0])
    assert_problem(client.get(f"/sessions/{session}/captures/s1/files/c.csv"), 404, "a.csv")
    assert_problem(client.get(f"/sessions/{session}/captures/s1/files/../../../scancell.db"), 404)


def test_a_record_is_corrected_but_its_files_stay(client: httpx.Client) -> None:
    session = make_session(client)
    upload(client, session, record(), arc_csv())
    path = f"/sessions/{session}/captures/p01"
    tag = client.get(path).headers["etag"]
    changed = client.patch(path, json={"excluded": True, "table_deg": 12.5, "side": -1}, headers={"If-Match": tag})
    assert changed.status_code == 200
    assert (changed.json()["excluded"], changed.json()["table_deg"], changed.json()["side"]) == (True, 12.5, -1)
    assert "side" not in client.patch(path, json={"side": None}).json()
    assert_problem(client.patch(path, json={"excluded": False}, headers={"If-Match": tag}), 412, "If-Match")
    assert_problem(client.patch(path, json={"pose": [1, 2, 3]}), 422, "3")
    assert_problem(client.patch(path, json={"files": ["x.csv"]}), 422, "upload it again")
    assert client.get(path).json()["excluded"] is True


def test_a_new_diameter_measures_all_captures_anew(client: httpx.Client) -> None:
    session = make_session(client)
    assert upload(client, session, record(), arc_csv(15.0)).json()["measured"]["verdict"] == "pass"
    client.patch(f"/sessions/{session}", json={"cell": {"sphere_diameter_mm": 20.0}})
    measured = client.get(f"/sessions/{session}/captures/p01").json()["measured"]
    assert measured["verdict"] == "fail"  # a circle of 15 mm does not lie on a sphere of 10 mm
    answer = client.patch(f"/sessions/{session}", json={"cell": {"pose_convention": "abb"}})
    assert_problem(answer, 422, "p01", "7")


def test_many_captures_are_measured_anew_after_the_answer(client: httpx.Client) -> None:
    session = make_session(client)
    for number in range(11):
        assert upload(client, session, record(f"p{number}"), arc_csv(15.0)).json()["measured"]["verdict"] == "pass"
    changed = client.patch(f"/sessions/{session}", json={"cell": {"sphere_diameter_mm": 20.0}})
    assert changed.status_code == 200, changed.text
    end_s = time.monotonic() + 300
    while time.monotonic() < end_s:
        items = client.get(f"/sessions/{session}/captures").json()["items"]
        assert {item["measured"]["verdict"] for item in items} <= {"warn", "fail"}  # never the old cell's
        if all(item["measured"]["verdict"] == "fail" for item in items):
            return
        time.sleep(0.02)
    raise AssertionError("they are not measured anew")


def test_a_removed_capture_is_gone_and_may_come_again(client: httpx.Client) -> None:
    session = make_session(client)
    upload(client, session, record(), arc_csv())
    assert client.delete(f"/sessions/{session}/captures/p01").status_code == 204
    assert_problem(client.get(f"/sessions/{session}/captures/p01"), 404, "p01")
    assert_problem(client.delete(f"/sessions/{session}/captures/p01"), 404, "p01")
    assert upload(client, session, record(), arc_csv(seed=3)).status_code == 201


def test_captures_are_paged_in_the_order_of_arrival(client: httpx.Client) -> None:
    session = make_session(client)
    for number in (3, 1, 2):
        upload(client, session, record(f"p{number}"), arc_csv())
    first = client.get(f"/sessions/{session}/captures", params={"limit": 2}).json()
    rest = client.get(f"/sessions/{session}/captures", params={"limit": 2, "cursor": first["next"]}).json()
    assert [item["id"] for item in first["items"] + rest["items"]] == ["p3", "p1", "p2"]
    assert rest["next"] is None


def test_the_simulated_cell_delivers_all_its_captures_and_then_says_so(client: httpx.Client) -> None:
    session = simulated_session(client, captures=13)
    path = f"/sessions/{session}/sources/simulated/capture"
    first = client.post(path, headers={"Idempotency-Key": "last"})
    again = client.post(path, headers={"Idempotency-Key": "last"})
    assert first.json() == again.json()
    assert first.json()["measured"]["verdict"] == "pass"
    assert_problem(client.post(path), 409, "all of its captures", "Solve")
    assert client.get("/sessions", params={"limit": 1}).json()["items"][0]["capture_count"] == 14
    assert_problem(client.post(f"/sessions/{make_session(client)}/sources/simulated/capture"), 409, "real cell")


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("scenario", "steps"),
    [
        ("cell", ["tcp", "turntable", "verify"]),
        ("frames-tcp", ["camera", "laser-plane", "tcp"]),
        ("rail-positioner", ["tcp", "turntable", "verify", "scan"]),
    ],
)
def test_a_simulated_cell_takes_more_of_a_step_under_names_of_their_own(scenario: str, steps: list[str]) -> None:
    """What the page asks for where an answer is usable alone is never refused."""
    taken = {capture.id for capture in simulated_cell({"scenario": scenario, "seed": 7}).session.captures}
    for step in [*steps, *steps]:
        capture, files = next_capture({"scenario": scenario, "seed": 7}, taken, step)
        assert capture.id not in taken
        assert (capture.step, sorted(capture.files)) == (step, sorted(files))
        taken.add(capture.id)


def test_a_cell_that_changes_while_a_capture_is_measured_is_noticed(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = make_session(client)
    measured_text = Measuring.measured_text
    diameters_mm = [40.5, 41.0, 41.5]

    def change_meanwhile(*given: Any) -> Any:
        if diameters_mm:
            client.patch(f"/sessions/{session}", json={"cell": {"sphere_diameter_mm": diameters_mm.pop(0)}})
        return measured_text(*given)

    monkeypatch.setattr(Measuring, "measured_text", change_meanwhile)
    assert_problem(upload(client, session, record(), arc_csv()), 409, "again")  # it has changed twice
    measured = upload(client, session, record(), arc_csv()).json()["measured"]  # and then once: measured again
    assert measured["zone"] == pytest.approx(2 * measured["radius_mm"] / 41.5)


def test_the_simulated_cell_takes_a_capture_again(client: httpx.Client) -> None:
    session = simulated_session(client, captures=2)
    path = f"/sessions/{session}/sources/simulated/capture"
    first = client.get(f"/sessions/{session}/captures/p02").json()
    key = {"Idempotency-Key": f"again-{session}"}
    once, repeated = (client.post(path, params={"again": "p02"}, headers=key).json() for _ in range(2))
    assert once == repeated
    assert (once["id"], once["pose"]) == ("p02-again", first["pose"])
    assert once["measured"]["center_mm"] != first["measured"]["center_mm"]
    # The arm's own repeatability, 0.05 mm and a lever, is all that differs.
    assert np.allclose(once["measured"]["center_mm"], first["measured"]["center_mm"], atol=1.5)
    assert client.post(path, params={"again": "p02-again"}).json()["id"] == "p02-again2"
    assert client.post(path).json()["id"] == "p03"
    assert_problem(client.post(path, params={"again": "elsewhere"}), 409, "simulated capture")


def test_a_capture_whose_file_was_damaged_can_be_left_out(start: Any, tmp_path: Path) -> None:
    with start() as client:
        session = simulated_session(client, captures=1)
        before = client.get(f"/sessions/{session}/captures/p01").json()
        content = client.get(f"/sessions/{session}/captures/p01/files/p01.csv").content
        digest = sha256(content).hexdigest()
        (tmp_path / "data" / "blobs" / digest[:2] / digest).write_bytes(b"?" + content[1:])
        path = f"/sessions/{session}/captures/p01"
        assert_problem(client.patch(path, json={"side": 1}), 503, digest[:12])
        left_out = client.patch(path, json={"excluded": True}).json()
        assert left_out.pop("excluded_because")["who"] == "this machine"
        assert left_out == {**before, "excluded": True}
        assert client.patch(path, json={"excluded": None}).json()["measured"] == before["measured"]
