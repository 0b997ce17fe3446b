"""Root causes: wrong readings and orders of poses are named first, and Apply repairs them."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from bench_order import wrong_order
from hypothesis import given
from hypothesis import strategies as st
from wrong_poses import Measured, reordered, repaired, rewritten, shifted, swapped, writer

from calib_core.archive.folder import load_session, save_session
from calib_core.captures.content import sphere_of
from calib_core.captures.observe import observe_capture
from calib_core.causes.apply import applied, cause_named, changes_for, merge_patch, patch_back
from calib_core.causes.poses import pose_causes
from calib_core.causes.session import session_causes
from calib_core.errors import InputError, MeasurementError
from calib_core.findings import causes_of
from calib_core.frames import RigidTransform
from calib_core.records import RootCause, Session
from calib_core.robots import to_pose
from calib_core.simulation import SimulatedSession, simulate
from calib_core.stages.pipeline import run
from calib_core.stages.tcp.verdict import incident_finding
from server.cli import main
from server.http.errors import problem
from tests.trouble import all_troubles, troubled
from tests.trouble.cell import Scanners


@pytest.fixture(scope="module")
def simulated() -> SimulatedSession:
    return simulate("tcp", 11)


@pytest.fixture(scope="module")
def cell(simulated: SimulatedSession) -> Measured:
    session = simulated.session
    observations = [observe_capture(session, c, simulated.files.__getitem__) for c in session.captures]
    return Measured(session, observations, sphere_of(session.cell, session.captures))


def causes_found(cell: Measured, session: Session) -> list[RootCause]:
    return causes_of(pose_causes(session.cell, session.captures, cell.observations, cell.sphere))


def in_radians(pose: RigidTransform) -> list[float]:
    numbers = to_pose("kuka", pose)
    return [*numbers[:3], *np.deg2rad(numbers[3:]).tolist()]


def by_columns(pose: RigidTransform) -> list[float]:
    return pose.matrix.T.ravel().tolist()


READINGS = {
    "another order of angles": ("fanuc", writer("kuka", 1.0, False), "written as 'kuka' or 'nachi'"),
    "another order of a quaternion": ("quaternion-xyzw", writer("abb", 1.0, False), "'quaternion-wxyz' or 'abb'"),
    "another form in metres, inverted": (
        "staubli",
        writer("kawasaki", 1000.0, True),
        "'kawasaki', in metres, inv",
    ),
    "centimetres": ("fanuc", writer("fanuc", 10.0, False), "in centimetres"),
    "radians": ("kuka", in_radians, "angles in radians"),
    "matrices by columns": ("matrix", by_columns, "column by column"),
}


@pytest.mark.parametrize("name", READINGS)
def test_a_wrong_reading_is_named_first_and_apply_repairs_it(cell: Measured, name: str) -> None:
    told, write, said = READINGS[name]
    session = rewritten(cell.session, told, write)
    causes = causes_found(cell, session)
    assert causes[0].kind == "pose-reading"
    assert said in causes[0].title
    mended, undo = applied(session, changes_for(session, causes[0]))
    assert repaired(mended, cell.poses)
    assert applied(mended, undo)[0].to_json() == session.to_json()


@pytest.mark.parametrize(("draw", "kind"), [(swapped, "swapped-poses"), (shifted, "shifted-poses")])
def test_poses_of_other_captures_are_named_and_handed_back(cell: Measured, draw: object, kind: str) -> None:
    assert callable(draw)
    places = draw(len(cell.observations), np.random.default_rng(5))
    session = reordered(cell.session, places)
    cause = causes_found(cell, session)[0]
    assert cause.kind == kind
    assert set(cause.captures) == {c.id for k, c in enumerate(session.captures) if places[k] != k}
    mended, _ = applied(session, changes_for(session, cause))
    assert repaired(mended, cell.poses)
    before, after = cause.evidence[0].before, cause.evidence[0].after
    assert before is not None
    assert after is not None
    assert after < before / 3


@pytest.mark.parametrize("kind", ["names", "reversed", "rotated", "mixed", "captures by names"])
def test_a_whole_list_in_a_wrong_order_is_named_first_and_handed_out_anew(cell: Measured, kind: str) -> None:
    places = np.array(wrong_order(kind, len(cell.observations), 2))
    session = reordered(cell.session, places)
    cause = causes_found(cell, session)[0]
    assert cause.kind == "pose-list-order"
    mended, _ = applied(session, changes_for(session, cause))
    assert repaired(mended, cell.poses)


@pytest.mark.thorough(keep=2)
@pytest.mark.parametrize("scanners", ["fixed", "two", "both"])
def test_poses_before_other_scanners_are_doubted_where_they_are_wrong_alone(scanners: Scanners) -> None:
    made = troubled(all_troubles()["arms: clean"], 1, scanners=scanners)
    session = made.session
    observations = [observe_capture(session, c, made.files.__getitem__) for c in session.captures]
    cell = Measured(session, observations, sphere_of(session.cell, session.captures))
    assert causes_found(cell, session) == []
    for told, written, inverse in (("fanuc", "kuka", False), ("abb", "abb", True)):
        wrong = rewritten(session, told, writer(written, 1.0, inverse))
        cause = causes_found(cell, wrong)[0]
        assert cause.kind == "pose-reading"
        assert ("inverted" if inverse else "'kuka'") in cause.title
        mended, _ = applied(wrong, changes_for(wrong, cause))
        assert repaired(mended, cell.poses)


@cache
def several_scanners(scenario: str) -> Measured:
    """Return a cell whose scanners take captures by turns, each with a pose of its own."""
    made = simulate(scenario, 4)
    each = {
        name: [c for c in made.session.captures if c.scanner == name] for name in made.session.cell.scanners or {}
    }
    turns = [capture for turn in zip(*each.values(), strict=True) for capture in turn]
    session = made.session.model_copy(update={"captures": turns})
    observations = [observe_capture(session, c, made.files.__getitem__) for c in turns]
    return Measured(session, observations, sphere_of(session.cell, turns))


@pytest.mark.parametrize(("scenario", "step"), [("two-scanners-in-turn", 1), ("scanners-on-flange-and-base", -1)])
def test_poses_shifted_across_the_captures_of_several_scanners_are_named_and_handed_out_anew(
    scenario: str, step: int
) -> None:
    cell = several_scanners(scenario)
    count = len(cell.session.captures)
    wrong = reordered(cell.session, [(k + step) % count for k in range(count)])
    cause, *others = causes_found(cell, wrong)
    assert not others
    assert cause.kind == "pose-list-order"
    assert cause.captures == [c.id for c in wrong.captures]
    mended, _ = applied(wrong, changes_for(wrong, cause))
    assert repaired(mended, cell.poses)


def test_poses_shifted_from_a_capture_on_are_named_for_all_scanners() -> None:
    cell = several_scanners("scanners-on-flange-and-base")
    count, first = len(cell.session.captures), len(cell.session.captures) // 2 + 3
    run = [*range(first, count)]
    wrong = reordered(cell.session, [*range(first), *run[1:], run[0]])
    cause = causes_found(cell, wrong)[0]
    assert cause.kind == "shifted-poses"
    mended, _ = applied(wrong, changes_for(wrong, cause))
    assert sum(c.excluded for c in mended.captures) <= 1
    ends = {*range(first - 1, first + 1), count - 1}  # where only the other scanner's captures could tell
    middle = [k for k in range(count) if k not in ends]
    some = mended.model_copy(update={"captures": [mended.captures[k] for k in middle]})
    assert repaired(some, [cell.poses[k] for k in middle])


def test_right_poses_are_not_doubted(cell: Measured) -> None:
    assert causes_found(cell, cell.session) == []
    assert causes_found(cell, rewritten(cell.session, "ur", writer("ur", 1000.0, False))) == []


def test_the_stage_fails_says_it_first_and_is_right_once_it_is_applied(
    simulated: SimulatedSession, cell: Measured
) -> None:
    session = rewritten(cell.session, "staubli", writer("fanuc", 1.0, False))
    result = run(session, simulated.files.__getitem__, "tcp")["tcp"]
    assert result.verdict == "fail"
    assert "written as 'fanuc'" in result.warnings[0]
    assert result.causes[0].sentence == result.warnings[0]
    mended, _ = applied(session, changes_for(session, result.causes[0]))
    again = run(mended, simulated.files.__getitem__, "tcp")["tcp"]
    assert again.verdict == "pass"
    assert again.causes == []


def test_rewriting_reaches_the_captures_of_other_stages(cell: Measured) -> None:
    record = rewritten(cell.session, "fanuc", writer("kuka", 1000.0, False)).to_json()
    record["captures"].append({**record["captures"][0], "id": "s1", "step": "scan"})
    session = Session.model_validate(record)
    tcp_alone = session.model_copy(update={"captures": session.captures[:-1]})
    cause = causes_found(cell, tcp_alone)[0]
    assert cause.changes is not None
    assert "s1" not in cause.changes.captures
    assert changes_for(session, cause).captures["s1"] == cause.changes.captures[session.captures[0].id]


@pytest.mark.thorough
def test_files_in_metres_and_a_radius_for_the_diameter_are_named_where_nothing_can_be_solved() -> None:
    metres = simulate("tcp-metres", 3)
    cause = session_causes(metres.session, metres.files.__getitem__, {})[0]
    assert cause.id == "point-unit-m"
    assert cause.changes is not None
    mended, _ = applied(metres.session, cause.changes)
    assert run(mended, metres.files.__getitem__, "tcp")["tcp"].verdict == "pass"

    small = simulate("tcp", 3)
    for wrong_mm in (20.0, 0.04):  # its radius; metres, by which the files may as well be micrometres
        told = small.session.cell.model_copy(update={"sphere_diameter_mm": wrong_mm})
        session = small.session.model_copy(update={"cell": told})
        causes = session_causes(session, small.files.__getitem__, {})
        assert causes[0].changes is not None
        assert causes[0].changes.cell == {"sphere_diameter_mm": 40.0}
        assert not any(cause.kind == "point-unit" for cause in causes)


def test_a_refusal_says_as_a_finding_what_is_at_fault() -> None:
    metres = simulate("tcp-metres", 3)
    with pytest.raises(MeasurementError) as refused:
        run(metres.session, metres.files.__getitem__, "tcp")
    first = problem(refused.value.at("cell 4"))["findings"][0]
    assert (first["code"], first["severity"], first["remedy"]["id"]) == ("point-unit", "error", "point-unit-m")


def test_a_cause_is_named_by_its_id_kind_or_place(cell: Measured) -> None:
    causes = causes_found(cell, reordered(cell.session, swapped(14, np.random.default_rng(5))))
    for name in (causes[0].id, "swapped-poses", "1"):
        assert cause_named(causes, name) is causes[0]
    with pytest.raises(InputError, match="cause: need one of swapped-poses-"):
        cause_named(causes, "7")


def test_a_moved_sphere_leaves_out_the_smaller_part(cell: Measured) -> None:
    from dataclasses import replace

    from calib_core.chain.tcp import solve_tcp
    from calib_core.chain.tcp_solution import TcpOptions

    moved = [
        replace(
            o,
            base_from_tool0=RigidTransform.of(
                o.base_from_tool0.rotation, o.base_from_tool0.translation_mm + shift, "base", "tool0"
            ),
        )
        for o, shift in zip(cell.observations, [np.zeros(3)] * 9 + [np.array([4.0, 0.0, 1.0])] * 5, strict=True)
    ]
    options = TcpOptions(position_sigma_mm=0.05, orientation_sigma_rad=2e-4, point_sigma_mm=0.02)
    found = solve_tcp(moved, cell.sphere, options).beside.causes[0]
    found = causes_of([incident_finding(found, cell.session.captures)])[0]
    assert found.kind == "moved-sphere"
    assert found.changes is not None
    assert found.changes.captures == {c.id: {"excluded": True} for c in cell.session.captures[9:]}


values = st.recursive(
    st.integers(0, 3) | st.text("ab", max_size=2) | st.lists(st.integers(0, 2), max_size=2),
    lambda inner: st.dictionaries(st.sampled_from("abc"), inner, max_size=3),
    max_leaves=8,
)
patches = st.dictionaries(st.sampled_from("abc"), values | st.none(), max_size=3)


@given(before=st.dictionaries(st.sampled_from("abc"), values, max_size=3), changes=patches)
def test_the_patch_back_undoes_a_patch(before: dict[str, object], changes: dict[str, object]) -> None:
    assert merge_patch(merge_patch(before, changes), patch_back(before, changes)) == before


@pytest.mark.thorough
def test_run_applies_a_cause_and_undoes_it(
    tmp_path: Path, simulated: SimulatedSession, cell: Measured, capsys: pytest.CaptureFixture[str]
) -> None:
    session = rewritten(cell.session, "fanuc", writer("fanuc", 1000.0, False))
    save_session(tmp_path, session, simulated.files)
    assert main(["run", str(tmp_path), "--stage", "tcp"]) == 2
    assert "--apply pose-reading-in-metres" in capsys.readouterr().err
    assert main(["run", str(tmp_path), "--stage", "tcp", "--apply", "pose-reading-in-metres", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["results"]["tcp"]["verdict"] == "pass"
    assert repaired(load_session(tmp_path)[0], cell.poses)
    assert main(["run", str(tmp_path), "--stage", "tcp", "--undo"]) == 2
    assert load_session(tmp_path)[0].to_json() == session.to_json()
    assert main(["run", str(tmp_path), "--undo"]) == 2
    assert "none" in capsys.readouterr().err
