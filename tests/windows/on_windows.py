"""The command line on a Windows Python: `make test-windows WINDOWS_PYTHON=FOLDER`; no part of `make test`.

What works under Wine shows much of what is Windows' own, and proves nothing of a real one.
"""

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.server.live_server import simulated_session
from tests.windows.windows_python import LONGEST_S, ROOT, Figure, outside, ran, serving


def sigmas_apart(left: Mapping[str, Any], right: Mapping[str, Any], frame: str) -> float:
    a, b = (np.array(one[frame]) for one in (left, right))
    sigma = np.sqrt(np.diag(np.array(right["covariance"])))
    turned = a[:3, :3].T @ b[:3, :3]
    turn = np.array([turned[2, 1], turned[0, 2], turned[1, 0]])
    moved = a[:3, :3].T @ (b[:3, 3] - a[:3, 3])
    return float(np.max(np.abs(np.concatenate([turn, moved])) / np.maximum(sigma, 1e-12)))


@pytest.mark.parametrize(
    ("scenario", "stage", "frame"),
    [("tcp", "tcp", "tool0_from_laser"), ("turntable", "chain", "tool0_from_laser")],
)
def test_a_run_with_redirected_output_gives_what_linux_gives(
    program: list[str], place: Path, scenario: str, stage: str, frame: str, figure: Figure
) -> None:
    from calib_core.archive.folder import load_session, result_data
    from calib_core.stages.pipeline import run

    ran(program, place, "simulate", scenario, "--seed", "3", "--out", scenario)
    found = json.loads(ran(program, place, "run", scenario, "--json"))["results"]
    text = ran(program, place, "run", scenario).decode("utf-8")
    assert "±" in text
    ours = {name: result_data(result) for name, result in run(*load_session(place / scenario)).items()}
    assert {name: result["verdict"] for name, result in found.items()} == {
        n: r["verdict"] for n, r in ours.items()
    }
    apart = sigmas_apart(found[stage], ours[stage], frame)
    assert apart < 1e-3
    figure(
        f"`scancell run` of {scenario}, output redirected: {stage} beside Linux's", "≤ 10⁻³ σ", f"{apart:.1e} σ"
    )
    stored = json.loads((place / scenario / "results" / f"{stage}.json").read_text("utf-8"))
    assert stored[frame] == found[stage][frame]


def test_an_archive_of_linux_is_replayed_there_and_one_of_windows_here(
    program: list[str], place: Path, figure: Figure
) -> None:
    command = [sys.executable, "-m", "server.cli"]
    for name in ("linux", "windows"):
        shutil.copytree(place / "turntable", place / name)
        shutil.rmtree(place / name / "results")
    subprocess.run([*command, "run", str(place / "linux")], cwd=ROOT, capture_output=True, check=True)
    ran(program, place, "run", "windows")
    subprocess.run(
        [*command, "archive", "pack", str(place / "linux"), "--no-scene", "--out", str(place / "linux.zip")],
        cwd=ROOT, capture_output=True, check=True,
    )  # fmt: skip
    ran(program, place, "archive", "pack", "windows", "--out", "windows.zip")
    assert json.loads(ran(program, place, "archive", "replay", "linux.zip", "--json"))["equal"]
    ran(program, place, "archive", "unpack", "linux.zip", "--out", "unpacked")
    done = subprocess.run(
        [*command, "archive", "replay", str(place / "windows.zip"), "--json"],
        cwd=ROOT,
        capture_output=True,
        check=True,
    )
    assert json.loads(done.stdout)["equal"]
    figure("an archive of a turntable session packed on Linux replayed there, and back", "equal", "equal, both")


def test_what_a_killed_server_stored_is_there_again(program: list[str], place: Path, figure: Figure) -> None:
    with serving(program, place, "killed") as client:
        session = simulated_session(client, captures=5)
    time.sleep(1)
    with serving(program, place, "killed") as client:
        assert len(client.get(f"/sessions/{session}/captures").json()["items"]) == 5
    said = ran(program, place, "doctor", "--data", "killed").decode("utf-8")
    assert "nothing is damaged" in said
    ran(program, place, "backup", "--data", "killed", "--out", "backup")
    ran(program, place, "restore", "backup", "--data", "restored")
    figure("a server killed and started again: 5 captures, doctor, backup, restore", "all there", "all there")


def test_a_second_server_is_told_that_folder_and_port_are_taken(
    program: list[str], place: Path, figure: Figure
) -> None:
    with serving(program, place, "taken") as client:
        port = str(client.base_url.port)
        for words in (["--port", port, "--data", "other"], ["--port", "0", "--data", "taken"]):
            command = [*program, "serve", *words]
            done = subprocess.run(
                command, cwd=place, env=outside(), capture_output=True, check=False, timeout=LONGEST_S
            )
            assert done.returncode == 2
            assert b"scancell: error:" in done.stderr
    figure("a second server for the same port or folder", "told, status 2", "told, both")


def test_the_demo_runs_with_camera_table_and_merge(program: list[str], place: Path, figure: Figure) -> None:
    told = ran(program, place, "demo", "--no-serve", "--data", "demo").decode("utf-8")
    assert "merge" in told
    figure("`scancell demo --no-serve`: every stage beside its truth", "done, status 0", "done")
