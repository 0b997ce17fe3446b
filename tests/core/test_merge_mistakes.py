"""A merge that is none is `fail`, the mistake is named first, and Apply repairs it."""

from collections.abc import Callable
from copy import deepcopy
from functools import cache
from typing import Any

import numpy as np
import pytest

from calib_core.causes.apply import applied, changes_for
from calib_core.records import Session
from calib_core.stages.merge.record import MergeResult
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


def one_in_metres(record: dict[str, Any], files: dict[str, bytes]) -> None:
    in_metres(record["captures"][4], files)


def in_metres(capture: dict[str, Any], files: dict[str, bytes]) -> None:
    name = capture["files"][0]
    head, body = files[name].split(b"DATA binary\n")
    files[name] = head + b"DATA binary\n" + (np.frombuffer(body, np.float32) / 1000).tobytes()


def all_in_metres(record: dict[str, Any], files: dict[str, bytes]) -> None:
    for capture in record["captures"]:
        in_metres(capture, files)
        pose = np.array(capture["pose"]).reshape(4, 4)
        pose[:3, 3] /= 1000
        capture["pose"] = pose.ravel().tolist()


def inverted(record: dict[str, Any], files: dict[str, bytes]) -> None:
    for capture in record["captures"]:
        capture["pose"] = np.linalg.inv(np.array(capture["pose"]).reshape(4, 4)).ravel().tolist()


def elsewhere(record: dict[str, Any], files: dict[str, bytes]) -> None:
    pose = np.array(record["captures"][5]["pose"]).reshape(4, 4)
    pose[:3, 3] += (300.0, -200.0, 100.0)
    record["captures"][5]["pose"] = pose.ravel().tolist()


def rubble(record: dict[str, Any], files: dict[str, bytes], seed: int = 6) -> None:
    order = np.random.default_rng(seed).permutation(len(record["captures"]))
    poses = [capture["pose"] for capture in record["captures"]]
    for capture, place in zip(record["captures"], order, strict=True):
        capture["pose"] = poses[place]


@pytest.mark.parametrize(
    ("mistake", "table", "code"),
    [
        (reverse, True, "merge-table-direction"),
        (longer_steps, True, "merge-table-steps"),
        (swap, True, "merge-swapped-scans"),
        (one_in_metres, True, "merge-scans-in-metres"),
        (swap, False, "merge-swapped-scans"),
        (all_in_metres, False, "merge-scans-in-metres"),
        (inverted, False, "merge-pose-reading"),
        (elsewhere, False, "merge-scan-elsewhere"),
    ],
)
def test_a_mistake_is_named_first_and_apply_repairs_it(mistake: Mistake, table: bool, code: str):
    record, files = deepcopy(given(table))
    mistake(record, files)
    session, result = solve(record, files)
    assert (result.verdict, result.findings[0].code) == ("fail", code)
    assert result.mesh is None
    repaired, _ = applied(session, changes_for(session, result.causes[0]))
    _, after = solve(repaired.to_json(), files)
    assert after.verdict == "pass"
    assert after.overlap_pairs >= result.overlap_pairs * (1.0 if mistake is elsewhere else 1.03)


@pytest.mark.parametrize("table", [False, True])
def test_scans_that_fit_pass_with_nothing_told(table: bool):
    _, result = solve(*given(table))
    assert (result.verdict, result.normals_outward) == ("pass", "visibility")
    assert result.overlap_rms_mm is not None
    assert result.overlap_expected_mm is not None
    assert 0.7 < result.overlap_rms_mm / result.overlap_expected_mm < 1.4


@pytest.mark.parametrize("seed", [4, 6, 7])
def test_rubble_without_a_known_mistake_fails(seed: int):
    """Once poses in another unit were named, which pile all scans up, or errors without end explained it."""
    record, files = deepcopy(given(False))
    rubble(record, files, seed)
    _, result = solve(record, files)
    assert (result.verdict, result.findings[0].code) == ("fail", "merge-scans-do-not-fit")
    assert result.mesh is None
