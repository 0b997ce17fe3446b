"""The TCP on simulated cells: accuracy and honesty in numbers, leave-one-out, mixed kinds, rejection."""

from collections.abc import Sequence
from dataclasses import replace

import bench_tcp
import numpy as np
import pytest
from cells import ESTIMATED, GIVEN, SPHERE, Cell

from calib_core.chain.answer import surface_distances
from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.tcp import solve_tcp
from calib_core.chain.tcp_solution import TcpOptions, TcpSolution
from calib_core.findings import judgement, reasons_of
from calib_core.frames import FloatArray, RigidTransform
from calib_core.stages.tcp.verdict import tcp_findings

CHI2_6_RARE = 27.9  # one in ten thousand


cell = Cell.of


def told(solution: TcpSolution) -> tuple[str, list[str]]:
    """Return the verdict on a solution and its warnings."""
    made = judgement(tcp_findings(solution))
    return made["verdict"], made["warnings"]


def squared(vector: FloatArray, covariance: FloatArray) -> float:
    return float(vector @ np.linalg.solve(covariance, vector))


def squared_error(of: Cell, solution: TcpSolution) -> float:
    return squared(of.error(solution.joint.mount_from_laser), solution.covariance[:6, :6])


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("figures", "seeds"), [(bench_tcp.accuracy, 6), (bench_tcp.rejection, 3)], ids=["accuracy", "rejection"]
)
def test_figures_over_many_seeds_hold(figures, seeds: int) -> None:
    rows = figures(range(seeds))
    assert len(rows) >= 4
    assert [f"{r.what}: {r.measured}, target {r.target}" for r in rows if not r.holds] == []


@pytest.mark.parametrize("scenario", ["tcp-mixed", "tcp-clouds", "tcp-centers", "tcp-stray", "tcp-background"])
@pytest.mark.parametrize(("seed", "options"), [(1, GIVEN), (2, ESTIMATED)])
def test_every_kind_of_capture_gives_the_truth_within_its_uncertainty(scenario: str, seed: int, options) -> None:
    of = cell(scenario, seed)
    solution = of.solve(options)
    assert squared_error(of, solution) < CHI2_6_RARE
    off = solution.joint.center_mm - np.array(of.simulated.truth["sphere_center_in_base_mm"])
    assert squared(off, solution.covariance[6:9, 6:9]) < 21.1  # χ² of 3 at 1e-4
    sides = of.simulated.truth["sides"]
    assert {c: int(s) for c, s in zip(solution.each.ids, solution.each.sides, strict=True) if s} == sides
    assert told(solution)[0] != "fail"


def test_the_stated_uncertainty_is_not_idle() -> None:
    """A covariance ten times too large would pass the test above; errors that poses share add a few per cent."""
    of = cell("tcp", 2)
    ratio = np.sqrt(np.diag(of.solve(GIVEN).covariance)[:6] / np.diag(of.bound()))
    assert (ratio > 0.97).all()
    assert (ratio < 1.12).all()


@pytest.mark.thorough
def test_sigmas_are_estimated_as_they_are() -> None:
    solutions = [cell("tcp", seed).solve(ESTIMATED) for seed in range(10)]
    assert np.mean([s.noise.point_sigma_mm for s in solutions]) == pytest.approx(0.02, rel=0.05)
    # A position's scatter is known to some 20 % from one session of 14 captures, and mixes with orientation's.
    arm_mm = 300.0
    pooled = [np.hypot(s.noise.sigmas.position_mm, arm_mm * s.noise.sigmas.orientation_rad) for s in solutions]
    assert np.exp(np.mean(np.log(pooled))) == pytest.approx(np.hypot(0.05, arm_mm * 2e-4), rel=0.25)


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(("scenario", "options"), [("tcp", GIVEN), ("tcp", ESTIMATED), ("tcp-mixed", GIVEN)])
def test_leave_one_out_is_that_of_a_true_solve_without_the_capture(scenario: str, options: TcpOptions) -> None:
    of = cell(scenario, 4)
    whole = of.solve(options)
    hold = TcpOptions(
        whole.noise.sigmas.position_mm, whole.noise.sigmas.orientation_rad, whole.noise.point_sigma_mm
    )
    for k in (0, 5, 11):
        others = [o for n, o in enumerate(of.observations) if n != k]
        alone = solve_tcp(others, SPHERE, hold)
        assert alone.each.used.all()
        left_out = of.observations[k]
        expected = (left_out.base_from_tool0 @ alone.joint.mount_from_laser).inverse().apply(alone.joint.center_mm)
        distances = surface_distances(left_out, expected, SPHERE.radius_mm)
        true = float(np.sqrt(np.mean(distances**2)))
        # One Newton step without the capture: second order in what it moves.
        assert whole.joint.leave_one_out_rms_mm[k] == pytest.approx(true, rel=0.1, abs=0.005)
    assert whole.joint.leave_one_out_surface_rms_mm > whole.joint.surface_rms_mm


def test_the_order_of_captures_does_not_matter() -> None:
    of = cell("tcp-spoiled", 3)
    forward, backward = of.solve(GIVEN), solve_tcp(of.observations[::-1], SPHERE, GIVEN)
    sigmas = np.sqrt(np.diag(forward.covariance)[:6])
    np.testing.assert_array_equal(forward.each.used, backward.each.used[::-1])
    difference = forward.joint.mount_from_laser.difference(backward.joint.mount_from_laser)
    np.testing.assert_allclose(difference / sigmas, 0, atol=0.05)


def test_the_answer_turns_with_the_base() -> None:
    """Another base frame changes the poses and the sphere's place, never the tool."""
    from calib_core.frames import RigidTransform

    of = cell("tcp", 6)
    other = RigidTransform.of([0.4, -1.2, 2.0], [500.0, -800.0, 90.0], "base", "base")
    moved = [replace(o, base_from_tool0=other @ o.base_from_tool0) for o in of.observations]
    here, there = of.solve(GIVEN), solve_tcp(moved, SPHERE, GIVEN)
    sigmas = np.sqrt(np.diag(here.covariance)[:6])
    difference = here.joint.mount_from_laser.difference(there.joint.mount_from_laser)
    np.testing.assert_allclose(difference / sigmas, 0, atol=0.05)
    np.testing.assert_allclose(other.apply(here.joint.center_mm), there.joint.center_mm, atol=0.01)


@pytest.mark.parametrize("options", [GIVEN, ESTIMATED], ids=["given", "estimated"])
def test_a_wrong_pose_names_its_twin_and_a_moved_sphere_its_distance(options: TcpOptions) -> None:
    of = cell("tcp-spoiled", 5)
    solution = of.solve(options)
    faults = of.simulated.truth["faults"]
    assert not solution.each.used[of.spoiled].any()
    assert solution.each.used[~of.spoiled].all()
    reasons = reasons_of(tcp_findings(solution))
    pose_of = {c.id: c.pose for c in of.simulated.session.captures}
    for name, fault in faults.items():
        reason = reasons[name]
        if fault == "wrong-pose":
            twins = [other for other, pose in pose_of.items() if pose == pose_of[name] and other != name]
            assert f"its pose is that of {twins[0]}." in reason
        else:
            stated = float(reason.split("appears ")[1].split(" mm")[0])
            assert stated == pytest.approx(3.0, abs=0.6)  # along y a profile tells less
    assert all((name in reasons) != used for name, used in zip(solution.each.ids, solution.each.used, strict=True))
    verdict, warnings = told(solution)
    assert verdict == "warn"
    assert all(name in " ".join(warnings) for name in faults)
    assert squared_error(of, solution) < CHI2_6_RARE


def shifted(observations: Sequence[SphereObservation], which: Sequence[int], offset_mm: list[float]):
    """Return captures of which some saw the sphere moved in base, by moving their poses the other way."""
    return [
        replace(o, base_from_tool0=o.base_from_tool0.perturbed([0, 0, 0, *(-np.array(offset_mm))]))
        if k in which
        else o
        for k, o in enumerate(observations)
    ]


@pytest.mark.parametrize(("which", "said"), [((11, 12, 13), "before p12"), ((0, 1, 2), "after p03")])
def test_a_sphere_that_moved_for_good_is_said_with_when(which: Sequence[int], said: str) -> None:
    of = cell("tcp", 7)
    solution = solve_tcp(shifted(of.observations, which, [2.0, -1.5, 1.0]), SPHERE, GIVEN)
    assert np.flatnonzero(~solution.each.used).tolist() == list(which)
    assert [cause.kind for cause in solution.beside.causes] == ["moved-sphere"]
    moved = solution.beside.causes[0].values
    assert f"{moved['when']} {moved['capture']}" == said
    assert moved["shift_mm"] == pytest.approx(2.7, abs=0.5)
    verdict, warnings = told(solution)
    assert verdict == "warn"
    assert f"moved by {moved['shift_mm']:.2f} mm {said}" in warnings[0]


@pytest.mark.parametrize("seed", range(3))
def test_sigmas_given_far_too_small_make_nothing_too_certain(seed: int) -> None:
    """What they leave unexplained is taken for errors that poses share, or estimated: then that is said."""
    of = cell("tcp", seed)
    solution = of.solve(TcpOptions(0.005, 1e-5, 0.02))
    assert squared_error(of, solution) < 2 * CHI2_6_RARE  # as told they would make it some hundred
    found = max(solution.noise.sigmas.position_mm, solution.noise.sigmas.alike_position_mm)
    assert found > 0.015
    assert solution.each.used.sum() >= 12


@pytest.mark.parametrize("seed", [0, 33, 34])  # where one profile on its other side left the median as it was
def test_clear_sides_are_not_doubted(seed: int) -> None:
    verdict, warnings = told(cell("tcp", seed).solve(GIVEN))
    assert (verdict, warnings) == ("pass", [])


def test_five_captures_never_get_a_plain_pass() -> None:
    """Their estimated scatter may be small by chance: of 60 such sessions 4 were off by 5 stated deviations."""
    of = cell("tcp", 3)
    five = [of.observations[k] for k in (0, 1, 4, 7, 10)]
    for options in (GIVEN, ESTIMATED):
        verdict, warnings = told(solve_tcp(five, SPHERE, options))
        assert verdict != "pass"
        assert any("Only 5 captures are used" in w for w in warnings)


def test_a_right_scanner_is_not_doubted() -> None:
    assert [cell("tcp", seed).solve(GIVEN).held.errors for seed in range(6)] == [[]] * 6


@pytest.mark.thorough
def test_what_is_found_of_a_right_scanner_is_nothing_within_what_it_says() -> None:
    """Noise along the ray shortens x seemingly, by 0.1 % here, unless the density allows for it."""
    ratios = []
    for seed in range(7, 15):
        held = cell("tcp", seed).solve(GIVEN).held
        sigmas = np.sqrt(np.diag(held.covariance)[-len(held.active) :])
        ratios.append(held.found.scanner[held.active] / sigmas)
    assert np.sqrt(np.mean(np.square(ratios))) < 1.2


@pytest.mark.parametrize(("axis", "name"), [(0, "scale_x"), (2, "scale_z")])
def test_a_scale_error_of_two_per_cent_is_found(axis: int, name: str) -> None:
    factors = np.ones(3)
    factors[axis] = 1 / 1.02
    of = cell("tcp", 1)
    scaled = [_scaled(o, factors) for o in of.observations]
    solution = solve_tcp(scaled, SPHERE, GIVEN)
    found = {e.name: e.error for e in solution.held.errors}
    assert found[name] == pytest.approx(0.02, rel=0.35)
    verdict, warnings = told(solution)
    assert verdict != "pass"
    assert any(f"{name[-1]} scale seems wrong" in w for w in warnings)


def test_applied_the_tool_is_the_true_one_and_covered_the_workpiece_is() -> None:
    """Files whose z is 1 % too short: their tool swallows it; applied, the tool itself comes out right."""
    of = cell("tcp", 1)
    scaled = [_scaled(o, np.array([1.0, 1.0, 1 / 1.01])) for o in of.observations]
    point = np.array([0.0, 0.0, 190.0])
    for apply in (False, True):
        solution = solve_tcp(scaled, SPHERE, replace(GIVEN, apply_scanner=apply))
        assert squared_error(of, solution) < CHI2_6_RARE
        raw = point / [1.0, 1.0, 1.01]
        values = solution.held.found.scanner
        measured = raw * (1 + np.array([values[1], 0.0, values[2]])) + [values[3] * raw[2], 0, 0] if apply else raw
        off = solution.joint.mount_from_laser.apply(measured) - of.truth.apply(point)
        assert squared(off, solution.in_view.at_point) < 21.1


@pytest.mark.parametrize("share", [-3e-4, 3e-4])
def test_in_base_as_the_arm_tells_it_its_lengths_cancel_at_the_workpiece(share: float) -> None:
    of = cell("tcp", 1)
    told_poses = [
        (
            o,
            RigidTransform.of(
                o.base_from_tool0.rotation, (1 + share) * o.base_from_tool0.translation_mm, "base", "tool0"
            ),
        )
        for o in of.observations
    ]
    solution = solve_tcp([replace(o, base_from_tool0=pose) for o, pose in told_poses], SPHERE, GIVEN)
    point = solution.in_view.seen_mm
    off = solution.joint.mount_from_laser.apply(point) - (1 + share) * of.truth.apply(point)
    assert squared(off, solution.in_view.at_workpiece) < 16.3  # χ² of 3 at 1e-3
    assert (
        np.linalg.eigvalsh(solution.in_view.at_workpiece)[-1]
        < 0.8 * np.linalg.eigvalsh(solution.in_view.at_point)[-1]
    )


@pytest.mark.parametrize("pair", [(5, 9), (7, 12)])
def test_two_swapped_poses_are_named(pair: tuple[int, int]) -> None:
    of = cell("tcp", 2)
    swapped = list(of.observations)
    i, j = pair
    swapped[i] = replace(swapped[i], base_from_tool0=of.observations[j].base_from_tool0)
    swapped[j] = replace(swapped[j], base_from_tool0=of.observations[i].base_from_tool0)
    solution = solve_tcp(swapped, SPHERE, GIVEN)
    names = {of.observations[k].capture for k in pair}
    assert [cause.kind for cause in solution.beside.causes] == ["swapped-poses"]
    assert set(solution.beside.causes[0].captures) == names
    assert np.flatnonzero(~solution.each.used).tolist() == sorted(pair)


@pytest.mark.parametrize("sigma_mm", [0.02, 0.05])
def test_a_stated_diameter_sigma_hardly_moves_the_tool(sigma_mm: float) -> None:
    of = cell("tcp", 3)
    exact, told = of.solve(GIVEN), solve_tcp(of.observations, SphereSize(40.0, sigma_mm), GIVEN)
    shift = exact.joint.mount_from_laser.difference(told.joint.mount_from_laser)
    assert np.abs(shift / np.sqrt(np.diag(told.covariance)[:6])).max() < 0.3


def test_repeated_captures_of_a_pose_do_not_count_as_new_poses() -> None:
    """Its error is the same each time: ten visits of every pose make nothing ten times as certain."""
    of = cell("tcp", 4)
    once = of.solve(GIVEN)
    again = solve_tcp([o for o in of.observations for _ in range(4)], SPHERE, GIVEN)
    ratio = np.sqrt(np.diag(again.covariance)[:6] / np.diag(once.covariance)[:6])
    assert (ratio[:5] > 0.75).all()
    # Four times the points do tell more of how light meets the surface, which is along z; four times the poses
    # would give 0.5.
    assert ratio[5] > 0.6


def _scaled(o: SphereObservation, factors: FloatArray) -> SphereObservation:
    from calib_core.sphere.arc import fit_arc

    points = o.points_in_laser_mm * factors
    arc = fit_arc(points[:, [0, 2]], SPHERE.diameter_mm)
    x, z = arc.center_mm
    return replace(
        o,
        points_in_laser_mm=points,
        center_in_laser_mm=np.array([x, 0.0, z]),
        center_covariance=arc.covariance,
        circle_radius_mm=arc.radius_mm,
    )
