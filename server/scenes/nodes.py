"""Scene nodes as plain data, so that two drawings can be compared and only what changed is sent.

Lengths come in mm and leave in metres, which viser's camera speeds, clipping planes and grids are made for.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.frames import FloatArray, RigidTransform
from server.scenes.colors import Rgb

METRES_PER_MM = 1e-3
_PLACE = ("position", "wxyz")
_NO_SHADOW = {"cast_shadow": False, "receive_shadow": False}
_AXES_UNIT = 100.0
"""Axes are made this long and scaled down: for every node that can be clicked the client prepares an outline, and
compares all corners within 0.01 of each other, which in axes of a few centimetres are nearly all of them."""


@dataclass(frozen=True, eq=False)
class Node:
    """One node: its path in the scene, the method of viser's scene that makes it, and that method's arguments.

    `instances` are the captures that it draws, where it draws many.
    """

    name: str
    method: str
    arguments: Mapping[str, Any]
    instances: tuple[str, ...] = ()

    def fingerprint(self) -> str:
        """Return a hash that changes when anything about the node's looks or place does."""
        return f"{self.looks()} {self.place()}"

    def looks(self) -> str:
        """Return a hash that changes when anything but the node's place does."""
        digest = hashlib.sha256(self.method.encode())
        for key in sorted(self.arguments.keys() - set(_PLACE)):
            value = self.arguments[key]
            digest.update(key.encode())
            digest.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())
        return digest.hexdigest()

    def place(self) -> dict[str, tuple[float, ...]]:
        """Return viser's position and quaternion as far as the node has them."""
        return {key: self.arguments[key] for key in _PLACE if key in self.arguments}

    def add_to(self, scene: Any) -> Any:
        """Add the node to viser's scene, in place of one of the same name; return its handle."""
        return getattr(scene, self.method)(self.name, **self.arguments)


def axes(name: str, pose: RigidTransform, length_mm: float, origin: Rgb, thickness: float = 0.03) -> Node:
    """Return a frame drawn as three axes (red x, green y, blue z) with a coloured origin; thickness by length."""
    looks = {
        "axes_length": _AXES_UNIT,
        "axes_radius": _AXES_UNIT * thickness,
        "origin_radius": _AXES_UNIT * 3.6 * thickness,
        "origin_color": origin,
        "scale": length_mm * METRES_PER_MM / _AXES_UNIT,
    }
    return Node(name, "add_frame", {**_place(pose), **looks})


def many_axes(name: str, poses: Sequence[RigidTransform], length_mm: float, instances: tuple[str, ...]) -> Node:
    """Return axes at many places as one node; `instances` says whose each of them is."""
    arguments = {
        **_places(poses),
        "axes_length": length_mm * METRES_PER_MM,
        "axes_radius": 0.04 * length_mm * METRES_PER_MM,
    }
    return Node(name, "add_batched_axes", arguments, instances)


def many_arrowheads(
    name: str, poses: Sequence[RigidTransform], length_mm: float, colors: Sequence[Rgb], instances: tuple[str, ...]
) -> Node:
    """Return pyramids that point along z, a colour each, as one node: far fewer triangles than `many_axes`."""
    corners = np.array([[0.2, 0, 0], [-0.1, 0.17, 0], [-0.1, -0.17, 0], [0, 0, 1]]) * length_mm
    arguments = {
        "vertices": _metres(corners).astype(np.float32),
        "faces": np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3], [2, 1, 0]], dtype=np.uint32),
        **_places(poses),
        "batched_colors": np.array(colors, dtype=np.uint8),
        "lod": "off",
        "flat_shading": True,
        **_NO_SHADOW,
    }
    return Node(name, "add_batched_meshes_simple", arguments, instances)


def frame(name: str, pose: RigidTransform) -> Node:
    """Return a place without looks, in whose frame the nodes below it stand."""
    return Node(name, "add_frame", {**_place(pose), "show_axes": False})


def label(name: str, position_mm: ArrayLike, text: str, size: float = 1.0, anchor: str = "bottom-center") -> Node:
    """Return a text that always faces the viewer; viser packs plain strings alone."""
    position = tuple(float(v) * METRES_PER_MM for v in np.asarray(position_mm, dtype=float))
    arguments = {"text": str(text), "position": position, "font_screen_scale": size, "anchor": anchor}
    return Node(name, "add_label", arguments)


def lines(name: str, segments_mm: FloatArray, color: Rgb, width_px: float = 2.0) -> Node:
    """Return straight pieces (N, 2, 3) of constant width on the screen."""
    looks = {"colors": color, "thickness": width_px, "thickness_units": "screen"}
    return Node(name, "add_line_segments", {"points": _metres(segments_mm), **looks})


def polyline(name: str, points_mm: FloatArray, color: Rgb, width_px: float = 2.0) -> Node:
    """Return a line through points (N, 3)."""
    return lines(name, np.stack([points_mm[:-1], points_mm[1:]], axis=1), color, width_px)


def arrow(name: str, ends_mm: FloatArray, color: Rgb, radius_mm: float, head: float = 3.0) -> Node:
    """Return an arrow from the first to the second of two places (2, 3), its head so often as thick."""
    radius = radius_mm * METRES_PER_MM
    arguments = {
        "points": _metres(ends_mm[None]),
        "colors": color,
        "shaft_radius": radius,
        "head_radius": head * radius,
        "head_length": 3.0 * head * radius,
    }
    return Node(name, "add_arrows", arguments)


def points(
    name: str, points_mm: NDArray[np.floating], origin_mm: ArrayLike, colors: NDArray[np.uint8], size_mm: float
) -> Node:
    """Return points (N, 3) with a colour each, in single precision about a local origin."""
    origin = np.asarray(origin_mm, dtype=float)
    arguments = {
        "points": _metres(points_mm - origin),
        "position": tuple((origin * METRES_PER_MM).tolist()),
        "colors": colors,
        "point_size": size_mm * METRES_PER_MM,
    }
    looks = {"point_shape": "circle", "point_shading": "flat", "precision": "float32"}
    return Node(name, "add_point_cloud", {**arguments, **looks})


def surface(
    name: str, pose: RigidTransform, corners_mm: FloatArray, faces: NDArray[np.uint32], color: Rgb, opacity: float
) -> Node:
    """Return translucent triangles, seen from both sides, with corners (N, 3) in the pose's own frame."""
    looks = {"color": color, "opacity": opacity, "side": "double", **_NO_SHADOW}
    return Node(
        name, "add_mesh_simple", {**_place(pose), "vertices": _metres(corners_mm), "faces": faces, **looks}
    )


def disc(name: str, radius_mm: float, height_mm: float, color: Rgb, opacity: float, corners: int = 72) -> Node:
    """Return a translucent disc about z at a height, in the frame of the node above it."""
    angle = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    rim = np.stack([radius_mm * np.cos(angle), radius_mm * np.sin(angle), np.full(corners, height_mm)], axis=1)
    at = np.arange(corners)
    faces = np.stack([np.full(corners, corners), at, (at + 1) % corners], axis=1).astype(np.uint32)
    center = np.array([[0.0, 0.0, height_mm]])
    here = RigidTransform.identity("turntable", "turntable")
    return surface(name, here, np.concatenate([rim, center]), faces, color, opacity)


def ball(name: str, center_mm: ArrayLike, radius_mm: float, color: Rgb, opacity: float, detail: int = 6) -> Node:
    """Return a translucent sphere; each edge of an icosahedron is cut into `detail` + 1 pieces."""
    center = np.asarray(center_mm, dtype=float) * METRES_PER_MM
    size = {"radius": radius_mm * METRES_PER_MM, "position": tuple(center.tolist()), "subdivisions": detail}
    return Node(name, "add_icosphere", {**size, "color": color, "opacity": opacity, **_NO_SHADOW})


def ellipsoid(name: str, pose: RigidTransform, half_mm: FloatArray, color: Rgb, opacity: float) -> Node:
    """Return a translucent ellipsoid with its half axes (3,) along those of a pose."""
    scale = tuple((half_mm * METRES_PER_MM).tolist())
    looks = {"radius": 1.0, "scale": scale, "color": color, "opacity": opacity, "subdivisions": 12}
    return Node(name, "add_icosphere", {**_place(pose), **looks, **_NO_SHADOW})


def _metres(values_mm: NDArray[np.floating]) -> NDArray[np.float32]:
    return np.ascontiguousarray(np.asarray(values_mm) * METRES_PER_MM, dtype=np.float32)


def _place(pose: RigidTransform) -> dict[str, tuple[float, ...]]:
    """Return viser's position (m) and quaternion (scalar first) of a pose."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(pose.rotation).as_quat().tolist()
    return {"position": tuple((pose.translation_mm * METRES_PER_MM).tolist()), "wxyz": (w, x, y, z)}


def _places(poses: Sequence[RigidTransform]) -> dict[str, NDArray[np.float32]]:
    """Return viser's quaternions and positions of many poses."""
    places = [_place(pose) for pose in poses]
    by_name = {"batched_wxyzs": "wxyz", "batched_positions": "position"}
    return {name: np.array([place[of] for place in places], np.float32) for name, of in by_name.items()}
