"""Where scanners that are solved together are to each other, as `frames` tells it."""

from types import SimpleNamespace

import numpy as np
import pytest

import calib_core as cc
from calib_core.errors import ConflictError
from calib_core.frames import RigidTransform
from calib_core.library.opened import OpenSession
from calib_core.records.evidence import Frame
from calib_core.records.results import FoundFrame
from calib_core.review.cell_frames import session_frames
from calib_core.stages.topology_found import scanner_frames


def test_scanners_that_are_solved_together_are_told_to_each_other_both_ways() -> None:
    pose = RigidTransform.of([0.2, -0.1, 0.4], [30.0, -80.0, 12.0], "base", "tool0")
    frame = {
        "into": "laser:left",
        "outof": "laser:right",
        "matrix": pose.to_rows(),
        "covariance": np.eye(6).tolist(),
    }
    results = {"tcp": {"frames": [frame]}}
    session = cc.simulate("two-scanners", 1)[0].record
    there = session_frames(session, results, asked=("laser:left", "laser:right")).asked
    back = session_frames(session, results, asked=("laser:right", "laser:left")).asked
    assert there is not None
    assert back is not None
    assert np.allclose(np.array(there.matrix) @ back.matrix, np.eye(4), atol=1e-9)
    step = 1e-6 * np.array([1.0, -2.0, 0.5, 3.0, 1.0, -2.0])
    moved = pose.perturbed(step).inverse()
    told = pose.inverse().difference(moved)
    once = {**frame, "covariance": np.outer(step, step).tolist()}
    asked = session_frames(session, {"tcp": {"frames": [once]}}, asked=("laser:right", "laser:left")).asked
    assert asked is not None
    assert np.allclose(asked.covariance, np.outer(told, told), atol=1e-15)


def test_a_scanner_is_asked_for_by_its_name_in_any_frame() -> None:
    session = cc.simulate("scanners-on-flange-and-base", 1)[0].record
    names = {one.on: name for name, one in (session.cell.scanners or {}).items()}
    places = {
        on: RigidTransform.of([0.1, 0.2, 0.3], [1.0, 2.0, 3.0 + n], on, "laser") for n, on in enumerate(names)
    }
    frames = [
        {
            "into": on,
            "outof": "laser",
            "scanner": name,
            "matrix": places[on].to_rows(),
            "covariance": np.eye(6).tolist(),
        }
        for on, name in names.items()
    ]
    for on, name in names.items():
        told = session_frames(session, {"tcp": {"frames": frames}}, asked=(on, f"laser:{name}")).asked
        assert told is not None
        assert told.name == f"{on}_from_laser:{name}"
        assert np.allclose(told.matrix, places[on].to_rows(), atol=1e-12)
    both = (f"laser:{names['tool0']}", f"laser:{names['base']}")
    with pytest.raises(cc.CalibrationError, match="Ask for each of them in base"):
        session_frames(session, {"tcp": {"frames": frames}}, asked=both)


def test_a_table_beside_several_scanners_has_no_block_as_one_of_them() -> None:
    session = cc.simulate("two-scanners", 1)[0].record
    ends = [("tool0", "laser", "left"), ("tool0", "laser", "right"), ("laser:left", "laser:right", None)]
    rows, sigmas = np.eye(4).tolist(), np.eye(6).tolist()
    frames = [
        FoundFrame(into=into, outof=outof, scanner=scanner, matrix=rows, covariance=sigmas)
        for into, outof, scanner in [*ends, ("base", "turntable", None)]
    ]
    result = SimpleNamespace(frames=frames, up_to_shift=None, verdict="pass")
    told = [str(block.title) for block in scanner_frames(session, result) if isinstance(block, Frame)]
    assert told == ["Scanner left on the flange", "Scanner right on the flange", "Scanner right seen from left"]


@pytest.mark.parametrize(
    ("scenario", "names"),
    [("two-scanners-in-turn", ["left", "right"]), ("scanners-on-flange-and-base", ["arm", "gate"])],
)
def test_a_results_own_scanner_is_the_first_that_the_cell_lists_whichever_captured_first(
    scenario: str, names: list[str]
) -> None:
    simulated, _ = cc.simulate(scenario, 1)
    record = simulated.record
    for first, other in (names, names[::-1]):
        scanners = record.cell.scanners or {}
        cell = record.cell.model_copy(update={"scanners": {name: scanners[name] for name in (first, other)}})
        late = sorted(record.captures, key=lambda one: one.scanner == first)
        told = record.model_copy(update={"cell": cell, "captures": late})
        solved = OpenSession(told, simulated.read).run("tcp")["tcp"]
        result = solved.to_json()
        frame = next(one for one in result["frames"] if one["outof"] == "laser" and one["scanner"] == first)
        ball = next(one for one in result["spheres"] if one["in"] != frame["into"])
        assert result["scanner"] == first
        assert result[f"{frame['into']}_from_laser"] == frame["matrix"]
        assert result["covariance"] == frame["covariance"]
        assert result[f"sphere_center_in_{ball['in']}_mm"] == ball["center_mm"]


def test_the_only_axis_under_the_part_is_asked_for_by_its_name_or_as_the_turntable() -> None:
    session = cc.simulate("tilt", 1)[0].record
    pose = RigidTransform.of([0.2, -0.1, 0.4], [1000.0, -250.0, 450.0], "base", "turntable")
    axis = {
        "name": "tilt",
        "kind": "rotary",
        "in": "base",
        "axis_direction": [0.0, 1.0, 0.0],
        "axis_point_mm": None,
    }
    chain = {
        "base_from_turntable": pose.to_rows(),
        "turntable_covariance": np.eye(6).tolist(),
        "axes": [{**axis, "scale": 1.0, "covariance": np.eye(6).tolist(), "captures": []}],
        "frames": [{"into": "base", "outof": "turntable", "matrix": pose.to_rows(), "covariance": None}],
        "spheres": [{"in": "tilt"}],
    }
    by_name = session_frames(session, {"chain": chain}, asked=("base", "tilt")).asked
    assert by_name is not None
    assert by_name.name == "base_from_tilt"
    assert np.allclose(by_name.matrix, pose.to_rows(), atol=1e-12)
    with pytest.raises(ConflictError, match="base_from_turntable"):
        session_frames(session, {}, asked=("base", "tilt"))
