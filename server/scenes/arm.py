"""The arm from base to flange: the cell's own where it is known, else a generic one."""

from collections.abc import Iterator

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from server.scenes import nodes
from server.scenes.colors import WAITING
from server.scenes.display_options import Look
from server.scenes.nodes import Node
from server.scenes.scene_model import SceneFacts

_SHOULDER = 0.3  # its height as a share of the farthest flange
_HAND = 0.08
_SPARE = 1.08  # the links reach a little farther than they had to


def arm(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw the arm at the picked capture, else at the last one."""
    shown = look.shown(facts)
    here = next((c for c in shown if c.id == look.picked), shown[-1] if shown else None)
    if here is None:
        return
    poses = [capture.base_from_foot.inverse() @ capture.base_from_tool0 for capture in facts.captures]
    foot, own = here.base_from_foot, here.links_in_base_mm
    joints = joints_mm(foot.inverse() @ here.base_from_tool0, poses) if own is None else own
    size = 0.012 * float(np.linalg.norm(joints, axis=1).max())
    joints = foot.apply(joints)
    yield nodes.polyline("/arm/links", joints, WAITING, 5.0)
    for number, joint in enumerate(joints[1:-1]):
        yield nodes.ball(f"/arm/joint-{number}", joint, size, WAITING, 0.9)


def joints_mm(pose: RigidTransform, poses: list[RigidTransform]) -> FloatArray:
    """Return base, shoulder, elbow, wrist and flange (5, 3) of two equal links that reach all poses, elbow up."""
    far = max(float(np.linalg.norm(one.translation_mm)) for one in poses)
    shoulder = np.array([0.0, 0.0, _SHOULDER * far])
    wrists = [one.apply([0.0, 0.0, -_HAND * far]) for one in poses]
    link = _SPARE * max(float(np.linalg.norm(wrist - shoulder)) for wrist in wrists) / 2
    wrist = pose.apply([0.0, 0.0, -_HAND * far])
    way = wrist - shoulder
    length = max(float(np.linalg.norm(way)), 1e-6)
    up = np.array([0.0, 0.0, 1.0]) - way * way[2] / length**2
    steep = float(np.linalg.norm(up))
    up = up / steep if steep > 1e-3 else np.array([1.0, 0.0, 0.0])
    elbow = shoulder + way / 2 + up * np.sqrt(max(link**2 - length**2 / 4, 0.0))
    return np.array([np.zeros(3), shoulder, elbow, wrist, pose.translation_mm])
