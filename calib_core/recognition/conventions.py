"""The convention of poses: as told, as the file says, or the one in which all of them look at one place."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib_core.arms.kinematics import arm_of, flange_of_joints
from calib_core.causes.likely import spreads_mm
from calib_core.causes.readings import Reading, poses_of, readings
from calib_core.frames import RigidTransform
from calib_core.messages import message
from calib_core.poses.convention import Convention
from calib_core.poses.conventions import CONVENTIONS
from calib_core.recognition.taken import PoseRow
from calib_core.records import Cell

_FEWEST = 5
_ANGLES = ("ZYX", "XYZ", "ZYZ")
_FEWEST_ANGLES = 3
_ALL_BUT_STRAIGHT, _HALF_TURN = 0.05, 3.2
_TRAVELS = 100.0  # as far as a flange goes for a calibration, in mm
_CLEARLY = 1.8  # as for a convention that is told and wrong
_JOINTS_MM, _A_TURN_MM = 10.0, 300.0  # arms err less; their base, tool or flange is another beyond that
_MOST_WITH_JOINTS = 60


@dataclass(frozen=True)
class Choice:
    """A convention, whether it is sure, why, and the reading of the numbers as they stand.

    `has_shown` is whether the poses themselves showed it.
    """

    convention: str
    sure: bool
    why: str
    reading: Reading
    has_shown: bool = False

    def rewritten(self, numbers: Sequence[float]) -> tuple[float, ...]:
        """Return a pose's numbers in the convention's own units."""
        return (
            tuple(numbers)
            if self.reading == Reading.told(CONVENTIONS[self.convention])
            else tuple(self.reading.rewritten(numbers, self.convention))
        )

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON data."""
        return {"name": self.convention, "sure": self.sure, "why": self.why}


def chosen_convention(
    rows: Sequence[PoseRow], fitting: Sequence[str], told: str | None, arm: str | None = None
) -> Choice | None:
    """Return the convention of poses, None where there are none and nobody tells one.

    Parameters
    ----------
    rows : sequence of PoseRow
    fitting : sequence of str
        Conventions in which they can be written, the commonest first; one where the file says which.
    told : str, optional
        The one that the user says.
    arm : str, optional
        The robot's arm by its name: joints beside poses then say where the flange is.
    """
    if told is not None:
        return Choice(told, True, message("As told."), Reading.told(CONVENTIONS[told]))
    if not fitting:
        return None
    first = CONVENTIONS[fitting[0]]
    if len(fitting) == 1:
        return Choice(first.name, True, message("As the file says."), Reading.told(first))
    if arm is not None and (by_joints := _by_joints(rows, fitting, arm)) is not None:
        return by_joints
    found = _spreads(rows, first.name, fitting)
    likely = list(fitting)
    if not found:
        why = message("{likely:or}: too few poses to tell", likely=likely)
        return Choice(first.name, False, why, Reading.told(first))
    (best, reading), *others = found
    name = _named(reading, fitting)
    if others and others[0][0] < _CLEARLY * best:
        rival = _named(others[0][1], fitting)
        why = message(
            "{likely:or}: the poses do not tell {name} from {rival}", likely=likely, name=name, rival=rival
        )
        return Choice(name, False, why, reading)
    why = message("Read so, all poses look at one place within {best_mm:.0f} mm.", best_mm=best)
    if others:
        why = message(
            "Read so, all poses look at one place within {best_mm:.0f} mm, {rival_mm:.0f} mm in the next best.",
            best_mm=best,
            rival_mm=others[0][0],
        )
    return Choice(name, True, why, reading, True)


def _by_joints(rows: Sequence[PoseRow], fitting: Sequence[str], arm: str) -> Choice | None:
    """Return the convention in which joints give the poses, None where no joints say so, or several do."""
    own = [row for row in rows if row.joints_deg is not None][:_MOST_WITH_JOINTS]
    if len(own) < _FEWEST:
        return None
    table = arm_of(arm)
    if any(len(row.joints_deg or ()) != len(table.joints) for row in own):
        return None
    flanges = [flange_of_joints(table, row.joints_deg or ()) for row in own]
    numbers, agreeing = [row.numbers for row in own], list[Reading]()
    cell, alike = Cell(pose_convention=fitting[0]), {_kind(CONVENTIONS[name]) for name in fitting}
    for reading in readings(cell, numbers) if len({len(row) for row in numbers}) == 1 else []:
        same = _kind(reading.convention) in alike and reading.way == "as-written"
        poses = poses_of(reading, numbers) if same else None
        if (
            poses is not None
            and np.median([_apart(*both) for both in zip(poses, flanges, strict=True)]) < _JOINTS_MM
        ):
            agreeing.append(reading)
    if len({_kind(one.convention) for one in agreeing}) != 1:
        return None
    name = _named(agreeing[0], fitting)
    return Choice(name, True, message("Read so, the joints of {arm} give the poses.", arm=arm), agreeing[0], True)


def _kind(convention: Convention) -> tuple[str, str]:
    return convention.form, convention.listed


def _apart(pose: RigidTransform, other: RigidTransform) -> float:
    turned = float(np.linalg.norm(pose.rotation - other.rotation))
    return max(float(np.linalg.norm(pose.translation_mm - other.translation_mm)), _A_TURN_MM * turned)


def may_be_radians(rows: Sequence[PoseRow], choice: Choice) -> bool:
    """Return whether angles that are taken for degrees can be radians: small ones all, while the flange travels.

    Poses that look at one place, read so, have shown that they are none.
    """
    known = CONVENTIONS[choice.convention]
    if known.form not in _ANGLES or choice.reading.radians or choice.has_shown or len(rows) < _FEWEST_ANGLES:
        return False
    numbers = np.array([row.numbers for row in rows])
    largest = float(np.abs(numbers[:, 3:]).max())
    return _ALL_BUT_STRAIGHT < largest < _HALF_TURN and float(np.ptp(numbers[:, :3])) > _TRAVELS


def _spreads(rows: Sequence[PoseRow], convention: str, fitting: Sequence[str]) -> list[tuple[float, Reading]]:
    numbers = [row.numbers for row in rows]
    count = CONVENTIONS[convention].count
    if len(numbers) < _FEWEST or any(len(row) != count for row in numbers):
        return []
    alike = {(CONVENTIONS[name].form, CONVENTIONS[name].listed) for name in fitting}
    spreads = spreads_mm(Cell(pose_convention=convention), numbers)
    found = [one for one in spreads if (one[1].convention.form, one[1].convention.listed) in alike]
    nearest: dict[tuple[str, str], tuple[float, Reading]] = {}
    for spread, reading in sorted(found, key=lambda one: one[0]):
        nearest.setdefault((reading.convention.form, reading.convention.listed), (spread, reading))
    return list(nearest.values())


def _named(reading: Reading, fitting: Sequence[str]) -> str:
    """Return the commonest of the conventions that read the numbers alike."""
    own = reading.convention
    alike = [n for n in fitting if (CONVENTIONS[n].form, CONVENTIONS[n].listed) == (own.form, own.listed)]
    return next((n for n in alike if CONVENTIONS[n].mm_per_unit == own.mm_per_unit), own.name)
