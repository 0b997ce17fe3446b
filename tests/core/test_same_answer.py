"""The same captures give the same answer; a simulated one stands beside its truth."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib_core.archive.folder import load_session, result_data
from calib_core.frames import RigidTransform
from calib_core.review.truth import off_the_truth
from calib_core.stages.pipeline import run
from server.cli import main

OTHER = {"OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "2", "OPENBLAS_CORETYPE": "Nehalem", "PYTHONWARNINGS": ""}


@pytest.fixture(scope="module")
def stored(solved_folder: Path) -> dict[str, Any]:
    return json.loads((solved_folder / "results" / "tcp.json").read_text(encoding="utf-8"))


@pytest.mark.thorough
def test_bit_for_bit_on_one_machine(solved_folder: Path, stored: dict[str, Any]) -> None:
    session, read = load_session(solved_folder)
    again = json.loads(json.dumps(result_data(run(session, read)["tcp"])))
    told = {name: stored[name] for name in ("solved", "provenance", "seal")}  # the file says when and by whom, too
    assert {**again, **told} == stored


@pytest.mark.thorough
def test_within_a_millionth_sigma_by_another_processors_linear_algebra(
    solved_folder: Path, stored: dict[str, Any], tmp_path: Path
) -> None:
    command = [sys.executable, "-m", "server.cli", "run", str(solved_folder), "--out", str(tmp_path), "--quiet"]
    subprocess.run(command, env={**os.environ, **OTHER}, check=True, capture_output=True, timeout=120)
    other = json.loads((tmp_path / "results" / "tcp.json").read_text(encoding="utf-8"))
    poses = [RigidTransform(np.array(one["tool0_from_laser"]), "tool0", "laser") for one in (stored, other)]
    sigmas = np.sqrt(np.diag(np.array(stored["covariance"])))
    assert np.abs(poses[0].difference(poses[1]) / sigmas).max() < 1e-6
    np.testing.assert_allclose(other["covariance"], stored["covariance"], rtol=1e-5, atol=1e-12)


@pytest.mark.thorough
def test_the_truth_stands_beside_it_in_run_and_report(
    solved_folder: Path, stored: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", str(solved_folder), "--out", str(tmp_path)]) in (0, 1)
    text = capsys.readouterr().out
    assert "Beside the truth" in text
    truth = json.loads((solved_folder / "truth.json").read_text(encoding="utf-8"))
    session, _ = load_session(solved_folder)
    (frame,) = off_the_truth(session, stored, truth)
    found, true = (
        RigidTransform.from_rounded(one["tool0_from_laser"], "tool0", "laser") for one in (stored, truth)
    )
    assert frame.shift_mm == pytest.approx(float(np.linalg.norm(found.difference(true)[3:])))
    assert f"{frame.shift_mm:.3f}" in text
    assert 0 < frame.at_workpiece_mm < 5 * frame.at_workpiece_sigma_mm

    page = tmp_path / "report.html"
    assert main(["report", str(solved_folder), "--out", str(page)]) == 0
    html = page.read_text(encoding="utf-8")
    assert "Beside the truth" in html
    assert "A simulated cell" in html
    assert "bit for bit on one machine" in html


def test_a_truth_that_is_none_is_refused_in_words(
    solved_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import shutil

    folder = shutil.copytree(solved_folder, tmp_path / "cell")
    (folder / "truth.json").write_text("[1, 2]")
    assert main(["report", str(folder), "--out", str(tmp_path / "r.html")]) == 2
    assert "truth.json" in capsys.readouterr().err
