"""Scanners that err as is believed of them stand to each other as well as is stated."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import calib_core as cc
from calib_core.captures.content import sphere_of
from calib_core.captures.observe import observe_capture
from calib_core.chain.effective import with_effective_points
from calib_core.chain.observations import SphereObservation
from calib_core.chain.tcp import solve_tcp
from calib_core.chain.tcp_solution import TcpSolution
from calib_core.stages.tcp.result import mounts_found
from tests.topology_errors import distances

CHI2_95 = 12.59


@cache
def observed(scenario: str, seed: int) -> list[SphereObservation]:
    session = cc.simulate(scenario, seed)[0]
    seen = [observe_capture(session.record, one, session.read) for one in session.record.captures]
    return with_effective_points(seen, sphere_of(session.record.cell, session.record.captures))


@cache
def solved(scenario: str) -> TcpSolution:
    session = cc.simulate(scenario, 2)[0].record
    return solve_tcp(observed(scenario, 2), sphere_of(session.cell, session.captures))


def test_arcs_that_a_scanners_errors_bend_count_in_full_once_they_are_straight() -> None:
    bent, right = observed("two-scanners-that-err", 2), observed("two-scanners", 2)
    assert min(o.points_per_independent for o in bent) > 5.0
    straight = [o.points_per_independent / o.bent for o in bent]
    assert np.allclose(straight, [o.points_per_independent / o.bent for o in right], rtol=0.2)
    assert max(straight) < 1.5
    assert max(o.bent for o in right) < 1.2


def test_scanners_to_each_other_are_known_as_points_without_their_errors_say() -> None:
    held = solved("two-scanners-that-err").held
    assert held.straight is not None
    straight, in_files = (
        np.array(mounts_found(replace(held, straight=one))[-1].covariance) for one in (held.straight, None)
    )
    assert np.linalg.eigvalsh(straight)[0] > 0
    mean_ratio = (np.linalg.det(straight) / np.linalg.det(in_files)) ** (1 / 12)
    assert 0.4 < mean_ratio < 0.75


@pytest.mark.thorough
def test_the_relative_pose_of_scanners_that_err_as_believed_is_stated_as_it_errs() -> None:
    """Arcs that their errors bend counted as points alike, and it erred 1.6 times less than stated: 2.4 of 6."""
    found: dict[str, list[float]] = {}
    for seed in range(1, 25):
        simulated, truth = cc.simulate("two-scanners-that-err", seed)
        for name, squared, _, _ in distances(simulated.run("tcp")["tcp"], truth):
            found.setdefault(name, []).append(squared)
    apart, tools = np.array(found["laser:left_from_laser:right"]), np.array(found["tool0_from_laser"])
    assert 4.5 < apart.mean() < 7.5
    assert np.mean(apart < CHI2_95) > 0.85
    assert tools.mean() < 6.9
    assert np.mean(tools < CHI2_95) > 0.85
