"""Standstill of a live cell, proven by poses of robot and table and by the stripe."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from calib_core.captures.standstill import is_resting
from calib_core.frames import FloatArray
from calib_core.messages import message
from calib_core.sphere.standstill import Standstill, standstill
from server.live.exposures import Exposure
from server.sources.device import Sample

_NEW_PLACE_MM, _NEW_PLACE_RAD, _NEW_TABLE_DEG = 3.0, 0.01, 0.5


@dataclass(frozen=True)
class Rules:
    """What counts as standstill.

    Parameters
    ----------
    exposures : int
        That must show the sphere at one place.
    latency_s : float
        An exposure may have been made so long before it arrived: robot and table must have stood since then.
    untimed_latency_s : float
        The same for one that does not tell when it was made.
    gap_s : float
        Poses further apart than this in time leave open what was between them.
    position_mm, orientation_rad, table_deg : float
        Poses within these are one.
    """

    exposures: int = 3
    latency_s: float = 0.3
    untimed_latency_s: float = 0.7
    gap_s: float = 0.35
    position_mm: float = 0.03
    orientation_rad: float = 2e-4
    table_deg: float = 0.01


@dataclass(frozen=True, eq=False)
class Rest:
    """A proven standstill: where robot and table stood, the exposures in their order, and what the stripe says."""

    robot: Sample | None
    table_deg: float | None
    exposures: tuple[Exposure, ...]
    still: Standstill

    @property
    def chosen(self) -> Exposure:
        """The exposure that is stored: the middle one, which others prove on both sides."""
        return self.exposures[len(self.exposures) // 2]


def stood_still(
    robot: Sequence[Sample],
    exposures: Sequence[Exposure],
    rules: Rules,
    table: Sequence[Sample] = (),
    is_timed: bool = True,
) -> Rest | str:
    """Return the standstill that the newest exposures show, or why there is none, as a clause.

    Parameters
    ----------
    robot, table : sequence of Sample
        In the order of their arrival; those of the robot may tell the table's angle too.
    exposures : sequence of Exposure
        In the order of their arrival.
    rules : Rules
    is_timed : bool
        Whether exposures tell when they were made.
    """
    if len(exposures) < rules.exposures:
        return "the scanner has not told enough yet"
    told_s = min((samples[-1].host_time_s for samples in (robot, table) if samples), default=0.0)
    followed = [exposure for exposure in exposures if exposure.frame.host_time_s <= told_s]
    newest = followed[-rules.exposures :]
    if len(newest) < rules.exposures:
        return "the robot or the table has told nothing since the exposures"
    if len({exposure.frame.content for exposure in newest}) < len(newest):
        return "the scanner repeats one exposure"
    if not all(exposure.frame.fresh for exposure in newest):
        return message("the scanner's exposures are not fresh")
    arcs = [exposure.arc for exposure in newest if exposure.arc is not None]
    if len(arcs) < len(newest):
        return next(exposure.problem for exposure in newest if exposure.arc is None)
    latency_s = rules.latency_s if is_timed else rules.untimed_latency_s
    since_s, until_s = newest[0].frame.host_time_s - latency_s, newest[-1].frame.host_time_s
    stood = _stood(robot, since_s, until_s, rules)
    if isinstance(stood, str):
        return stood
    tables = [sample for sample in table or robot if sample.table_deg is not None]
    angle = _table_stood(tables, since_s, until_s, rules) if tables else None
    if isinstance(angle, str):
        return angle
    still = standstill([arcs])
    assert still is not None
    if not still.stands_still:
        return message(
            "the stripe moved by {movement_mm:.3f} mm where noise lets it scatter {noise_mm:.3f} mm",
            movement_mm=still.movement_mm,
            noise_mm=still.noise_mm,
        )
    return Rest(stood, angle, tuple(newest), still)


def is_new_place(rest: Rest, robot: Sample | None, table_deg: float | None) -> bool:
    """Whether robot or table stand elsewhere than they did."""
    if table_deg is not None and rest.table_deg is not None and abs(table_deg - rest.table_deg) > _NEW_TABLE_DEG:
        return True
    if robot is None or rest.robot is None:
        return False
    poses = [s.base_from_tool0 for s in (robot, rest.robot) if s.base_from_tool0 is not None]
    return not is_resting(poses, _NEW_PLACE_MM, _NEW_PLACE_RAD)


def _spanning(
    samples: Sequence[Sample], device: str, since_s: float, until_s: float, gap_s: float
) -> list[Sample] | str:
    """Return a device's samples from before a time to its end without a gap, or why there are none."""
    if not samples:
        return message("{device} has told nothing yet", device=device)
    first = next((k for k in range(len(samples) - 1, -1, -1) if samples[k].host_time_s <= since_s), None)
    if first is None:
        return message("{device} is connected for too short a time", device=device)
    spanning = list(samples[first:])
    times = [sample.host_time_s for sample in spanning]
    if until_s - times[-1] > gap_s:
        return message("{device} has told nothing since the last exposure", device=device)
    if any(later - earlier > gap_s for earlier, later in pairwise(times)):
        return message("{device} left a gap between its readings", device=device)
    return spanning


def _stood(robot: Sequence[Sample], since_s: float, until_s: float, rules: Rules) -> Sample | str:
    told = [sample for sample in robot if sample.base_from_tool0 is not None]
    spanning = _spanning(told, message("the robot"), since_s, until_s, rules.gap_s)
    if isinstance(spanning, str):
        return spanning
    if any(sample.moving for sample in spanning):
        return message("the robot says that it moves")
    poses = [sample.base_from_tool0 for sample in spanning if sample.base_from_tool0 is not None]
    if not is_resting(poses, rules.position_mm, rules.orientation_rad):
        return message("the robot moves")
    if len({(sample.active_tool, sample.active_frame) for sample in spanning}) > 1:
        return message("the robot changed its tool or frame")
    return spanning[len(spanning) // 2]


def _table_stood(table: Sequence[Sample], since_s: float, until_s: float, rules: Rules) -> float | str:
    spanning = _spanning(table, message("the table"), since_s, until_s, rules.gap_s)
    if isinstance(spanning, str):
        return spanning
    angles: FloatArray = np.array([sample.table_deg for sample in spanning], dtype=float)
    return float(np.median(angles)) if np.ptp(angles) <= rules.table_deg else message("the table turns")
