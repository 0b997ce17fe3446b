"""An arm whose errors are alike over all captures: the answer is the best one with the controller's poses."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult
from tests.arm_cell import ArmCell, held_out_rms_mm, simulate_arm


def plain_fit(cell: ArmCell) -> tuple[np.ndarray, np.ndarray]:
    """Return scanner and ball by plain least squares on the centres, poses taken as exact."""
    poses = np.array([capture.pose for capture in cell.session.captures]).reshape(-1, 4, 4)
    seen = np.array([capture.center_mm for capture in cell.session.captures])

    def off(x: np.ndarray) -> np.ndarray:
        in_base = Rotation.from_rotvec(x[:3]).apply(seen) + x[3:6]
        return np.asarray((in_base - poses[:, :3, :3] @ x[6:] - poses[:, :3, 3]).ravel())

    start = [*Rotation.from_matrix(cell.base_from_laser[:3, :3]).as_rotvec(), *cell.base_from_laser[:3, 3]]
    x = least_squares(off, [*start, *cell.ball_in_tool0], x_scale=[1e-3] * 3 + [1.0] * 6).x
    placed = np.eye(4)
    placed[:3, :3], placed[:3, 3] = Rotation.from_rotvec(x[:3]).as_matrix(), x[3:6]
    return placed, x[6:]


@pytest.mark.thorough
@pytest.mark.parametrize("swing", ["usual", "near"])
def test_other_poses_are_predicted_as_well_as_by_a_plain_fit(swing: str) -> None:
    plain, ours = [], []
    for seed in range(5):
        cell = simulate_arm("small", seed, 30, size=1.5, swing=swing)
        result = solve_stage(cell.session, "tcp", lambda _name: b"")
        assert isinstance(result, TcpResult)
        told = np.array(result.base_from_laser), np.array(result.sphere_center_in_tool0_mm)
        plain.append(held_out_rms_mm(cell, *plain_fit(cell), cell.held_poses))
        ours.append(held_out_rms_mm(cell, *told, cell.held_poses))
    assert np.sqrt(np.mean(np.square(ours))) < 1.05 * np.sqrt(np.mean(np.square(plain)))
    assert max(np.array(ours) / plain) < 1.2
