"""The robot of a live cell in the scene of its session."""

import numpy as np

from server.live.live_cell import LiveCell
from server.scenes.display_options import RobotNow
from server.scenes.manager import SceneManager

_MOST_POINTS = 200


def follow_robot(scenes: SceneManager, session_id: str, live: LiveCell | None) -> None:
    """Show where a session's robot stands now, where anybody looks; None takes it away."""
    scene = scenes.live(session_id)
    if scene is None:
        return
    robot, _, exposure = live.newest() if live else (None, None, None)
    if robot is None or robot.base_from_tool0 is None:
        scene.follow(None)
        return
    seen = exposure.points if exposure else np.empty((0, 2))
    scene.follow(RobotNow(robot.base_from_tool0, seen[:: max(1, len(seen) // _MOST_POINTS)]))
