"""The next pose and the planned set where the arm's own errors are solved with the tool."""

from typing import Any

import numpy as np
import pytest

from calib_core.arms.errors import arm_moves
from calib_core.arms.kinematics import arm_of
from calib_core.captures.measure import measure_capture
from calib_core.guidance.advice import tcp_advice
from calib_core.guidance.design import Design
from calib_core.guidance.pose_list import planned_poses
from calib_core.records import Measured, Session
from calib_core.stages.guide import guide
from tests.advised_arm import AdvisedArm, advised_arm, joints_nearest, situation, with_capture
from tests.arm_cell import nominal_flange
from tests.benchmarks.bench_arm import solved

AROUND_DEG = 8.0


def started(kind: str, seed: int, captures: int) -> tuple[AdvisedArm, Session]:
    """Return a cell with captures about the first one."""
    cell = advised_arm(kind, seed)
    session, rng = cell.session, np.random.default_rng(seed)
    first = np.array(session.captures[0].joints_deg)
    while len(session.captures) < captures:
        session = with_capture(cell, session, first + rng.uniform(-AROUND_DEG, AROUND_DEG, 6))
    return cell, session


def seen(session: Session) -> list[Measured]:
    return [measure_capture(session, one, lambda _name: b"") for one in session.captures]


def with_robot(session: Session, **robot: Any) -> Session:
    record = session.model_dump(exclude_none=True, by_alias=True)
    record["cell"]["robot"] |= robot
    return Session.model_validate(record)


@pytest.mark.thorough
def test_a_planned_set_is_within_reach_where_the_arm_is_known() -> None:
    cell = advised_arm("small", 0)
    near = np.array(cell.session.captures[0].joints_deg)

    def beyond(session: Session) -> int:
        poses = planned_poses(session, seen(session), {}, 14).poses
        flanges = [np.array(one.base_from_tool0) for one in poses]
        ends = [nominal_flange(cell.arm.kind, np.deg2rad(joints_nearest(cell, one, near))) for one in flanges]
        return sum(float(np.abs(a - b).max()) > 0.1 for a, b in zip(ends, flanges, strict=True))

    assert beyond(cell.session) == 0
    assert beyond(cell.told(errors="cover")) > 0


def test_captures_tell_of_the_arm_what_was_not_known_before() -> None:
    _, session = started("small", 1, 6)
    now = situation(session)
    assert now.with_arm is not None
    design = Design([*now.taken, *now.seen_from(now.proposed(20))], now.with_arm)
    sigmas = [design.arm_terms(range(n)) for n in (0, 6, len(design))]
    assert sigmas[0] == pytest.approx(1.0)  # as believed
    assert np.all(sigmas[1] <= 1.0 + 1e-9)
    assert np.all(sigmas[2] < sigmas[1])


def test_candidates_move_with_the_arms_errors_by_the_joints_that_reach_them() -> None:
    cell, session = started("small", 2, 3)
    now = situation(session)
    assert now.with_arm is not None
    poses = now.proposed(10)
    assert poses.arm_moves is not None
    joints = np.array(cell.session.captures[0].joints_deg)
    taken = next(one for one in now.taken if one.capture == "p001")
    (moves,) = arm_moves(arm_of(session.cell.robot.arm or ""), [joints.tolist()])
    assert taken.arm_moves is not None
    np.testing.assert_allclose(taken.arm_moves, moves)
    assert all(seen.arm_moves is not None for seen in now.seen_from(poses))


@pytest.mark.thorough
def test_an_advice_and_a_plan_say_what_they_are_for_the_arm() -> None:
    _, session = started("small", 3, 6)
    advice = tcp_advice(session, seen(session), {})
    assert advice is not None
    assert advice.arm is not None
    assert advice.arm.worth_from == 8
    why = guide(session, seen(session), {}, frozenset()).current.why
    assert "of the arm's own errors it tells most about this one: " in why
    assert "worth solving from about 8 captures on" in why
    assert "The arm's joints reach each of them" in planned_poses(session, seen(session), {}, 4).note


@pytest.mark.parametrize("wrong", ["covered", "no joints", "radians", "not worth it"])
def test_where_the_arm_is_not_solved_the_advice_is_as_without(wrong: str) -> None:
    _, session = started("small", 4, 6)
    results: dict[str, Any] = {}
    match wrong:
        case "covered":
            session = with_robot(session, errors="cover")
        case "no joints":
            bare = [one.model_copy(update={"joints_deg": None}) for one in session.captures]
            session = session.model_copy(update={"captures": bare})
        case "radians":
            told = [np.deg2rad(np.array(one.joints_deg, dtype=float)).tolist() for one in session.captures]
            every = zip(session.captures, told, strict=True)
            session = session.model_copy(
                update={"captures": [one.model_copy(update={"joints_deg": joints}) for one, joints in every]}
            )
        case _:
            result = solved(session).to_json()
            results = {"tcp": result | {"arm_model": result["arm_model"] | {"worth_it": False, "applied": False}}}
    advice = tcp_advice(session, seen(session), results)
    assert advice is not None
    assert advice.next is not None
    assert advice.arm is None
    record = session.model_dump(exclude_none=True, by_alias=True)
    record["cell"]["robot"] = {}
    plain = tcp_advice(Session.model_validate(record), seen(session), results)
    assert plain is not None
    assert plain.next is not None
    np.testing.assert_allclose(plain.next.base_from_tool0.matrix, advice.next.base_from_tool0.matrix)
