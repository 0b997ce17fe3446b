"""Poses that are being read stand in the scene before anything is stored, and go again without a trace."""

from pathlib import Path

from server.scenes.live import LiveScene
from server.settings import Settings
from tests.server.live_server import assert_problem, serving, simulated_session
from tests.server.scene_cell import make_cell


def test_poses_appear_beside_the_session_and_go_again() -> None:
    cell = make_cell(count=3)
    scene = LiveScene(cell.scene())
    try:
        before = scene.node_names
        scene.try_poses(tuple(cell.poses[:2]))
        assert scene.node_names - before == {
            "/trial/1",
            "/trial/1/name",
            "/trial/2",
            "/trial/2/name",
            "/trial/way",
        }
        assert before <= scene.node_names
        scene.try_poses(())
        assert scene.node_names == before
    finally:
        scene.stop()


def test_the_address_takes_rigid_poses_alone(tmp_path: Path) -> None:
    with serving(Settings(data=tmp_path, port=0, warm_up=False)) as client:
        session = simulated_session(client)
        address = f"{str(client.base_url).removesuffix('/api/v1/')}/scenes/{session}/trial"
        pose = [[1.0, 0, 0, 10], [0, 1.0, 0, 20], [0, 0, 1.0, 30], [0, 0, 0, 1.0]]
        assert client.post(address, json={"poses": [pose]}).status_code == 204
        assert_problem(client.post(address, json={"poses": [[[2.0, 0, 0, 0], *pose[1:]]]}), 422)
