"""The next pose and the planned set: promised by the same covariance that the solve states, and kept."""

from dataclasses import replace

import numpy as np
import pytest

from calib_core.captures.measure import measure_capture
from calib_core.captures.observe import observe_capture
from calib_core.cell.walk import Carriers
from calib_core.chain.chain_data import Sigmas
from calib_core.chain.observations import SphereSize
from calib_core.chain.tcp import solve_tcp
from calib_core.chain.tcp_solution import TcpOptions
from calib_core.frames import RigidTransform, rotation_from_vector
from calib_core.guidance.advice import advice_in, inputs_of, inputs_read, tcp_advice
from calib_core.guidance.candidates import Room, candidates
from calib_core.guidance.design import Assumed, Design, worst_sigma
from calib_core.guidance.field_of_view import Sight
from calib_core.guidance.planner import Situation, next_pose, planned_set
from calib_core.guidance.pose_list import planned_poses
from calib_core.records.planning import Box, Limits
from calib_core.simulation import simulate
from calib_core.stages.pipeline import solve_stage

RADIUS_MM = 20.0
SIGHT = Sight(
    near_mm=130, far_mm=230, near_half_width_mm=40, far_half_width_mm=40, pitch_mm=0.1, point_sigma_mm=0.02
)
TOOL = RigidTransform.of([0.3, 0.1, -1.5], [35.0, -120.0, 140.0], "tool0", "laser")
CENTER = np.array([900.0, 150.0, 420.0])
SIGMAS = Sigmas(0.05, 2e-4, (1e-4,), 0.02, 5e-5, 1.0)
HOME = rotation_from_vector(np.array([np.pi, 0.0, 0.0]))
STANDS = RigidTransform.of([0.3, 0.1, -1.5], [900.0, 150.0, 700.0], "base", "laser")
CARRIED = np.array([25.0, -40.0, 110.0])
STANDS_HOME = rotation_from_vector(np.array([0.2, -2.9, 0.1]))


def situation(limits: Limits | None = None, stands: bool = False) -> Situation:
    """What is known before any capture, of a scanner on the flange, or of one that stands before a ball on it."""
    point, carriers = SIGHT.middle_mm, Carriers("base", "tool0") if stands else SIGHT.carriers
    known = {"tool_sigma_mm": 10.0, "tool_sigma_rad": 0.05}
    tool, center, home = (STANDS, CARRIED, STANDS_HOME) if stands else (TOOL, CENTER, HOME)
    assumed = Assumed(SphereSize(2 * RADIUS_MM), tool, center, SIGMAS, point, **known)
    return Situation([], assumed, Room(replace(SIGHT, carriers=carriers), limits or Limits(), home))


def followed(start: Situation, count: int, until: int = 12) -> Situation:
    now = start
    for k in range(count):
        best = next_pose(now, 150, until)
        assert best is not None
        seen = now.room.sight.observation(f"p{k}", best.base_from_tool0, best.center_in_laser_mm, RADIUS_MM)
        now = replace(now, taken=[*now.taken, seen])
    return now


@pytest.mark.parametrize("seed", [3, 8])
def test_what_is_predicted_for_poses_is_what_the_solve_states_of_them(seed: int) -> None:
    simulated = simulate("tcp", seed)
    session = simulated.session
    observed = [observe_capture(session, c, simulated.files.__getitem__) for c in session.captures]
    options = TcpOptions(position_sigma_mm=0.05, orientation_sigma_rad=2e-4, point_sigma_mm=0.02)
    solved = solve_tcp(observed, SphereSize(40.0), options)
    tool, center = solved.joint.mount_from_laser, solved.joint.center_mm
    assumed = Assumed(SphereSize(40.0), tool, center, solved.noise.sigmas, solved.in_view.seen_mm)
    planned = [
        SIGHT.observation(
            o.capture, o.base_from_tool0, (o.base_from_tool0 @ tool).inverse().apply(center), RADIUS_MM
        )
        for o in observed
    ]
    design = Design(planned, assumed)
    every = range(len(planned))
    promised = np.sqrt(np.diag(design.tool(every)))
    stated = np.sqrt(np.diag(solved.covariance)[:6])
    np.testing.assert_allclose(promised, stated, rtol=0.1)
    at_part = worst_sigma(design.workpiece(every)) / worst_sigma(solved.in_view.at_workpiece)
    assert at_part == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("stands", [False, True])
def test_one_more_capture_gains_what_the_whole_set_then_has(stands: bool) -> None:
    start = situation(stands=stands)
    poses = start.proposed(40)
    design = Design(start.seen_from(poses), start.assumed)
    first, others = [0, 3, 5, 9, 12, 17], [20, 21, 30]
    added = design.adding(first, others).workpiece
    for k, other in enumerate(others):
        alone = design.workpiece([*first, other])
        # The drift of the sphere and the arm's middle are those of the whole set: a little differs.
        assert worst_sigma(added[k]) == pytest.approx(float(worst_sigma(alone)), rel=0.05)


def test_poses_before_a_scanner_that_stands_still_bring_the_ball_into_its_light() -> None:
    simulated = simulate("fixed-scanner", 4)
    session, truth = simulated.session, simulated.truth
    read = simulated.files.__getitem__
    measured = [measure_capture(session, capture, read) for capture in session.captures]
    for taken, results in ((6, {}), (14, {"tcp": solve_stage(session, "tcp", read).to_json()})):
        so_far = session.model_copy(update={"captures": session.captures[:taken]})
        plan = planned_poses(so_far, measured[:taken], results, 4)
        stands = RigidTransform.from_rounded(truth["base_from_laser"], "base", "laser")
        for pose in plan.poses:
            flange = RigidTransform.from_rounded(pose.base_from_tool0, "base", "tool0")
            seen = stands.inverse().apply(flange.apply(truth["sphere_center_in_tool0_mm"]))
            assert abs(seen[1]) < 0.95 * RADIUS_MM
            assert 60 < abs(seen[2]) < 400
        reached = [pose.uncertainty_mm or np.inf for pose in plan.poses]
        assert reached == sorted(reached, reverse=True)


@pytest.mark.thorough
def test_every_capture_helps_and_chosen_ones_more_than_random_ones() -> None:
    start = situation(Limits(tilt_deg=20, turn_deg=20))
    taken = followed(start, 10).taken
    design = Design(taken, start.assumed)
    after = [float(worst_sigma(design.workpiece(range(n)))) for n in range(1, 11)]
    assert after == sorted(after, reverse=True)
    rng = np.random.default_rng(4)
    some = candidates(start.room, TOOL, CENTER, RADIUS_MM, 150, rng, at_edge=0.0)
    random = Design(start.seen_from(some), start.assumed)
    sets = [sorted(rng.choice(len(some), 10, replace=False)) for _ in range(15)]
    usual = float(np.median([worst_sigma(random.workpiece(one)) for one in sets]))
    assert after[-1] < 0.8 * usual


@pytest.mark.thorough
def test_a_set_that_is_thought_of_ahead_leaves_less_than_the_best_pose_each_time() -> None:
    start = situation(Limits(tilt_deg=20.0, turn_deg=25.0))
    ahead, each = (followed(start, 6, until) for until in (12, 0))
    sigmas = [float(worst_sigma(Design(now.taken, now.assumed).workpiece(range(6)))) for now in (ahead, each)]
    assert sigmas[0] < sigmas[1]


def test_poses_keep_field_reach_tilt_and_boxes() -> None:
    limits = Limits(
        reach=Box(low_mm=[600, -100, 500], high_mm=[1150, 420, 900]),
        tilt_deg=25,
        no_go=[Box(low_mm=[950, -200, 300], high_mm=[1300, 500, 900])],
        clearance_mm=20,
    )
    start = situation(limits)
    poses = start.proposed(80)
    assert len(poses) == 80
    for pose, seen in zip(poses.poses, poses.centers_in_laser, strict=True):
        assert np.all(pose.translation_mm >= limits.reach.low_mm)
        assert np.all(pose.translation_mm <= limits.reach.high_mm)
        np.testing.assert_allclose((pose @ TOOL).inverse().apply(CENTER), seen, atol=1e-6)
        assert 0.25 * RADIUS_MM <= abs(seen[1]) <= 0.88 * RADIUS_MM
        lean = (HOME @ TOOL.rotation).T @ pose.rotation @ TOOL.rotation
        assert np.arccos(np.clip(lean[2, 2], -1, 1)) <= np.deg2rad(25) + 1e-9
        scanner = pose.apply(TOOL.translation_mm)
        for place in (pose.translation_mm, scanner):
            assert place[0] < 950 - 20 + 1e-9


def test_where_no_pose_is_allowed_none_is_proposed() -> None:
    far_off = Limits(reach=Box(low_mm=[0, 0, 0], high_mm=[10, 10, 10]))
    assert next_pose(situation(far_off), count=30) is None
    with pytest.raises(ValueError, match="allowed"):
        planned_set(situation(far_off), 4, grid=30)


def test_a_planned_set_is_no_worse_than_its_greedy_start_and_tells_what_each_gains() -> None:
    start = situation()
    plan = planned_set(start, 6, grid=120)
    assert len(plan.poses) == 6
    assert np.all(np.diff(plan.after_mm) <= 1e-9)
    greedy = planned_set(start, 6, grid=120, sweeps=0)
    assert plan.after_mm[-1] <= greedy.after_mm[-1] + 1e-12


@pytest.mark.thorough
def test_advice_stops_where_the_wanted_figure_is_reached() -> None:
    now = followed(situation(), 9)
    reached = advice_in(now, wanted_mm=1.0)
    assert reached.meter.enough
    assert reached.next is None
    assert reached.words().startswith("± 0.")
    assert reached.words().endswith("wanted ± 1.0\u202fmm")
    more = advice_in(now, wanted_mm=0.08)
    assert not more.meter.enough
    assert more.next is not None
    assert more.meter.after_next_mm < more.meter.uncertainty_mm
    never = advice_in(now, wanted_mm=0.001)
    assert never.meter.still_needed is None


def test_of_many_captures_an_advice_reads_the_first_and_the_newest_ones_alone() -> None:
    """All of a thousand would cost a second each time that one more has come."""
    simulated = simulate("tcp", 3)
    taken = simulated.session.captures
    many = [taken[k % len(taken)].model_copy(update={"id": f"c{k:03d}"}) for k in range(120)]
    session = simulated.session.model_copy(update={"captures": many})
    measured = [measure_capture(session, many[0], simulated.files.__getitem__)]
    read, seen, _ = inputs_read(inputs_of(session, measured, {}, ("tcp",), 80))
    assert [c.id for c in read.captures] == ["c000", *(f"c{k:03d}" for k in range(40, 120))]
    assert [m.capture for m in seen] == ["c000"]
    all_read, _, _ = inputs_read(inputs_of(session, measured, {}, ("tcp",)))
    assert len(all_read.captures) == 120


def test_a_pose_that_is_not_sure_is_said_to_be_so() -> None:
    start = situation()
    blind = replace(start, assumed=replace(start.assumed, tool_sigma_mm=2000.0, tool_sigma_rad=2.0))
    seen = blind.seen_from(blind.proposed(1))
    chosen = next_pose(replace(blind, taken=[*blind.taken, seen[0]]), count=60)
    assert chosen is not None
    assert not chosen.sure
    assert chosen.doubt_mm > 10.0


@pytest.mark.parametrize("scenario", ["two-scanners", "plate"])
def test_captures_of_several_scanners_and_of_several_balls_do_not_contradict_each_other(scenario: str) -> None:
    simulated = simulate(scenario, 2)
    session, read = simulated.session, simulated.files.__getitem__
    measured = [measure_capture(session, capture, read) for capture in session.captures[:14]]
    for taken in (9, 14):
        so_far = session.model_copy(update={"captures": session.captures[:taken]})
        advice = tcp_advice(so_far, measured[:taken], {})
        assert advice is None or not (advice.contradicted or advice.apart)


def test_of_two_scanners_the_one_in_hand_is_advised() -> None:
    simulated = simulate("two-scanners-in-turn", 3)
    session, read = simulated.session, simulated.files.__getitem__
    measured = [measure_capture(session, capture, read) for capture in session.captures]
    left = [capture.id for capture in session.captures if capture.scanner == "left"]
    now = [
        tcp_advice(session.model_copy(update={"captures": session.captures[:n]}), measured[:n], {})
        for n in (len(left), len(left) + 6)
    ]
    reached = [advice.meter.uncertainty_mm if advice else None for advice in now]
    assert reached[0] is not None
    assert reached[1] is None or reached[1] > 1.2 * reached[0]
