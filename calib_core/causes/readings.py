"""The ways in which the numbers of a session's poses can be read: convention, order, units, and the way round."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import Message, message
from calib_core.poses.convention import Convention
from calib_core.poses.conventions import CONVENTIONS
from calib_core.poses.numbers import parse_pose, to_pose
from calib_core.records import Capture, Cell, Changes, PoseReading

Way = Literal["as-written", "inverted", "transposed", "columns"]

MM_PER_UNIT = {"millimetres": 1.0, "centimetres": 10.0, "inches": 25.4, "metres": 1000.0}
_IN_UNIT = {
    "millimetres": message("in millimetres"),
    "centimetres": message("in centimetres"),
    "inches": message("in inches"),
    "metres": message("in metres"),
}
_NEAREST_MM, _FARTHEST_MM = 120.0, 9000.0  # how far arms' flanges are from their bases
_MOST_RAD = 2 * np.pi + 0.01
_ANGLES = ("ZYX", "XYZ", "ZYZ")
_TRAVEL = ("pose", "joints_deg", "joints_mm", "active_tool", "active_frame", "moving")
_LEAST_TURN_RAD = np.deg2rad(2.0)


@dataclass(frozen=True)
class Reading:
    """One way to read the numbers of poses.

    Attributes
    ----------
    convention : Convention
        For the order of the numbers and the form of the rotation.
    mm_per_unit : float
        Of the numbers of the position, whatever the convention says.
    radians : bool
        Of angles and rotation vectors, whatever the convention says.
    way : str
        `inverted`: the numbers are those of tool0_from_base; `transposed`: those of its rotation, with the
        position of base_from_tool0; `columns`: a matrix written column by column.
    """

    convention: Convention
    mm_per_unit: float
    radians: bool
    way: Way = "as-written"

    @classmethod
    def told(cls, convention: Convention) -> "Reading":
        """Return the reading that a convention tells."""
        return cls(convention, convention.mm_per_unit, convention.form == "rotation-vector")

    @classmethod
    def recorded(cls, record: PoseReading) -> "Reading":
        """Return the reading that a record tells."""
        return cls(CONVENTIONS[record.convention], record.mm_per_unit, record.radians, record.way)

    def record(self) -> PoseReading:
        """Return it as a record."""
        return PoseReading(
            convention=self.convention.name, mm_per_unit=self.mm_per_unit, radians=self.radians, way=self.way
        )

    def in_convention(self, numbers: Sequence[float]) -> list[float]:
        """Return the same pose's numbers in the convention's own order and units, still the same way round."""
        row = np.array(numbers, dtype=float)
        if self.convention.form == "matrix":
            matrix = row.reshape(4, 4).T.copy() if self.way == "columns" else row.reshape(4, 4).copy()
            matrix[:3, 3] *= self.mm_per_unit
            return matrix.ravel().tolist()
        row[:3] *= self.mm_per_unit / self.convention.mm_per_unit
        own = self.convention.form == "rotation-vector"
        if self.convention.form != "quaternion" and self.radians != own:
            row[3:] = np.rad2deg(row[3:]) if self.radians else np.deg2rad(row[3:])
        return row.tolist()

    def pose(self, numbers: Sequence[float]) -> RigidTransform:
        """Return base_from_tool0; raises InputError."""
        pose = parse_pose(self.convention.name, self.in_convention(numbers))
        if self.way == "inverted":
            return RigidTransform(pose.inverse().matrix, "base", "tool0")
        if self.way == "transposed":
            return RigidTransform.of(pose.rotation.T, pose.translation_mm, "base", "tool0")
        return pose

    def rewritten(self, numbers: Sequence[float], convention: str) -> list[float]:
        """Return a pose's numbers as they should stand in a session of this convention."""
        if self.way in ("as-written", "columns") and convention == self.convention.name:
            return self.in_convention(numbers)
        return to_pose(convention, self.pose(numbers))

    def same_numbers(self) -> str | None:
        """Return the convention that reads the numbers in this way as they stand, None where none does."""
        if self.way != "as-written":
            return None
        fitting = self._fitting()
        if not fitting or self.convention in fitting:
            return self.convention.name if fitting else None
        return fitting[0].name

    def _fitting(self) -> list[Convention]:
        """Return the conventions that tell this form and these units."""
        return [
            c
            for c in CONVENTIONS.values()
            if _form(c) == _form(self.convention)
            and c.mm_per_unit == self.mm_per_unit
            and Reading.told(c).radians == self.radians
        ]

    def words(self, now: Convention) -> Message:
        """Return how the numbers are to be read instead of as `now` does."""
        told = Reading.told(now)
        found: list[Message] = []
        if _form(self.convention) != _form(now):
            names = [f"'{c.name}'" for c in self._fitting() or [self.convention]]
            found.append(message("written as {names:or}", names=names))
        if self.way == "columns":
            found.append(message("matrices written column by column"))
        if self.mm_per_unit != told.mm_per_unit:
            found.append(next(said for name, said in _IN_UNIT.items() if MM_PER_UNIT[name] == self.mm_per_unit))
        if self.convention.form != "quaternion" and self.convention.form != "matrix":
            usual = self.convention.form == "rotation-vector"
            if self.radians != usual:
                found.append(
                    message("with angles in radians") if self.radians else message("with angles in degrees")
                )
        if self.way == "inverted":
            found.append(message("inverted (the base in the flange's frame, or cell.arrangement is wrong)"))
        if self.way == "transposed":
            found.append(message("with transposed rotations (the base's in the flange's frame)"))
        return Message("{parts:,}", {"parts": found})


def _form(convention: Convention) -> tuple[str, str]:
    return convention.form, convention.listed


def readings(cell: Cell, rows: Sequence[Sequence[float]]) -> list[Reading]:
    """Return the ways in which these numbers can be read, that of the cell's convention first.

    Left out are those that put the flange nearer to its base or farther from it than arms reach, and angles beyond
    a turn.
    """
    now = CONVENTIONS[cell.pose_convention]
    numbers = np.array(rows, dtype=float)
    found = [Reading.told(now)]
    for convention in _conventions(cell, now):
        for mm_per_unit in _lengths(convention, numbers):
            for radians in _units_of_angles(convention, numbers):
                for way in _ways(convention, numbers):
                    reading = Reading(convention, mm_per_unit, radians, way)
                    if reading not in found:
                        found.append(reading)
    return found


def _conventions(cell: Cell, now: Convention) -> Iterator[Convention]:
    """Give one convention of each form with as many numbers: the cell's own, else its brand's, else the first."""
    brand = (cell.robot.brand or "").lower()
    groups: dict[tuple[str, str], list[Convention]] = {}
    for convention in CONVENTIONS.values():
        if convention.count == now.count:
            groups.setdefault(_form(convention), []).append(convention)
    for group in groups.values():
        own = [c for c in group if c == now]
        of_brand = [c for c in group if brand and brand in (c.name, *c.brands.lower().split(", "))]
        yield (own or of_brand or group)[0]


def _lengths(convention: Convention, numbers: FloatArray) -> list[float]:
    positions = numbers[:, [3, 7, 11]] if convention.form == "matrix" else numbers[:, :3]
    if convention.form == "matrix" and np.abs(positions).max() == 0:
        positions = numbers[:, 12:15]
    far = float(np.median(np.linalg.norm(positions, axis=1)))
    return [factor for factor in MM_PER_UNIT.values() if _NEAREST_MM <= factor * far <= _FARTHEST_MM]


def _units_of_angles(convention: Convention, numbers: FloatArray) -> list[bool]:
    if convention.form in ("matrix", "quaternion"):
        return [False]
    angles = numbers[:, 3:]
    most = np.abs(angles).max() if convention.form in _ANGLES else np.linalg.norm(angles, axis=1).max()
    return [False, True] if most <= _MOST_RAD else [False]


def _ways(convention: Convention, numbers: FloatArray) -> list[Way]:
    if convention.form == "matrix":
        by_columns = np.abs(numbers[:, [3, 7, 11]]).max() == 0 and np.abs(numbers[:, 12:15]).max() > 0
        if by_columns:
            return ["columns"]
    return ["as-written", "inverted", "transposed"]


def poses_of(reading: Reading, rows: Sequence[Sequence[float]]) -> list[RigidTransform] | None:
    """Return the poses by a reading; None where it cannot read them, or gives them all one orientation."""
    try:
        poses = [reading.pose(row) for row in rows]
    except InputError:
        return None
    first = poses[0].rotation
    if all(np.trace(first.T @ pose.rotation) > 1 + 2 * np.cos(_LEAST_TURN_RAD) for pose in poses):
        return None
    return poses


def moved_poses(given: Mapping[str, str], lost: Sequence[str], captures: Sequence[Capture]) -> Changes:
    """Return what gives captures the poses of others, and leaves out those that have none."""
    records = {capture.id: capture.to_json() for capture in captures}
    patches: dict[str, dict[str, object]] = {name: {"excluded": True} for name in lost}
    for name, other in given.items():
        own, theirs = records[name], records[other]
        patches[name] = {
            field: theirs.get(field) for field in _TRAVEL if field == "pose" or own.get(field) != theirs.get(field)
        }
    return Changes(captures=patches)


def changes_of(reading: Reading, cell: Cell, captures: Sequence[Capture]) -> Changes:
    """Return what makes a session read its poses in another way: its convention alone where one says so."""
    name = reading.same_numbers()
    if name is not None:
        return Changes(cell={"pose_convention": name})
    name = reading.convention.name
    patches = {capture.id: patch for capture in captures if (patch := _rewritten(reading, name, capture))}
    return Changes(cell={} if name == cell.pose_convention else {"pose_convention": name}, captures=patches)


def _rewritten(reading: Reading, name: str, capture: Capture) -> dict[str, object]:
    patch: dict[str, object] = {}
    if capture.pose is not None:
        patch["pose"] = reading.rewritten(capture.pose, name)
    if capture.poses is not None:
        patch["poses"] = [reading.rewritten(pose, name) for pose in capture.poses]
    if capture.pose_track is not None:
        track = [{"t_s": timed.t_s, "pose": reading.rewritten(timed.pose, name)} for timed in capture.pose_track]
        patch["pose_track"] = track
    return patch
