"""Poses that a capture could be taken from: the sphere in the field, the scanner leaning within its limits."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from calib_core.guidance.field_of_view import LEAST_OFFSET, MOST_OFFSET, Sight
from calib_core.records.planning import Box, Limits

TILT_DEG, TURN_DEG, CLEARANCE_MM = 30.0, 40.0, 30.0
"""Where a cell gives no limits: how far the scanner leans and turns; what is kept clear."""

AWAY_MM, AWAY_DEG = 40.0, 6.0
"""A pose that differs by either of them from another is another one."""

_APPROACH_MM = 150.0
_ALONG = np.linspace(0.0, 1.0, 9)[:, None]
_AT_EDGE = 0.5  # of the candidates: good poses lie at the edges of what is allowed


@dataclass(frozen=True, eq=False)
class Room:
    """Where poses may be.

    Attributes
    ----------
    sight : Sight
    limits : Limits
    home : (3, 3)
        The rotation, from what carries the scanner into what carries the sphere, from which tilts and turns are
        counted.
    keep_off : tuple of RigidTransform
        Poses that others must differ from: those of the calibration, where it is verified.
    """

    sight: Sight
    limits: Limits
    home: FloatArray
    keep_off: tuple[RigidTransform, ...] = ()

    def between(self, base_from_tool0: RigidTransform) -> RigidTransform:
        """Return the transform from what carries the scanner into what carries the sphere, at a pose."""
        return self.sight.carriers.ball_from_scanner(base_from_tool0)

    def pose_of(self, rotation: FloatArray, translation_mm: FloatArray) -> RigidTransform:
        """Return base_from_tool0 by the transform between what carries the scanner and what the sphere."""
        if self.sight.carriers.scanner_moves:
            return RigidTransform.of(rotation, translation_mm, "base", "tool0")
        return RigidTransform.of(rotation, translation_mm, "tool0", "base").inverse()

    def ends(
        self, pose: RigidTransform, mount_from_laser: RigidTransform, center_mm: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return where what the flange carries is in base at a pose, (3,), and what stands still before it."""
        if self.sight.carriers.scanner_moves:
            return pose.apply(mount_from_laser.translation_mm), center_mm
        return pose.apply(center_mm), mount_from_laser.translation_mm

    @property
    def tilt_rad(self) -> float:
        """How far the scanner may lean."""
        return float(np.deg2rad(self.limits.tilt_deg or TILT_DEG))

    @property
    def turn_rad(self) -> float:
        """How far it may turn about its own z."""
        return float(np.deg2rad(self.limits.turn_deg or TURN_DEG))

    def leans_enough(self, rotation: FloatArray, tool_rotation: FloatArray) -> bool:
        """Return whether a rotation as that of `home`, (3, 3), is within the scanner's lean and turn."""
        lean = (self.home @ tool_rotation).T @ rotation @ tool_rotation
        tilt = float(np.arccos(np.clip(lean[2, 2], -1.0, 1.0)))
        turn = float(np.arctan2(lean[1, 0] - lean[0, 1], lean[0, 0] + lean[1, 1]))
        return tilt <= self.tilt_rad and abs(turn) <= self.turn_rad

    @property
    def clearance_mm(self) -> float:
        """How far flange and scanner keep from what is around them."""
        return CLEARANCE_MM if self.limits.clearance_mm is None else self.limits.clearance_mm


@dataclass(frozen=True, eq=False)
class Candidates:
    """Poses, where the sphere's centre will be seen in L from each, (N, 3), mm, and how an arm's errors move them.

    `arm_moves` (N, 6, p) are as of an observation.
    """

    poses: tuple[RigidTransform, ...]
    centers_in_laser: FloatArray
    arm_moves: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def arrays(self) -> tuple[FloatArray, FloatArray]:
        """The poses' rotations (N, 3, 3) and translations (N, 3)."""
        rotations = np.array([pose.rotation for pose in self.poses]).reshape(-1, 3, 3)
        return rotations, np.array([pose.translation_mm for pose in self.poses]).reshape(-1, 3)

    def chosen(self, some: np.ndarray) -> "Candidates":
        """Return those of a mask (N,), or of places in the list."""
        index = np.arange(len(self))[some]
        moves = None if self.arm_moves is None else self.arm_moves[index]
        return Candidates(tuple(self.poses[k] for k in index), self.centers_in_laser[index], moves)


def candidates(
    room: Room,
    mount_from_laser: RigidTransform,
    center_mm: FloatArray,
    radius_mm: float,
    count: int,
    rng: np.random.Generator,
    at_edge: float = _AT_EDGE,
) -> Candidates:
    """Return up to `count` poses that see the sphere well and keep within the limits.

    `center_mm` is the sphere's in what carries it. A share `at_edge` of them has each of its numbers at one of its
    ends; 0 spreads all evenly.
    """
    found: list[RigidTransform] = []
    seen: list[FloatArray] = []
    for _ in range(12):
        places = places_in_view(room.sight, radius_mm, 2 * count, rng, at_edge)
        leans = _leans(room, len(places), rng, at_edge)
        good = room.sight.sees(places, radius_mm)
        places, leans = places[good], leans[good]
        rotations = room.home @ mount_from_laser.rotation @ leans @ mount_from_laser.rotation.T
        arms = mount_from_laser.apply(places) if len(places) else places
        translations = center_mm - np.einsum("kij,kj->ki", rotations, arms)
        poses = [room.pose_of(*each) for each in zip(rotations, translations, strict=True)]
        for k in np.flatnonzero(keep_free(room, poses, mount_from_laser, center_mm, radius_mm)):
            found.append(poses[k])
            seen.append(places[k])
        if len(found) >= count:
            break
    return Candidates(tuple(found[:count]), np.array(seen[:count]).reshape(-1, 3))


def allowed(
    room: Room,
    pose: RigidTransform,
    mount_from_laser: RigidTransform,
    center_mm: FloatArray,
    radius_mm: float,
) -> bool:
    """Return whether a pose sees the sphere well and keeps within the limits, its orientation apart."""
    seen = (room.between(pose) @ mount_from_laser).inverse().apply(center_mm)
    if not room.sight.sees(seen[None], radius_mm)[0]:
        return False
    return bool(keep_free(room, [pose], mount_from_laser, center_mm, radius_mm)[0])


def places_in_view(
    sight: Sight, radius_mm: float, count: int, rng: np.random.Generator, at_edge: float = _AT_EDGE
) -> FloatArray:
    """Return places of the sphere's centre in L (count, 3) all over the field."""
    unit = _spread(count, 3, rng, at_edge)
    middle = (sight.near_half_width_mm + sight.far_half_width_mm) / 2
    widest = max(sight.near_half_width_mm, sight.far_half_width_mm, middle)
    x = (2 * unit[:, 0] - 1) * max(widest - 0.3 * radius_mm, 0.0)
    if sight.kind == "profile":
        y = (LEAST_OFFSET + (MOST_OFFSET - LEAST_OFFSET) * unit[:, 1]) * radius_mm * rng.choice([-1.0, 1.0], count)
    else:
        y = (2 * unit[:, 1] - 1) * max(widest - radius_mm, 0.0)
    nearest, farthest = sight.near_mm + radius_mm * 0.45, sight.far_mm + 0.7 * radius_mm
    z = nearest + (farthest - nearest) * unit[:, 2]
    return np.column_stack([x, y, sight.facing * z])


def _leans(room: Room, count: int, rng: np.random.Generator, at_edge: float) -> FloatArray:
    """Return turns of the scanner (count, 3, 3), in L: a lean about an axis across z, then a turn about z."""
    from scipy.spatial.transform import Rotation

    unit = _spread(count, 2, rng, at_edge)
    about = rng.uniform(0, 2 * np.pi, count)
    lean = room.tilt_rad * np.sqrt(unit[:, 0])
    turn = room.turn_rad * (2 * unit[:, 1] - 1)
    across = np.column_stack([np.cos(about) * lean, np.sin(about) * lean, np.zeros(count)])
    along = np.column_stack([np.zeros(count), np.zeros(count), turn])
    return Rotation.from_rotvec(across).as_matrix() @ Rotation.from_rotvec(along).as_matrix()


def _spread(count: int, size: int, rng: np.random.Generator, at_edge: float) -> FloatArray:
    unit = rng.random((count, size))
    edge = rng.random((count, 1)) < at_edge
    return np.where(edge, np.round(unit), unit)


def keep_free(
    room: Room,
    poses: Sequence[RigidTransform],
    mount_from_laser: RigidTransform,
    center_mm: FloatArray,
    radius_mm: float,
) -> np.ndarray:
    """Return which poses keep the reach, stay off the boxes and off what stands before the flange, (N,) bool."""
    free = np.ones(len(poses), dtype=bool)
    if not len(poses):
        return free
    rotations = np.array([pose.rotation for pose in poses])
    translations = np.array([pose.translation_mm for pose in poses])
    if room.limits.reach is not None:
        free &= _inside(translations, room.limits.reach, 0.0)
    ends = np.array([room.ends(pose, mount_from_laser, center_mm) for pose in poses])
    carried, still = ends[:, 0], ends[:, 1]
    apart = np.linalg.norm(carried - still, axis=1)
    free &= apart - radius_mm >= room.clearance_mm
    for other in room.keep_off:
        turned = np.einsum("kij,ij->k", rotations, other.rotation)  # 1 + 2 cos of the angle between them
        near = np.linalg.norm(translations - other.translation_mm, axis=1) < AWAY_MM
        free &= ~(near & (turned > 1 + 2 * np.cos(np.deg2rad(AWAY_DEG))))
    if not room.limits.no_go:
        return free
    toward = (still - carried) / np.maximum(apart, 1e-9)[:, None]
    outside = carried - toward * _APPROACH_MM
    before = carried + toward * (apart - radius_mm - room.clearance_mm)[:, None]
    for start, end in ((translations, carried), (carried, before), (carried, outside)):
        way = start[:, None] + _ALONG * (end - start)[:, None]
        for box in room.limits.no_go:
            free &= ~_inside(way, box, room.clearance_mm).any(axis=1)
    return free


def _inside(points: FloatArray, box: Box, margin_mm: float) -> np.ndarray:
    low, high = np.array(box.low_mm) - margin_mm, np.array(box.high_mm) + margin_mm
    return np.all((points >= low) & (points <= high), axis=-1)
