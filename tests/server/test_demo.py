"""`scancell demo`: the whole chain printed beside its truth, and left in the workbench."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from server.cli import parser
from server.commands.demo.chain import demo


def test_the_demo_prints_the_chain_beside_its_truth_and_leaves_it_in_the_workbench(
    start: Callable[..., Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert demo(parser(["demo"]).parse_args(["demo", "--data", str(tmp_path / "data")])) == 0
    printed = capsys.readouterr().out
    stages = ["tcp", "turntable", "chain", "merge"]
    assert re.findall(r"^(\S+): .* — verdict (\S+)$", printed, re.MULTILINE) == [(s, "pass") for s in stages]
    error = re.search(r"ball, diameter, mm .* (\S+)$", printed, re.MULTILINE)
    assert error is not None
    # Scans of the ball disagree by 0.1 mm RMS; 12 of them, and the post hides some of it.
    assert abs(float(error[1])) < 0.1

    with start() as client:
        (session,) = client.get("/sessions").json()["items"]
        assert session["verdicts"] == dict.fromkeys(stages, "pass")
        results = client.get(f"/sessions/{session['id']}/results").json()
        assert [result["stale"] for result in results.values()] == [False] * len(stages)
        clouds = client.get(f"/sessions/{session['id']}/clouds").json()["items"]
        assert [cloud["name"] for cloud in clouds] == ["merged.ply", "mesh.ply"]
        guide = client.get(f"/sessions/{session['id']}/guide").json()
        done = {step["step"] for step in guide["steps"] if step["status"] == "done"}
        assert {"tcp", "turntable", "merge"} <= done
