"""`scancell demo`: the whole chain printed beside its truth, and left in the workbench."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from calib_core.simulation import simulate
from server.cli import parser
from server.commands.demo import parts
from server.commands.demo.chain import demo
from server.commands.serve import serve


@pytest.mark.thorough
def test_the_demo_prints_the_chain_beside_its_truth_and_leaves_it_in_the_workbench(
    start: Callable[..., Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert demo(parser(["demo"]).parse_args(["demo", "--data", str(tmp_path / "data")])) == 0
    printed = capsys.readouterr().out
    stages = ["tcp", "turntable", "chain", "merge"]
    assert re.findall(r"^(\S+): (\S+)  \(.*\)$", printed, re.MULTILINE) == [(s, "PASS") for s in stages]
    error = re.search(r"ball, diameter, mm .* (\S+)$", printed, re.MULTILINE)
    assert error is not None
    # Scans of the ball disagree by 0.1 mm RMS; 12 of them, and the post hides some of it.
    assert abs(float(error[1])) < 0.1
    assert "two-step" in printed
    tool_x = next(line for line in printed.splitlines() if line.strip().startswith("x, mm"))
    found, _, rest = tool_x.split("mm", 1)[1].partition("±")
    _, truth, off = rest.split()
    true_mm = simulate("turntable", 1).truth["tool0_from_laser"][0][3]
    assert float(truth) == pytest.approx(true_mm, abs=6e-4)
    assert float(off) == pytest.approx(float(found) - true_mm, abs=6e-3)

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


def test_it_serves_afterwards_unless_told_not_to() -> None:
    assert parts(parser(["demo"]).parse_args(["demo"])) == (demo, serve)
    assert parts(parser(["demo"]).parse_args(["demo", "--no-serve"])) == (demo,)
