"""The live robot in the scene: it moves there without the rest being sent again, and goes when it is gone."""

import numpy as np
import pytest

from calib_core.frames import RigidTransform
from server.scenes.display_options import RobotNow
from server.scenes.live import LiveScene
from tests.server.scene_cell import TOOL0_FROM_LASER, make_cell

PROFILE_MM = np.column_stack(
    [np.linspace(-12.0, 12.0, 40), 150.0 - np.sqrt(400.0 - np.linspace(-12, 12, 40) ** 2)]
)


def test_flange_and_light_follow_the_robot() -> None:
    cell = make_cell()
    scene = LiveScene(cell.scene(count=6))
    try:
        others = scene.node_names
        assert scene.follow(None) == 0
        pose = RigidTransform.from_rounded(
            [[1, 0, 0, 900], [0, 1, 0, 50], [0, 0, 1, 700], [0, 0, 0, 1]], "base", "tool0"
        )
        assert scene.follow(RobotNow(pose, PROFILE_MM)) == 4
        assert scene.node_names - others == {"/live/flange", "/live/name", "/live/laser", "/live/light"}
        placed = scene._handles["/live/laser"].position
        assert placed == pytest.approx((pose @ TOOL0_FROM_LASER).translation_mm / 1000)
        assert scene.follow(RobotNow(pose, PROFILE_MM)) == 0
        moved = RigidTransform.from_rounded([*pose.to_rows()[:2], [0, 0, 1, 710], [0, 0, 0, 1]], "base", "tool0")
        assert scene.follow(RobotNow(moved, PROFILE_MM)) == 4
        assert scene.update(cell.scene(count=6)) == 0  # a newer state of the session leaves the robot where it is
        assert scene.follow(None) == 4
        assert scene.node_names == others
    finally:
        scene.stop()
