"""Before a solve the guide takes the scatter from the captures, as the solve will."""

import numpy as np
import pytest
from bench_guide import ratios, wrong_sessions

from calib_core.captures.measure import measure_capture
from calib_core.chain.chain_data import Sigmas
from calib_core.guidance.design import SIGMAS
from calib_core.guidance.prior import situation_of
from calib_core.records import Measured, Robot, Session
from calib_core.simulation import simulate
from calib_core.stages.guide import guide


def scattered(seed: int, by_mm: float, robot: Robot | None = None) -> tuple[Session, list[Measured]]:
    """Return a simulated session whose poses err by so much more, and what its captures show."""
    simulated = simulate("tcp-unknown-sigmas", seed)
    rng = np.random.default_rng(seed)
    captures = [
        capture.model_copy(
            update={"pose": [*(np.array(capture.pose[:3]) + by_mm * rng.standard_normal(3)), *capture.pose[3:]]}
        )
        for capture in simulated.session.captures
        if capture.pose is not None
    ]
    cell = simulated.session.cell.model_copy(update={"robot": robot} if robot else {})
    session = simulated.session.model_copy(update={"captures": captures, "cell": cell})
    return session, [measure_capture(session, capture, simulated.files.__getitem__) for capture in captures]


def believed(session: Session, measured: list[Measured]) -> Sigmas:
    situation = situation_of(session, measured, {})
    assert situation is not None
    return situation.assumed.sigmas


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_an_ordinary_arm_is_believed_as_one(seed: int) -> None:
    assert 0.03 < believed(*scattered(seed, 0.0)).position_mm < 0.08  # 0.05 mm; 14 captures tell it to ± 40 %


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_an_arm_that_scatters_far_more_is_believed_to(seed: int) -> None:
    # 14 captures leave some 30 degrees of freedom: the root of their χ² is within ± 40 % (3 sigmas).  A flange
    # shifted and one turned move the sphere alike: a solve of the second seed says that it is turned.
    situation = situation_of(*scattered(seed, 0.5), {})
    assert situation is not None
    given = situation.assumed
    away_mm = [np.linalg.norm(o.base_from_tool0.translation_mm - given.center_mm) for o in situation.taken]
    turned_mm = given.sigmas.orientation_rad * float(np.mean(away_mm))
    assert 0.3 < np.hypot(given.sigmas.position_mm, turned_mm) < 0.7


def test_what_is_told_of_the_arm_stays() -> None:
    assert believed(*scattered(0, 0.5, Robot(position_sigma_mm=0.05))).position_mm == 0.05


@pytest.mark.thorough(keep=2)
@pytest.mark.parametrize(
    ("kind", "seed", "count"),
    [
        (
            "arms: joints 0.1°, links 0.5 mm",
            9,
            14,
        ),  # it was 0.32: the fit began with all captures
        ("arms: joints 0.1°, links 0.5 mm", 0, 14),  # 0.39: by the likeliest scatter alone
        ("arms: joints 0.02°, links 0.1 mm", 0, 7),
        ("arms: joints 0.02°, links 0.1 mm", 0, 14),
    ],
)
def test_the_guide_promises_what_the_result_then_states(kind: str, seed: int, count: int) -> None:
    (ratio,) = ratios(kind, seed, (count,))
    assert 0.85 < ratio < 1.2


def test_few_captures_are_believed_of_an_ordinary_arm() -> None:
    session, measured = scattered(0, 0.5)
    few = session.model_copy(update={"captures": session.captures[:4]})
    situation = situation_of(few, measured[:4], {})
    assert situation is None or situation.assumed.sigmas == SIGMAS


@pytest.mark.thorough
def test_of_captures_that_contradict_each_other_nothing_is_promised() -> None:
    for name, session, measured in wrong_sessions(seed=1, readings=2):
        now = guide(session, measured, {}).current
        assert now.meter is None or not now.meter.enough, name
        assert "enough" not in (now.progress or ""), name
        assert "contradict" in now.instruction, name
        assert now.action == "solve", name


def test_captures_that_agree_are_enough_as_before() -> None:
    simulated = simulate("tcp", 1)
    measured = [
        measure_capture(simulated.session, c, simulated.files.__getitem__) for c in simulated.session.captures
    ]
    now = guide(simulated.session, measured, {}).current
    assert now.meter is not None
    assert now.meter.enough
