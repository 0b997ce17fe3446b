"""The answer that programs act on: never stale or failed in silence, always with the numbers that were solved."""

import json
import re
import zipfile
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from server.cli import main
from tests.server.live_server import assert_problem, make_session, simulated_session, wait_for


@pytest.fixture
def stale(client: httpx.Client, solved: str) -> Iterator[str]:
    client.patch(f"/sessions/{solved}/captures/p03", json={"excluded": True})
    yield solved
    client.patch(f"/sessions/{solved}/captures/p03", json={"excluded": None})


def test_the_answer_holds_frame_covariance_verdict_date_and_hashes(client: httpx.Client, solved: str) -> None:
    found = client.get(f"/sessions/{solved}/answer")
    answer, result = found.json(), client.get(f"/sessions/{solved}/results/tcp").json()
    assert (answer["stage"], answer["verdict"], answer["stale"], answer["faults"]) == ("tcp", "pass", False, [])
    assert np.allclose(answer["tool0_from_laser"]["matrix"], result["tool0_from_laser"], atol=1e-9)
    assert np.allclose(answer["tool0_from_laser"]["covariance"], np.array(result["covariance"])[:6, :6])
    assert answer["inputs_sha256"] == {"tcp": result["inputs_sha256"]}
    assert answer["solved"].startswith("20")
    assert answer["base_from_turntable"] is None
    assert len(answer["names"]) == len(answer["tool0_from_laser"]["numbers"])
    assert found.headers["Scancell-Stale"] == "false"
    assert found.headers["Scancell-Verdict"] == "pass"


def test_without_a_solve_there_is_no_answer(client: httpx.Client) -> None:
    session = make_session(client)
    assert_problem(client.get(f"/sessions/{session}/answer"), 409, "Solve the session first")
    assert_problem(client.get(f"/sessions/{session}/exports/json"), 409, "Solve the session first")
    assert_problem(client.get(f"/sessions/{session}/exports/smoke-signals"), 422, "json")


@pytest.mark.thorough
def test_a_stale_answer_is_refused_unless_allowed_and_then_marked(client: httpx.Client, stale: str) -> None:
    for export in client.get("/exports").json()["items"]:
        path = f"/sessions/{stale}/exports/{export['name']}"
        assert_problem(client.get(path), 409, "allow=stale")
        given = client.get(path, params={"allow": "stale,fail"})
        if given.status_code == 409:  # it has no table
            assert "stale" not in given.json()["got"]
            continue
        assert given.headers["Scancell-Stale"] == "true"
        said = given.text.lower().replace("-", " ")
        assert "stale" in said or "do not use" in said, export["name"]
    assert client.get(f"/sessions/{stale}/answer").json()["faults"] == ["stale"]
    assert_problem(client.get(f"/sessions/{stale}/exports/json", params={"allow": "old"}), 422, "allow")


def test_report_and_archive_are_always_made_and_marked(client: httpx.Client, stale: str) -> None:
    report = client.get(f"/sessions/{stale}/report")
    assert report.headers["Scancell-Stale"] == "true"
    archive = client.get(f"/sessions/{stale}/archive", params={"scene": False})
    assert archive.headers["Scancell-Stale"] == "true"
    with zipfile.ZipFile(BytesIO(archive.content)) as packed:
        (name,) = (name for name in packed.namelist() if name.endswith("data/answer.json"))
        answer = json.loads(packed.read(name))
    assert answer == client.get(f"/sessions/{stale}/answer").json()
    imported = client.post("/archives", content=archive.content, headers={"Content-Type": "application/zip"})
    again = client.get(f"/sessions/{imported.json()['id']}/archive", params={"scene": False})
    with zipfile.ZipFile(BytesIO(again.content)) as packed:
        assert sum(name.endswith("answer.json") for name in packed.namelist()) == 1


def test_a_stale_answer_keeps_the_convention_that_it_was_solved_with(client: httpx.Client, solved: str) -> None:
    before = client.get(f"/sessions/{solved}/answer").json()
    assert before["pose_convention"] == "abb"
    other = {"pose_convention": "quaternion-xyzw"}  # as many numbers
    changed = client.patch(f"/sessions/{solved}", json={"cell": other})
    assert changed.status_code == 200, changed.text
    after = client.get(f"/sessions/{solved}/answer").json()
    client.patch(f"/sessions/{solved}", json={"cell": {"pose_convention": before["pose_convention"]}})
    assert after["stale"]
    assert after["pose_convention"] == before["pose_convention"]
    assert after["tool0_from_laser"] == before["tool0_from_laser"]


@pytest.mark.thorough
def test_a_failed_answer_is_refused_unless_allowed(start: Callable[..., Any], tmp_path: Path) -> None:
    with start() as client:
        session = simulated_session(client, captures=14)
        wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"])
        archive = client.get(f"/sessions/{session}/archive", params={"scene": False}).content
    (tmp_path / "cell.zip").write_bytes(archive)
    assert main(["archive", "unpack", str(tmp_path / "cell.zip"), "--out", str(tmp_path / "cell")]) == 0
    folder = tmp_path / "cell" / "data"
    result = json.loads((folder / "results" / "tcp.json").read_text())
    (folder / "results" / "tcp.json").write_text(json.dumps({**result, "verdict": "fail"}))
    assert main(["answer", str(folder), "--json"]) == 1
    assert main(["archive", "pack", str(folder), "--no-scene", "--out", str(tmp_path / "failed.zip")]) == 0
    with start() as client:
        body = (tmp_path / "failed.zip").read_bytes()
        imported = client.post("/archives", content=body, headers={"Content-Type": "application/zip"})
        path = f"/sessions/{imported.json()['id']}/exports/json"
        assert_problem(client.get(path), 409, "allow=fail")
        given = client.get(path, params={"allow": "fail,not-replayed,differs"})
        assert given.headers["Scancell-Verdict"] == "fail"
        assert given.json()["not_to_be_used"] in (["fail", "not-replayed"], ["fail", "differs"])


@pytest.mark.thorough
def test_a_stored_result_that_is_none_is_refused_in_words(
    client: httpx.Client, solved: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = unpacked(client, solved, tmp_path)
    file = folder / "results" / "tcp.json"
    whole = json.loads(file.read_text())
    assert whole["pose_convention"] == "abb"
    for lacking in ("verdict", "covariance", "tool0_from_laser"):
        file.write_text(json.dumps({name: value for name, value in whole.items() if name != lacking}))
        for command in (["export", str(folder), "--format", "json"], ["answer", str(folder)]):
            assert main(command) == 2
            assert lacking in capsys.readouterr().err


@pytest.mark.thorough
def test_numbers_of_a_folder_stay_in_the_convention_that_they_were_solved_with(
    client: httpx.Client, solved: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = unpacked(client, solved, tmp_path)
    record = json.loads((folder / "session.json").read_text())
    record["cell"]["pose_convention"] = "quaternion-wxyz"
    (folder / "session.json").write_text(json.dumps(record))
    capsys.readouterr()
    assert main(["answer", str(folder), "--json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert (answer["pose_convention"], answer["stale"]) == ("abb", True)
    assert main(["export", str(folder), "--format", "json", "--allow", "stale"]) == 0
    exported = json.loads(capsys.readouterr().out)
    assert (exported["pose_convention"], exported["stale"]) == ("abb", True)


def unpacked(client: httpx.Client, session: str, folder: Path) -> Path:
    archive = client.get(f"/sessions/{session}/archive", params={"scene": False}).content
    (folder / "cell.zip").write_bytes(archive)
    assert main(["archive", "unpack", str(folder / "cell.zip"), "--out", str(folder / "cell")]) == 0
    return folder / "cell" / "data"


@pytest.mark.thorough
def test_the_command_prints_the_same_answer_as_the_server(
    client: httpx.Client, solved: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    archive = client.get(f"/sessions/{solved}/archive", params={"scene": False}).content
    (tmp_path / "cell.zip").write_bytes(archive)
    assert main(["answer", str(tmp_path / "cell.zip"), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    served = client.get(f"/sessions/{solved}/answer").json()
    assert printed == served  # with when it was solved, which is not when the archive was unpacked
    assert main(["answer", str(tmp_path / "cell.zip")]) == 0
    text = capsys.readouterr().out
    tool = text[text.index("tool0_from_laser") :]
    expanded = re.search(r"^ *x .*± ([\d.]+) mm$", tool, re.MULTILINE)
    assert expanded is not None
    # As everywhere: what stands behind ± is expanded, k = 2.
    assert float(expanded[1]) == pytest.approx(2 * served["tool0_from_laser"]["number_sigmas"][0], rel=0.05)


@pytest.mark.thorough
def test_any_transform_between_two_frames_is_answered_and_printed(
    client: httpx.Client, stale: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = {"into": "base", "outof": "laser", "capture": "p04"}
    found = client.get(f"/sessions/{stale}/frames", params=asked).json()
    tool = np.array(client.get(f"/sessions/{stale}/answer").json()["tool0_from_laser"]["matrix"])
    robot = np.array(next(edge["matrix"] for edge in found["edges"] if edge["name"] == "base_from_tool0"))
    assert np.allclose(found["asked"]["matrix"], robot @ tool, atol=1e-9)
    assert found["asked"]["through"] == ["base_from_tool0", "tool0_from_laser"]
    assert found["asked"]["stale"]
    assert_problem(client.get(f"/sessions/{stale}/frames", params={"into": "base"}), 422, "outof")
    assert_problem(client.get(f"/sessions/{stale}/frames", params={**asked, "capture": "none"}), 404, "captures")
    assert_problem(
        client.get(f"/sessions/{stale}/frames", params={**asked, "outof": "board"}), 409, "Solve the stages"
    )
    (tmp_path / "cell.zip").write_bytes(client.get(f"/sessions/{stale}/archive", params={"scene": False}).content)
    assert main(["frames", str(tmp_path / "cell.zip"), "base", "laser", "--capture", "p04"]) == 0
    printed = capsys.readouterr().out
    assert "base_from_laser, through base_from_tool0 · tool0_from_laser" in printed
    assert re.search(r"rx ± [\d.]+°, .* tz ± [\d.]+ mm$", printed, re.MULTILINE)
    assert "Out of date: inputs have changed" in printed
    assert main(["frames", str(tmp_path / "cell.zip")]) == 0
    assert "tool0_from_laser: solved by tcp; out of date" in capsys.readouterr().out
    assert main(["frames", str(tmp_path / "cell.zip"), "base"]) == 2
