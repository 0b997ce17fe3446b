"""Rows of what a check says before anything is solved."""

from collections.abc import Iterable
from typing import Any

import cv2
import numpy as np

from calib_core.findings import Finding
from calib_core.review.check import check_session
from calib_core.robots import parse_pose, to_pose
from tests.every_code.captures import again
from tests.every_code.made import TABLE, TCP, Case, check, session_of


def turned_alike() -> list[dict[str, Any]]:
    """Return captures with the orientation of the first."""
    first = np.array(TCP[0]["pose"][3:])
    return [c for c in TCP if np.allclose(c["pose"][3:], first, atol=1e-3)]


def turned_each() -> list[dict[str, Any]]:
    """Return captures without those that were only shifted."""
    alike = {c["id"] for c in turned_alike()[1:]}
    return [c for c in TCP if c["id"] not in alike]


def boards() -> Iterable[Finding]:
    """Return what a check says of frames that show no board."""

    def blank(name: str) -> bytes:
        return cv2.imencode(".png", np.full((80, 120), 90 + int(name[-5]), np.uint8))[1].tobytes()

    frames = [{"id": f"f{k}", "step": "camera", "kind": "frame", "files": [f"f{k}.png"]} for k in range(4)]
    board = {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 25.0}
    return check_session(session_of(frames, board=board), blank)


def not_weak() -> Iterable[Finding]:
    """Return what a check says without the captures that it calls weak."""
    weak = {n for f in check()() if f.code == "captures-weak" for n in f.captures}
    return check([c for c in TCP if c["id"] not in weak])()


def largest_angle(angle: float) -> Case:
    """Return what a check says of poses whose angles go up to this one."""
    poses = [[100.0 * k, 50.0, 300.0, angle, 0.1 * k, 0.2] for k in range(4)]
    captures = [{**c, "pose": pose} for c, pose in zip(TCP, poses, strict=False)]
    return check(captures, pose_convention="fanuc")


def in_order(*places: int) -> Case:
    """Return what a check says where the six numbers of all poses stand in another order."""
    poses = [to_pose("kuka", parse_pose("abb", c["pose"])) for c in TCP]
    captures = [{**c, "pose": [pose[k] for k in places]} for c, pose in zip(TCP, poses, strict=True)]
    return check(captures, pose_convention="kuka")


CASES: dict[str, tuple[Case, Case]] = {
    "input-not-usable": (check(sphere_diameter_mm=None), check()),
    "unknown-field": (check(spere_class="G100"), check()),
    "no-tcp-captures": (check([{**c, "pose": TABLE[0]["pose"]} for c in TABLE]), check(TABLE)),
    "no-tcp-captures-yet": (boards, check()),
    "stage-brought": (check(known={"tool0_from_laser": np.eye(4).tolist()}), check()),
    "sphere-sigma-assumed": (check(sphere_diameter_sigma_mm=None), check(sphere_diameter_sigma_mm=0.002)),
    "captures-too-few": (check(TCP[:3]), check()),
    "captures-show-nothing": (boards, check()),
    "captures-weak": (check(), not_weak),
    "capture-file-repeated": (check(again(pose=TCP[3]["pose"])), check(again())),
    "angles-look-like-radians": (largest_angle(3.14), largest_angle(3.15)),
    "pose-columns-swapped": (in_order(1, 0, 2, 3, 4, 5), in_order(0, 1, 2, 3, 4, 5)),
    "pose-convention-likely": (check(pose_convention="quaternion-xyzw"), check()),
    "tilts-too-few": (check(turned_alike()), check()),
    "shifts-few": (check(turned_each()), check()),
    "captures-counted": (check(), check(TABLE)),
}
