"""A merge that is none is `fail`, the mistake is named first, and Apply repairs it."""

from collections.abc import Callable
from copy import deepcopy
from functools import cache
from typing import Any

import numpy as np
import pytest

from calib_core.causes.apply import applied, changes_for
from calib_core.errors import InputError
from calib_core.records import Session
from calib_core.stages.evidence import text_of
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.merge.trials import same_arrangement
from calib_core.stages.pipeline import run
from tests.merge_sets import merge_session, scan_set

Mistake = Callable[[dict[str, Any], dict[str, bytes]], None]


@cache
def given(table: bool) -> tuple[dict[str, Any], dict[str, bytes]]:
    there = scan_set("bracket", 2, count=15 if table else 18, views="table" if table else "around")
    return merge_session(there, table)


def solve(record: dict[str, Any], files: dict[str, bytes]) -> tuple[Session, MergeResult]:
    session = Session.model_validate(record)
    result = run(session, files.__getitem__, "merge")["merge"]
    assert isinstance(result, MergeResult)
    return session, result


def reverse(record: dict[str, Any], files: dict[str, bytes]) -> None:
    record["cell"]["turntable"] = {"direction": -1}


def longer_steps(record: dict[str, Any], files: dict[str, bytes]) -> None:
    for capture in record["captures"]:
        capture["table_deg"] *= 1.05


def swap(record: dict[str, Any], files: dict[str, bytes]) -> None:
    one, other = record["captures"][3], record["captures"][8]
    one["files"], other["files"] = other["files"], one["files"]


def inverted_of_clouds(record: dict[str, Any], files: dict[str, bytes]) -> None:
    """Poses that say where the base is, of clouds without a grid: rubble tells no outside."""
    for capture in record["captures"]:
        name = capture["files"][0]
        points = np.frombuffer(files[name].split(b"DATA binary\n")[1], np.float32).reshape(-1, 3)
        rows = points[np.isfinite(points).all(axis=1)]
        capture["files"] = [f"{name}.xyz"]
        files[f"{name}.xyz"] = "\n".join(f"{x:.4f} {y:.4f} {z:.4f}" for x, y, z in rows.tolist()).encode()
        capture["pose"] = np.linalg.inv(np.array(capture["pose"]).reshape(4, 4)).ravel().tolist()


def one_in_metres(record: dict[str, Any], files: dict[str, bytes]) -> None:
    in_metres(record["captures"][4], files)


def times(record: dict[str, Any], files: dict[str, bytes], factor: float) -> None:
    """Make the object larger, and so the distances of the points."""
    for capture in record["captures"]:
        name = capture["files"][0]
        head, body = files[name].split(b"DATA binary\n")
        files[name] = head + b"DATA binary\n" + (factor * np.frombuffer(body, np.float32)).tobytes()
        pose = np.array(capture["pose"]).reshape(4, 4)
        pose[:3, 3] *= factor
        capture["pose"] = pose.ravel().tolist()


def in_metres(capture: dict[str, Any], files: dict[str, bytes]) -> None:
    times({"captures": [capture | {"pose": np.eye(4).ravel().tolist()}]}, files, 1e-3)


def mirrored(record: dict[str, Any], files: dict[str, bytes]) -> None:
    """Let y of the clouds count the other way, as a program with a left-handed frame does."""
    for capture in record["captures"]:
        head, body = files[capture["files"][0]].split(b"DATA binary\n")
        points = np.frombuffer(body, np.float32).reshape(-1, 3) * np.array([1, -1, 1], np.float32)
        files[capture["files"][0]] = head + b"DATA binary\n" + points.tobytes()


def all_in_metres(record: dict[str, Any], files: dict[str, bytes]) -> None:
    times(record, files, 1e-3)


def inverted(record: dict[str, Any], files: dict[str, bytes]) -> None:
    for capture in record["captures"]:
        capture["pose"] = np.linalg.inv(np.array(capture["pose"]).reshape(4, 4)).ravel().tolist()


def elsewhere(record: dict[str, Any], files: dict[str, bytes]) -> None:
    pose = np.array(record["captures"][5]["pose"]).reshape(4, 4)
    pose[:3, 3] += (300.0, -200.0, 100.0)
    record["captures"][5]["pose"] = pose.ravel().tolist()


def astray(record: dict[str, Any], files: dict[str, bytes]) -> None:
    """Move a scan so little that some of its surfaces meet others by chance: once that passed."""
    pose = np.array(record["captures"][5]["pose"]).reshape(4, 4)
    pose[:3, 3] += (8.0, -5.0, 6.0)
    record["captures"][5]["pose"] = pose.ravel().tolist()


def rubble(record: dict[str, Any], files: dict[str, bytes], seed: int = 6) -> None:
    order = np.random.default_rng(seed).permutation(len(record["captures"]))
    poses = [capture["pose"] for capture in record["captures"]]
    for capture, place in zip(record["captures"], order, strict=True):
        capture["pose"] = poses[place]


@pytest.mark.thorough(keep=2)
@pytest.mark.parametrize(
    ("mistake", "table", "code"),
    [
        (reverse, True, "merge-table-direction"),
        (longer_steps, True, "merge-table-steps"),
        (swap, True, "merge-swapped-scans"),
        (one_in_metres, True, "merge-scans-in-metres"),
        (inverted_of_clouds, False, "merge-pose-reading"),
        (swap, False, "merge-swapped-scans"),
        (all_in_metres, False, "merge-scans-in-metres"),
        (inverted, False, "merge-pose-reading"),
        (elsewhere, False, "merge-scan-elsewhere"),
        (astray, False, "merge-scan-elsewhere"),
        (mirrored, False, "points-mirrored"),
    ],
)
def test_a_mistake_is_named_first_and_apply_repairs_it(mistake: Mistake, table: bool, code: str):
    record, files = deepcopy(given(table))
    mistake(record, files)
    session, result = solve(record, files)
    assert (result.verdict, result.findings[0].code) == ("fail", code)
    assert result.mesh is None
    assert mistake is not inverted or "their poses are inverted" in result.findings[0].text
    repaired, _ = applied(session, changes_for(session, result.causes[0]))
    _, after = solve(repaired.to_json(), files)
    assert after.verdict == "pass"
    least = {elsewhere: 1.0, astray: 0.9}.get(mistake, 1.03)
    assert after.overlap_pairs >= result.overlap_pairs * least


@pytest.mark.parametrize("table", [False, True])
def test_scans_that_fit_pass_with_nothing_told(table: bool):
    _, result = solve(*given(table))
    assert (result.verdict, result.normals_outward) == ("pass", "visibility")
    assert "±" in text_of(result)
    assert result.overlap_rms_mm is not None
    assert result.overlap_expected_mm is not None
    assert 0.7 < result.overlap_rms_mm / result.overlap_expected_mm < 1.4


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("seed", [4, 6, 7])
def test_rubble_without_a_known_mistake_fails(seed: int):
    """Once poses in another unit were named, which pile all scans up, or errors without end explained it."""
    record, files = deepcopy(given(False))
    rubble(record, files, seed)
    _, result = solve(record, files)
    assert (result.verdict, result.findings[0].code) == ("fail", "merge-scans-do-not-fit")
    assert result.mesh is None
    assert "±" not in text_of(result)  # nothing that such a merge says of its own uncertainty holds


def test_poses_that_lie_elsewhere_all_together_are_one_arrangement():
    """Once two readings that differ by that alone hid each other, and inverted poses were not named."""
    ways = np.array([capture["pose"] for capture in given(False)[0]["captures"]]).reshape(-1, 4, 4)
    together = np.eye(4)
    together[:3, 3] = (900.0, -20.0, 3.0)
    assert same_arrangement(together @ ways, ways, 1.5)
    ways_apart = ways.copy()
    ways_apart[3, :3, 3] += 1.0
    assert not same_arrangement(ways_apart, ways, 1.5)


@pytest.mark.parametrize("table", [False, True])
def test_coarse_scans_of_a_large_object_fit_with_nothing_told(table: bool):
    """Once voxels of half a millimetre held no two points of them, and nothing was said but that none overlap."""
    record, files = deepcopy(given(table))
    times(record, files, 5.0)
    del record["cell"]["merge"]["voxel_mm"]
    _, result = solve(record, files)
    assert (result.verdict, result.normals_outward) == ("pass", "visibility")
    assert 2.5 <= result.voxel_mm <= 5.0
    assert result.overlap_rms_mm is not None
    assert result.overlap_expected_mm is not None
    assert 0.7 < result.overlap_rms_mm / result.overlap_expected_mm < 1.4
    record["cell"]["merge"]["voxel_mm"] = 0.5
    _, fine = solve(record, files)
    assert (fine.verdict, fine.voxel_mm) == ("pass", 0.5)
    assert fine.overlap_pairs > 0.5 * result.overlap_pairs


def test_scans_of_an_unknown_scanner_alone_are_refused_in_a_sentence():
    record, files = deepcopy(given(False))
    record["cell"]["scanners"] = {"left": {}}
    for capture in record["captures"]:
        capture["scanner"] = "right"
    with pytest.raises(InputError, match="need at least one scan, got none"):
        solve(record, files)
