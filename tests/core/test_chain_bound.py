"""The bound of tool and turntable by another road: differences of the residuals, and whole noise covariances."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib_core.errors import InputError
from calib_core.simulation import TableScenario, TcpScenario, simulate, simulate_table
from tests.bound import tcp_bound
from tests.chain_bound import chain_bound
from tests.plate_bound import plate_bound


def moved(matrix, xi):
    result = np.array(matrix, dtype=float)
    result[:3, :3] = result[:3, :3] @ Rotation.from_rotvec(xi[:3]).as_matrix()
    result[:3, 3] += xi[3:]
    return result


def sphere_in_base(table, shot, unknown, turn_rad):
    """Where the sphere stands: unknowns are rx ry tx ty (in T), then the mountings' places."""
    base = table.base_from_turntable
    shift = base[:3, :2] @ unknown[2:4]
    changed = moved(base, [unknown[0], unknown[1], 0.0, *shift])
    place = table.mounts_mm[shot.table.mount] + unknown[4 + 3 * shot.table.mount :][:3]
    turned = Rotation.from_rotvec([0, 0, shot.table.angle_rad + turn_rad]).apply(place)
    return changed[:3, :3] @ turned + changed[:3, 3]


@pytest.mark.parametrize("name", ["turntable", "turntable-centers"])
def test_bound_agrees_with_differences(name):
    simulated = simulate(name, 4)
    world, table = simulated.world, simulated.table
    options = world.options
    size = 9 + 4 + 3 * len(table.mounts_mm)
    information = np.zeros((size, size))
    for shot in world.shots:

        def residuals(x, shot=shot):
            chain = moved(shot.actual, x[size : size + 6]) @ moved(world.tool0_from_laser, x[:6])
            if shot.table is None:
                center = shot.sphere_center_in_base_mm + x[6:9]
            else:
                center = sphere_in_base(table, shot, x[9:size], x[size + 6])
            offset = shot.true_points_mm @ chain[:3, :3].T + chain[:3, 3] - center
            return offset.ravel() if shot.kind == "center" else np.linalg.norm(offset, axis=1) - 20.0

        steps = np.full(size + 7, 1e-3)
        steps[[0, 1, 2, 9, 10, size, size + 1, size + 2, size + 6]] = 1e-5
        columns = [(residuals(h) - residuals(-h)) / (2 * s) for h, s in zip(np.diag(steps), steps, strict=True)]
        jacobian = np.stack(columns, axis=1)
        sigmas = np.repeat([options.orientation_sigma_rad, options.position_sigma_mm], 3)
        noise = jacobian[:, size:] * [*sigmas, table.options.angle_sigma_rad]
        covariance = np.eye(len(jacobian)) * 0.02**2 + noise @ noise.T
        information += jacobian[:, :size].T @ np.linalg.solve(covariance, jacobian[:, :size])
    expected = np.linalg.inv(information)
    bound = chain_bound(simulated)
    scale = np.sqrt(np.diag(expected[:6, :6]))
    assert np.abs((bound.tool - expected[:6, :6]) / np.outer(scale, scale)).max() < 1e-4
    rotation = table.base_from_turntable[:3, :3]
    tilts = np.column_stack([-rotation[:, 1], rotation[:, 0]])
    direction = tilts @ expected[9:11, 9:11] @ tilts.T
    assert bound.axis_direction == pytest.approx(direction, rel=1e-3, abs=1e-4 * np.trace(direction))
    shifts = [11, 12, 15]
    point = rotation @ expected[np.ix_(shifts, shifts)] @ rotation.T
    assert bound.axis_point == pytest.approx(point, rel=1e-3, abs=1e-4 * np.trace(point))


def test_captures_of_the_table_can_only_help_the_tool():
    for seed in range(3):
        simulated = simulate("turntable", seed)
        alone, together = tcp_bound(simulated), chain_bound(simulated).tool
        assert np.linalg.eigvalsh(alone - together)[0] > -1e-12


def test_an_unknown_encoder_scale_costs_certainty():
    simulated = simulate("turntable-partial", 0)
    fixed, free = chain_bound(simulated), chain_bound(simulated, encoder_scale=True)
    assert np.trace(free.axis_point) > 1.05 * np.trace(fixed.axis_point)


def test_no_bound_without_a_table_or_with_equal_angles():
    with pytest.raises(InputError, match="turntable"):
        chain_bound(simulate("tcp", 0))
    with pytest.raises(InputError):
        chain_bound(
            simulate_table(0, TableScenario(tcp=TcpScenario(), angles_deg=(10.0,) * 4, angle_sigma_rad=0.0))
        )


def test_balls_that_stand_together_tell_what_one_does_and_more():
    simulated = simulate("tcp", 3)
    truth = simulated.truth
    center, size = truth["sphere_center_in_base_mm"], truth["sphere_diameter_mm"]
    one = {"name": "one", "center_mm": center, "diameter_mm": size}
    seen = {name: ["one"] for name in truth["base_from_tool0"]}
    options = simulated.world.options
    place_mm, point_mm = plate_bound({**truth, "spheres": [one], "balls_seen": seen}, options)
    assert place_mm == pytest.approx(np.sqrt(np.trace(tcp_bound(simulated)[3:, 3:])), rel=1e-4)
    assert point_mm < place_mm
