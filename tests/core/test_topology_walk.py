"""A cell of another topology as its user walks it: frames with every axis, and nothing that was solved is lost."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import calib_core as cc
from calib_core.cell.walk import Carriers
from calib_core.chain.observations import SphereObservation
from calib_core.frames import RigidTransform
from calib_core.library.opened import in_memory
from calib_core.records import Session
from calib_core.review.cell_frames import session_frames
from calib_core.stages.verify.tool import Tool
from server.cli import main


def test_frames_list_every_axis_as_it_was_found_or_is_sought() -> None:
    session = cc.simulate("rail-positioner", 1)[0].record
    sought = session_frames(session, {}).axes
    assert [(axis.name, axis.on, axis.state) for axis in sought] == [
        ("rail", "base", "sought"),
        ("tilt", "base", "sought"),
        ("turn", "tilt", "sought"),
    ]
    found = {
        "name": "rail", "in": "base", "kind": "linear", "axis_direction": [0.0, 1.0, 0.0], "axis_point_mm": None,
        "covariance": np.eye(6).tolist(),
    }  # fmt: skip
    rail, tilt, _ = session_frames(session, {"tcp": {"axes": [found], "covariance": None}}).axes
    assert (rail.state, rail.source, tilt.state) == ("solved", "tcp", "sought")
    assert rail.found is not None
    assert rail.found.axis_direction == [0.0, 1.0, 0.0]


def test_what_a_run_solved_is_kept_though_a_later_stage_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "cell"
    assert main(["simulate", "tcp", "--seed", "1", "--out", str(folder)]) == 0
    record = json.loads((folder / "session.json").read_text())
    pose = record["captures"][0]["pose"]
    (folder / "captures" / "s.xyz").write_text("0 0 200\n")
    scan = {"id": "s", "step": "scan", "kind": "cloud", "files": ["captures/s.xyz"], "pose": pose}
    record["captures"].append(scan)
    (folder / "session.json").write_text(json.dumps(record))
    assert main(["run", str(folder)]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) >= 1
    assert json.loads((folder / "results" / "tcp.json").read_text())["verdict"] == "pass"
    assert main(["frames", str(folder)]) == 0
    assert "tool0_from_laser: solved by tcp, ± " in capsys.readouterr().out


def test_an_answer_places_the_scanners_that_it_names_and_no_other() -> None:
    still = Tool(RigidTransform.identity("base", "laser"), np.eye(6))
    pose, none = RigidTransform.identity("base", "tool0"), np.zeros(3)
    center = SphereObservation("a", pose, "center", np.empty((0, 3)), none, np.eye(3), scanner="x")
    seen = {
        "base": replace(center, carriers=Carriers("base", "tool0")),
        "tool0": replace(center, carriers=Carriers("tool0", "base")),
    }
    assert still.places(seen["base"])
    assert not still.places(seen["tool0"])
    named = Tool(still.mount_from_laser, np.eye(6), others={"y": (still.mount_from_laser, np.eye(6))})
    assert not named.places(seen["base"])


def test_a_verification_tells_the_balls_of_a_plate_apart() -> None:
    simulated = cc.simulate("plate", 1)[0]
    record = simulated.record.to_json()
    for capture in record["captures"][::3]:
        capture["step"] = "verify"
    files = {name: simulated.read(name) for capture in simulated.captures for name in capture.files}
    verified = in_memory(Session.model_validate(record), files).run("verify")["verify"]
    assert verified.verdict != "fail", verified.warnings
    assert verified.held_out_scatter_rms_mm < 2 * verified.expected_scatter_rms_mm
