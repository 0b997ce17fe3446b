"""Layers of the camera and its plane of light, on their bench."""

from collections.abc import Iterator

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import message
from server.scenes import nodes
from server.scenes.colors import BOARD, LIGHT, REJECTED, WAITING
from server.scenes.display_options import Look
from server.scenes.markers import cross
from server.scenes.nodes import Node
from server.scenes.optics import OpticsFacts, plane_patch_mm
from server.scenes.scene_model import SceneFacts

_RECTANGLE = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)


def camera(facts: SceneFacts, _look: Look) -> Iterator[Node]:
    """Draw the camera's frame and what it sees, as deep as a quarter of its farthest board."""
    optics = facts.optics
    if optics is None:
        return
    size = 0.12 * optics.depth_mm
    yield nodes.axes("/camera/frame", optics.base_from_camera, size, WAITING)
    above = optics.base_from_camera.apply([0.0, -0.4 * size, 0.0])
    yield nodes.label("/camera/name", above, message("camera"), anchor="bottom-right")  # at the right edge
    if optics.camera_matrix is not None:
        corners = _seen_corners(optics, 0.25 * optics.depth_mm)
        edges = [(np.zeros(3), corner) for corner in corners]
        edges += list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
        yield nodes.lines("/camera/frustum", optics.base_from_camera.apply(np.array(edges)), WAITING, 2.0)


def boards(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw every board where the camera saw it, with its corners; rejected ones crossed."""
    optics = facts.optics
    if optics is None or not len(optics.corners_in_board_mm):
        return
    outline = optics.outline_in_board_mm
    low, _, high, _ = outline
    for board in optics.boards:
        color = REJECTED if not board.used else LIGHT if board.with_stripe else BOARD
        pose = optics.base_from_camera @ board.camera_from_board
        opacity = 0.5 if board.capture == look.picked else 0.14
        yield nodes.surface(f"/boards/{board.capture}/face", pose, outline, _RECTANGLE, color, opacity)
        corners = pose.apply(optics.corners_in_board_mm)
        tones = np.tile(np.array(color, dtype=np.uint8), (len(corners), 1))
        size = 0.012 * float(np.linalg.norm(high - low))
        yield nodes.points(f"/boards/{board.capture}/corners", corners, corners[0], tones, size)
        if not board.used:
            middle = pose.apply((low + high) / 2)
            sign = cross(middle, 0.15 * float(np.linalg.norm(high - low)))
            yield nodes.lines(f"/boards/{board.capture}/cross", sign, REJECTED, 3.0)
        yield nodes.label(f"/boards/{board.capture}/name", corners[0], board.capture, 0.8)


def plane_in_camera(facts: SceneFacts, _look: Look) -> Iterator[Node]:
    """Draw a patch of the plane of light that holds the boards with the stripe, the frame L, and the stripes."""
    optics = facts.optics
    if optics is None or optics.camera_from_laser is None:
        return
    base_from_laser = optics.base_from_camera @ optics.camera_from_laser
    patch = plane_patch_mm(optics, optics.camera_from_laser.inverse())
    yield nodes.surface("/plane/patch", base_from_laser, patch, _RECTANGLE, LIGHT, 0.18)
    size = 0.1 * optics.depth_mm
    yield nodes.axes("/plane/frame", base_from_laser, size, LIGHT)
    yield nodes.label("/plane/name", base_from_laser.apply([0.0, 0.0, -0.3 * size]), message("laser"))
    stripes = _stripes(optics, optics.camera_from_laser.inverse())
    if len(stripes):
        yield nodes.lines("/plane/stripes", base_from_laser.apply(stripes), LIGHT, 4.0)


def _seen_corners(optics: OpticsFacts, depth_mm: float) -> FloatArray:
    """Return the image's corners at a depth, (4, 3) in the camera frame, its lens taken as undistorted."""
    assert optics.camera_matrix is not None
    width, height = optics.image_size
    pixels = np.array([[0, 0, 1], [width, 0, 1], [width, height, 1], [0, height, 1]]) - [0.5, 0.5, 0.0]
    return depth_mm * pixels @ np.linalg.inv(optics.camera_matrix).T


def _stripes(optics: OpticsFacts, laser_from_camera: RigidTransform) -> FloatArray:
    """Return where the plane of light cuts the boards that show it, pieces (N, 2, 3) in L."""
    pieces: list[FloatArray] = []
    if not len(optics.corners_in_board_mm):
        return np.zeros((0, 2, 3))
    outline = optics.outline_in_board_mm
    for board in optics.boards:
        if not board.with_stripe or not board.used:
            continue
        here = (laser_from_camera @ board.camera_from_board).apply(outline)
        there = np.roll(here, -1, axis=0)
        cut = here[:, 1] * there[:, 1] < 0
        if cut.sum() == 2:
            share = here[cut, 1] / (here[cut, 1] - there[cut, 1])
            pieces.append(here[cut] + share[:, None] * (there[cut] - here[cut]))
    return np.array(pieces).reshape(-1, 2, 3)
