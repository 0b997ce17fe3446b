"""The small picture of a session: everything in sight, rejected captures crossed, and nothing that could run."""

import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import httpx
import pytest

from calib_core.frames import FloatArray
from calib_core.records import Capture, Measured, parse_session
from server.scenes.picture import HEIGHT, WIDTH, session_picture
from server.scenes.scene_input import SceneInput
from server.scenes.stored import scene_input
from server.settings import Settings
from tests.server.live_server import serving, simulated_session
from tests.server.scene_cell import make_cell

SVG = "{http://www.w3.org/2000/svg}"


def shapes(picture: str) -> list[ElementTree.Element]:
    return list(ElementTree.fromstring(picture))


def assert_in_sight(picture: str) -> None:
    for shape in shapes(picture):
        assert shape.tag in {SVG + "path", SVG + "circle", SVG + "rect"}
        if shape.tag == SVG + "circle":
            assert 0 <= float(shape.attrib["cx"]) <= WIDTH
            assert 0 <= float(shape.attrib["cy"]) <= HEIGHT


def test_each_pose_is_a_dot_and_rejected_ones_are_crossed() -> None:
    cell = make_cell(rejected=("p03",))
    picture = session_picture(cell.scene())
    assert_in_sight(picture)
    dots = [one for one in shapes(picture) if one.tag == SVG + "circle" and one.attrib["r"] == "2.6"]
    crosses = re.findall(r"m0 -6l-6 6", picture)
    assert len(crosses) == 1
    assert len(dots) == len(cell.poses) - 1


def test_before_a_result_there_is_no_sphere_yet() -> None:
    cell = make_cell()
    solved, unsolved = session_picture(cell.scene()), session_picture(cell.scene(solved=False))
    assert len(shapes(solved)) == len(shapes(unsolved)) + 1
    assert_in_sight(unsolved)


def test_without_poses_it_shows_where_in_the_image_the_board_was() -> None:
    capture = {"id": "c1", "step": "camera", "kind": "frame", "files": ["captures/c1.png"]}
    record = {"format": "scancell-session/1", "cell": {"pose_convention": "abb"}, "captures": [capture]}
    corners = [[0.0, 0.0], [640.0, 512.0]]
    measured = Measured(capture="c1", kind="frame", verdict="pass", preview=corners, image_size=(640, 512))
    frame, *dots = shapes(session_picture(scene_input(parse_session(record), _no_file, [measured], {})))
    left, top = float(frame.attrib["x"]), float(frame.attrib["y"])
    right, bottom = left + float(frame.attrib["width"]), top + float(frame.attrib["height"])
    found = [(float(dot.attrib["cx"]), float(dot.attrib["cy"])) for dot in dots]
    assert found == [pytest.approx((left, top), abs=0.11), pytest.approx((right, bottom), abs=0.11)]


def test_an_empty_session_has_an_empty_picture() -> None:
    session = parse_session({"format": "scancell-session/1", "cell": {"pose_convention": "abb"}, "captures": []})
    assert shapes(session_picture(SceneInput(session, _no_points))) == []


@pytest.fixture
def client(tmp_path: Path) -> Iterator[httpx.Client]:
    with serving(Settings(data=tmp_path, port=0, warm_up=False)) as client:
        yield client


def test_it_is_served_as_an_image(client: httpx.Client) -> None:
    session = simulated_session(client, captures=3)
    root = str(client.base_url).removesuffix("/api/v1/")
    answer = client.get(f"{root}/scenes/{session}/picture")
    assert answer.headers["content-type"] == "image/svg+xml"
    assert len(shapes(answer.text)) == 6
    missing = client.get(f"{root}/scenes/nothing/picture")
    assert missing.status_code == 404
    assert "that are listed" in missing.json()["detail"]


def _no_file(name: str) -> bytes:
    raise AssertionError(f"{name} was read")


def _no_points(_: Capture) -> FloatArray:
    raise AssertionError("points were read")
