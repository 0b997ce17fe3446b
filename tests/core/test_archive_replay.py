"""Replay: bit for bit where nothing changed, and what differs, by how much and why where something did."""

import copy
import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib_core.archive.folder import load_session, result_data, to_json_bytes
from calib_core.archive.stored_results import stored_results
from calib_core.findings.reading import as_read
from calib_core.review.replay import replay
from calib_core.review.same_numbers import MAX_LISTED, TOLERANCE, compare
from calib_core.stages.pipeline import solve_stage
from server.cli import main


@pytest.fixture
def stored(solved_folder: Path) -> dict[str, Any]:
    return stored_results(solved_folder)


def test_an_untouched_session_comes_out_bit_for_bit(solved_folder: Path, stored: dict[str, Any]) -> None:
    found = replay(*load_session(solved_folder), stored)
    (stage,) = found.stages
    assert found.equal
    assert (stage.stage, stage.equal, stage.largest_relative, stage.difference_count) == ("tcp", True, 0.0, 0)
    about = ("evidence", "findings", "method_revision", "said", "seal")
    assert stage.numbers == count_numbers({k: v for k, v in stored["tcp"].items() if k not in about})
    assert found.tolerance == TOLERANCE == 1e-6


@pytest.mark.thorough
def test_how_a_result_can_be_said_is_the_same_whatever_was_said_before(
    solved_folder: Path, stored: dict[str, Any]
) -> None:
    session, read = load_session(solved_folder)
    first = result_data(solve_stage(session, "tcp", read))
    assert first["said"]
    as_read(first, "de")
    assert result_data(solve_stage(session, "tcp", read)) == first
    assert compare({**stored["tcp"], "said": []}, first).equal  # and another version's is no difference


def count_numbers(data: Any) -> int:
    if isinstance(data, dict):
        return sum(map(count_numbers, data.values()))
    if isinstance(data, list):
        return sum(map(count_numbers, data))
    return isinstance(data, int | float) and not isinstance(data, bool)


def altered(stored: dict[str, Any], path: str, factor: float) -> dict[str, Any]:
    data: Any = copy.deepcopy(stored["tcp"])
    place, *keys = path.split(".")
    target, names = data, [place, *keys]
    for name in names[:-1]:
        target = target[int(name) if isinstance(target, list) else name]
    last: Any = int(names[-1]) if isinstance(target, list) else names[-1]
    target[last] *= factor
    return data


@pytest.mark.parametrize(
    ("path", "equal", "other"),
    [
        ("covariance.0.0", 1e-5, 2e-3),
        ("two_step.covariance.2.2", 1e-5, 2e-3),
        ("surface_rms_mm", 5e-5, 1e-2),
        ("residuals.4.surface_rms_mm", 5e-5, 1e-2),
        ("residuals.4.mahalanobis", 5e-5, 2e-4),
        ("residuals.4.zone", 5e-7, 2e-6),
    ],
)
def test_every_number_counts_from_the_stated_tolerance_on(
    stored: dict[str, Any], path: str, equal: float, other: float
) -> None:
    """Another processor's arithmetic moves a covariance by 1e-5, and that is no forgery."""
    assert compare(altered(stored, path, 1 + equal), stored["tcp"]).equal
    found = compare(altered(stored, path, 1 + other), stored["tcp"])
    assert not found.equal
    (difference,) = found.differences
    assert difference.relative == pytest.approx(other, rel=1e-2)
    assert found.largest_relative == difference.relative
    named = re.sub(r"\[(p\d\d|\d)\]", lambda found: "." + found[1], difference.path)
    assert named == path.replace("residuals.4", "residuals.p05")


def moved(stored: dict[str, Any], axis: int, sigmas: float) -> dict[str, Any]:
    """The stored result with its tool shifted along the flange's axes, or turned about its own."""
    tool = np.array(stored["tcp"]["tool0_from_laser"])
    by = sigmas * np.sqrt(stored["tcp"]["covariance"][axis][axis])
    if axis < 3:
        tool[:3, :3] @= Rotation.from_rotvec(by * np.eye(3)[axis]).as_matrix()
    else:
        tool[axis - 3, 3] += by
    return {**stored["tcp"], "tool0_from_laser": tool.tolist()}


@pytest.mark.parametrize("axis", range(6))
def test_a_frame_counts_by_its_stated_sigmas(stored: dict[str, Any], axis: int) -> None:
    """Another processor's arithmetic moves it by some 1e-7 of them."""
    assert compare(moved(stored, axis, 9e-4), stored["tcp"]).equal
    found = compare(moved(stored, axis, 0.05), stored["tcp"])
    assert not found.equal
    assert {d.path.partition("[")[0] for d in found.differences} == {"tool0_from_laser"}


def test_what_camera_and_plane_do_to_the_tool_counts_by_the_tools_sigmas(stored: dict[str, Any]) -> None:
    sigma = np.sqrt(np.diag(stored["tcp"]["covariance"]))
    shifts: list[dict[str, Any]] = [{"source": "camera", "tool": [1e-9, 0, 0, 0, 0, 1e-7], "by_place": [[1e-9]]}]
    before = {**stored["tcp"], "optics": shifts}
    for axis, sigmas, equal in ((0, 5e-4, True), (0, 1e-2, False), (5, 5e-4, True), (5, 1e-2, False)):
        after = copy.deepcopy(before)
        after["optics"][0]["tool"][axis] += sigmas * min(sigma[:3] if axis < 3 else sigma[3:])
        assert compare(before, after).equal is equal


def test_what_is_no_frame_any_more_differs(stored: dict[str, Any]) -> None:
    assert not compare({**stored["tcp"], "tool0_from_laser": np.zeros((4, 4)).tolist()}, stored["tcp"]).equal


def test_what_is_known_exactly_has_rounding_for_a_sigma() -> None:
    """A ball's height that defines the frame: its variance comes out as another nothing on each processor."""

    def result(exact: float, beside: float) -> dict[str, Any]:
        return {"stage": "x", "covariance": [[4e-4, 0.0, beside], [0.0, 4e-4, 0.0], [beside, 0.0, exact]]}

    assert compare(result(1e-22, -4e-15), result(5e-23, -5e-14)).equal
    assert not compare(result(1e-8, -4e-15), result(2e-8, -5e-14)).equal
    assert not compare(result(1e-22, 0.0), result(1e-12, 0.0)).equal


def test_an_element_of_a_covariance_counts_by_the_sigmas_of_its_row_and_column() -> None:
    """It was "not equal" for 4e-9 between two processors; variances in rad² are 1e-5 of those in mm²."""

    def result(turned: float, both: float) -> dict[str, Any]:
        return {"stage": "x", "covariance": [[turned, both], [both, 1.0]]}

    assert compare(result(1e-8, 0.0), result(1e-8 * (1 + 4e-9), 9e-14)).equal
    assert compare(result(1e-8, 0.0), result(1e-8 * (1 + 1e-5), 0.0)).equal
    assert not compare(result(1e-8, 0.0), result(1e-8, 2e-7)).equal
    assert not compare(result(1e-8, 0.0), result(1.01e-8, 0.0)).equal
    assert not compare(result(1e-8, 0.0), {"stage": "x", "covariance": [[1e-8]]}).equal


def test_a_zero_of_a_matrix_may_be_rounded_and_no_more() -> None:
    def matrix(zero: float) -> dict[str, Any]:
        return {"stage": "x", "m": [[1.0, zero], [0.0, 250.0]]}

    assert compare(matrix(0.0), matrix(2e-7)).equal
    assert not compare(matrix(0.0), matrix(3e-7)).equal
    assert not compare({"stage": "x", "a": 0.0}, {"stage": "x", "a": 1e-15}).equal


@pytest.mark.parametrize(
    ("stored", "fresh", "path"),
    [
        ({"a": [1.0, 2.0]}, {"a": [1.0]}, "a[1]"),
        ({"a": 1.0}, {"a": "1.0"}, "a"),
        ({"a": True}, {"a": 1}, "a"),
        ({"a": 1.0}, {"a": None}, "a"),
        ({"a": {"b": "x"}}, {"a": {"b": "y"}}, "a.b"),
        ({"a": [1.0]}, {"a": {"b": 1.0}}, "a"),
        ({"a": []}, {"a": [{"capture": "p01"}]}, "a[0]"),
    ],
)
def test_what_is_no_number_must_be_the_same(stored: dict[str, Any], fresh: dict[str, Any], path: str) -> None:
    found = compare(stored, fresh)
    assert [d.path for d in found.differences] == [path]
    assert found.differences[0].relative is None


def test_a_field_that_only_one_version_writes_is_no_difference() -> None:
    for value in (None, 1.0, [{"b": 2}]):
        assert compare({"a": value}, {}).equal
        assert compare({}, {"a": value}).equal


def test_the_worst_of_many_differences_are_listed() -> None:
    found = compare({"a": [float(k + 1) for k in range(500)]}, {"a": [k + 1.5 for k in range(500)]})
    assert found.difference_count == 500
    assert len(found.differences) == MAX_LISTED
    assert found.differences[0].path == "a[0]"
    assert found.largest_relative == found.differences[0].relative == pytest.approx(0.5 / 1.5)


def why(folder: Path, stored: dict[str, Any]) -> str:
    found = replay(*load_session(folder), stored)
    assert not found.equal
    return " ".join(found.stages[0].why)


@pytest.mark.thorough
def test_reasons_from_the_records(solved_folder: Path, stored: dict[str, Any], tmp_path: Path) -> None:
    wrong = {"tcp": altered(stored, "surface_rms_mm", 1.5)}
    assert "altered" in why(solved_folder, wrong)
    wrong["tcp"]["software"] = "scancell 0.0.1"
    assert "computed by scancell 0.0.1; this is scancell" in why(solved_folder, wrong)
    wrong["tcp"]["method"] = "guessing"
    assert "'guessing'" in why(solved_folder, wrong)
    folder = tmp_path / "s"
    shutil.copytree(solved_folder, folder)
    scan = folder / "captures" / "p02.csv"
    scan.write_text("\n".join(scan.read_text().splitlines()[::2]))
    assert "the hashes of the inputs differ" in why(folder, stored)
    (folder / "captures" / "p02.csv").unlink()
    assert "cannot be solved any more" in why(folder, stored)


def test_the_same_numbers_by_other_software_are_equal(solved_folder: Path, stored: dict[str, Any]) -> None:
    other = {"tcp": {**stored["tcp"], "software": "scancell 0.0.1"}}
    assert replay(*load_session(solved_folder), other).equal


def test_a_stage_of_another_version_is_said_not_to_be_solvable(solved_folder: Path) -> None:
    stored = {"merge": {"stage": "merge", "software": "scancell 9", "method": "m", "inputs_sha256": "0"}}
    assert "cannot be solved any more" in why(solved_folder, stored)


@pytest.mark.thorough
def test_the_command(
    solved_folder: Path, stored: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "s"
    shutil.copytree(solved_folder, folder)
    wrong = altered(stored, "sphere_center_in_base_mm.0", 1 + 1e-4)
    (folder / "results" / "tcp.json").write_bytes(to_json_bytes(wrong))
    assert main(["archive", "pack", str(folder), "--out", str(tmp_path / "a.zip"), "--no-scene"]) == 0
    capsys.readouterr()
    assert main(["archive", "replay", str(tmp_path / "a.zip"), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["equal"] is False
    assert [d["path"] for d in found["stages"][0]["differences"]] == ["sphere_center_in_base_mm[0]"]
    assert main(["archive", "replay", str(tmp_path / "a.zip")]) == 1
    out = capsys.readouterr().out
    assert "tcp: DIFFERS in 1 values" in out
    assert "altered" in out
