"""How a cell's answers moved from session to session: control charts of tool, axis and verification.

Every figure of a session is held against the mean of those before it, weighed by their covariances; what sessions
of one scanner and ball share of their errors is one unknown of all (`common_errors`). A difference that the
uncertainties explain in fewer than 0.04 % of cases is flagged, so that a series of sixty raises a false alarm in
fewer than 2 %; from there on the series has a new level. Sessions of one program of poses are held against how
they scatter as well (`between_sessions`): that is less than their ±, of which they share most.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from pydantic import Field

from calib_core.errors import InputError
from calib_core.frames import FloatArray
from calib_core.messages import message, sentences
from calib_core.records import Finite, Record
from calib_core.records.policy import Environment
from calib_core.review.arm_changes import ZeroChange, joint_zeros, zero_changes
from calib_core.review.between_sessions import (
    LEAST_LIKE,
    Measured,
    SolvedSession,
    Together,
    held_against_like,
    like_last,
    together,
)
from calib_core.review.drift_figures import axes, axis_direction, axis_point, table_of, tool_point, turns, verified
from calib_core.review.drift_trend import (
    ByTemperature,
    DriftTrend,
    by_temperature,
    forecast,
    said_by_temperature,
    said_trend,
    trend_of,
)
from calib_core.steps import tool_stages

FALSE_ALARM: Final = 4e-4
_LEAST_STEP: Final = 1.0
"""In stated standard deviations, squared: half the ± that is stated, or a change matters to nobody."""
_FOUND: Final = 0.95
_ONE_SIDED: Final = 1.645
"""Of a step that is found: how often, and by how many standard deviations of one figure."""
_OF_TOOL: Final = ("tool", "verification")
"""The figures that the limit of the tool's error holds for."""


class DriftPoint(Record):
    """One session in a series: how far its figure lies from the mean of those before, ± `uncertainty` (k = 2).

    `limit` is the control limit in the direction of the change, null for the first of a level; it rests on how
    the `like` sessions before it scatter that had the same poses, or (0) on the stated ±.  `level` counts the
    levels: a flagged session begins another, unless the next one is back at the level before: then it is an
    `outlier`.
    `finds` is the step, in whichever direction is known least, that such a session finds at once in 95 of 100.
    `environment` are the temperatures that its session tells.
    """

    session: str
    name: str
    date: str
    change: Finite
    uncertainty: Finite
    limit: Finite | None
    flagged: bool
    level: int
    outlier: bool = False
    like: int = 0
    finds: Finite | None = None
    environment: Environment | None = None


class DriftSeries(Record):
    """A figure over a cell's sessions, the oldest first; `trend` is that since the last step.

    `arm-zero` is a joint's zero, where the sessions tell the arm's errors: its title says which.

    `temperature` is how it follows the first of arm's, air's and sphere's temperature that enough sessions tell.
    """

    figure: Literal["tool", "tool-orientation", "axis", "axis-direction", "verification", "arm-zero"]
    title: str
    unit: Literal["mm", "deg"]
    points: list[DriftPoint]
    trend: DriftTrend | None = None
    temperature: ByTemperature | None = None


class DriftWithin(Record):
    """How far scanner or sphere drifted within one session; `sentence` is empty where chance explains it."""

    session: str
    name: str
    date: str
    drift_mm: Finite
    uncertainty_mm: Finite
    found: bool
    settled: bool
    sentence: str = ""


class CellDrift(Record):
    """A cell's sessions over time; `flags` has a sentence for each change that is larger than its uncertainty.

    `trends` has one for each figure that creeps or follows a temperature: a warning, no fault.

    `left_out` says which sessions do not count, and why; `within` how far each drifted while it was captured.
    """

    series: list[DriftSeries]
    flags: list[str] = Field(default_factory=list[str])
    trends: list[str] = Field(default_factory=list[str])
    left_out: dict[str, str] = Field(default_factory=dict[str, str])
    within: list[DriftWithin] = Field(default_factory=list[DriftWithin])


def cell_drift(sessions: Sequence[SolvedSession]) -> CellDrift:
    """Return how the figures of a cell's sessions moved.

    Parameters
    ----------
    sessions : sequence of SolvedSession
        The oldest first.  Those that are not solved, are out of date or failed do not count.

    Raises
    ------
    InputError
        If a session comes twice: the mean would take it for two.
    """
    _require_each_once(sessions)
    left_out = {s.session: why for s in sessions if (why := _unfit(s))}
    good = [s for s in sessions if s.session not in left_out]
    within = [told for s in sessions if (told := _within(s)) is not None]
    if not good:
        return CellDrift(series=[], left_out=left_out, within=within)
    answers = [(s, s.answer or {}) for s in good]
    seen = [place["point_in_laser_mm"] for _, answer in answers if (place := answer.get("workpiece"))]
    point = np.mean(seen, axis=0) if seen else np.zeros(3)
    charts = zero_changes([answer for _, answer in answers], FALSE_ALARM)
    tables = [(s, table) for s in good if (table := table_of(s)) is not None]
    found = [
        _series("tool", "Scanner at the workpiece", "mm", [tool_point(s, a, point) for s, a in answers]),
        _series("tool-orientation", "Scanner's orientation", "deg", turns(answers)),
        _series("axis", "Turntable's axis", "mm", axes(tables, axis_point)),
        _series("axis-direction", "Axis, direction", "deg", axes(tables, axis_direction)),
        _series("verification", "Tool's error when verified", "mm", [v for s in good if (v := verified(s))]),
        *(
            _series("arm-zero", message("Zero of joint {number}", number=number), "deg", zeros, charts.get(number))
            for number, zeros in sorted(joint_zeros(answers).items())
        ),
    ]
    series = [one for one in found if one.points]
    flags = [said for one in series for said in _flags(one)]
    trends = [said for one in series for said in _trends(one)]
    return CellDrift(series=series, flags=flags, trends=trends, left_out=left_out, within=within)


@dataclass(frozen=True)
class Charted:
    """A session on the chart: its change from the mean of its level, ± (k = 2), control limit, and what it is."""

    change: float
    uncertainty: float
    limit: float | None
    flagged: bool = False
    level: int = 1
    outlier: bool = False
    like: int = 0
    finds: float | None = None


def charted(measured: Sequence[Measured]) -> list[Charted]:
    """Return the chart of a figure's sessions in order.

    A flagged session begins a new level.  Where the next one lies at the level before it and not at its own, it
    was an outlier, and that level goes on without it.
    """
    if not measured:
        return []
    first, *others = measured
    rows = [Charted(0.0, 2 * _worst(first.covariance), None)]
    level, earlier = _Level(first), None
    for one in others:
        held = level.held_against(one)
        back = earlier.held_against(one) if earlier is not None and held.flagged else None
        if back is not None and earlier is not None and not back.flagged:
            rows[-1] = replace(rows[-1], outlier=True)
            rows.append(replace(back, level=rows[-1].level - 1))
            level, earlier = earlier, None
            level.add(one)
            continue
        rows.append(replace(held, level=rows[-1].level + held.flagged))
        level, earlier = (_Level(one), level) if held.flagged else (level, None)
        if not held.flagged:
            level.add(one)
    return rows


class _Level:
    """Sessions between two changes: where the figure is, and what they tell of the errors that they share."""

    def __init__(self, first: Measured) -> None:
        self._of = first.common
        self._members: list[Measured] = []
        self._information, self._weighed = self._seen(first).prior, np.zeros(1)
        self.add(first)

    def add(self, one: Measured) -> None:
        information, weighed = self._seen(one).informing()
        self._information, self._weighed = self._information + information[0], self._weighed + weighed[0]
        self._members.append(one)

    def held_against(self, one: Measured) -> Charted:
        """Return a session's change from the mean, its ±, the control limit that way, and whether it is beyond."""
        from scipy.special import chdtri, chndtrinc  # late: they bring what takes a third of a second

        seen, covariance = self._seen(one), np.linalg.inv(self._information)
        (design,), (value,) = seen.designs, seen.values
        change = value - design @ covariance @ self._weighed
        spread = seen.covariances[0] + design @ covariance @ design.T
        length, squared = float(np.linalg.norm(change)), float(change @ np.linalg.solve(spread, change))
        crossed = float(chdtri(len(change), FALSE_ALARM))
        limit = (length / np.sqrt(squared) if squared > 0 else _worst(spread)) * np.sqrt(crossed)
        by_scatter, like, crossed_like = self._limit_by_scatter(one, length)
        shortest = min(float(limit), by_scatter)
        finds = min(float(np.sqrt(chndtrinc(crossed, len(change), 1 - _FOUND))), crossed_like)
        return Charted(
            length,
            2 * _worst(spread),
            shortest,
            length > shortest,
            like=like if by_scatter < limit else 0,
            finds=_worst(spread) * finds,
        )

    def _seen(self, one: Measured) -> Together:
        return together([one], self._of, np.ones((1, 1)))

    def _limit_by_scatter(self, one: Measured, length: float) -> tuple[float, int, float]:
        """Return how far a session may lie from others of its program as those scatter, and how many they are.

        The last is the step that is found so, in stated standard deviations.
        """
        from scipy.special import fdtri  # late, as above

        like = [other for _, other in like_last([*self._members, one])][:-1]
        if len(like) < LEAST_LIKE:
            return np.inf, 0, np.inf
        squared, ratio = held_against_like(one, like)
        crossed = max(_LEAST_STEP, float(fdtri(1, len(like) - 1, 1 - FALSE_ALARM)) * ratio)
        limit = length * np.sqrt(crossed / squared) if squared > 0 else np.inf
        return limit, len(like), float(np.sqrt(crossed) + _ONE_SIDED * np.sqrt(ratio))


def _worst(covariance: FloatArray) -> float:
    return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))


def _zeros(changes: Sequence[ZeroChange]) -> list[Charted]:
    """Return the chart of a joint's zero: a change begins a new level."""
    levels = np.cumsum([1, *(one.moved for one in changes[1:])]).tolist()
    return [
        Charted(one.change_deg, 2 * one.sigma_deg, one.limit_deg, one.moved, level)
        for one, level in zip(changes, levels, strict=True)
    ]


def _series(
    figure: Any,
    title: str,
    unit: Literal["mm", "deg"],
    measured: Sequence[Measured],
    zeros: Sequence[ZeroChange] | None = None,
) -> DriftSeries:
    chart = charted(measured) if zeros is None or len(zeros) != len(measured) else _zeros(zeros)
    points = [
        DriftPoint(
            session=one.session.session,
            name=one.session.name,
            date=one.session.date,
            environment=one.session.environment,
            **asdict(row),
        )
        for one, row in zip(measured, chart, strict=True)
    ]
    now = chart[-1].level if chart else 0
    since = [one for one, row in zip(measured, chart, strict=True) if row.level == now and not row.outlier]
    trend = trend_of(since)
    if trend is not None and figure in _OF_TOOL:
        trend = trend.model_copy(update={"forecast": forecast(trend, since)})
    return DriftSeries(
        figure=figure, title=title, unit=unit, points=points, trend=trend, temperature=by_temperature(since)
    )


def _trends(series: DriftSeries) -> list[str]:
    told = (
        said_trend(series.title, series.unit, series.trend),
        said_by_temperature(series.title, series.unit, series.temperature),
    )
    return [said for said in told if said]


def _flags(series: DriftSeries) -> list[str]:
    unit, digits = ("mm", 2) if series.unit == "mm" else ("°", 3)
    back = message("The session after it was back where the cell had been: an outlier.")
    return [
        sentences([_said_change(series.title, p, unit, digits), back if p.outlier else ""])
        for p in series.points
        if p.flagged and p.limit is not None
    ]


def _said_change(title: str, point: DriftPoint, unit: str, digits: int) -> str:
    told = {
        **{name: getattr(point, name) for name in ("change", "uncertainty", "limit", "like")},
        "title": title,
        "unit": unit,
        "digits": digits,
        "p": point.name or point.session,
    }
    if not point.like:
        return message(
            "{title} changed by {change:.{digits}f} ± {uncertainty:.{digits}f} {unit} with session "
            "{p}: more than uncertainty explains (limit {limit:.{digits}f} {unit}).",
            **told,
        )
    return message(
        "{title} changed by {change:.{digits}f} {unit} with session {p}: more than the {like} sessions before it "
        "at the same poses scatter (limit {limit:.{digits}f} {unit}); they share most of the stated "
        "± {uncertainty:.{digits}f} {unit}.",
        **told,
    )


def _require_each_once(sessions: Sequence[SolvedSession]) -> None:
    counts = Counter(one.session for one in sessions)
    twice = [session for session, count in counts.items() if count > 1]
    if twice:
        got = message("{twice} {counts} times", twice=twice[0], counts=counts[twice[0]])
        raise InputError("each session once", got, "Name it once.", "sessions")


def _unfit(session: SolvedSession) -> str:
    answer = session.answer
    if answer is None:
        return "out of date: solve it again" if session.stale.intersection(tool_stages()) else "not solved"
    if answer.get("verdict") == "fail":
        return "its answer failed"
    return "directions of its answer are not determined" if answer.get("undetermined") else ""


def _within(session: SolvedSession) -> DriftWithin | None:
    """Return the drift within a session, None of one whose tool does not tell it."""
    told = (session.of("tcp") or {}).get("warm_up")
    if told is None:
        return None
    same = {name: told[name] for name in ("drift_mm", "uncertainty_mm", "found", "settled", "sentence")}
    return DriftWithin(session=session.session, name=session.name, date=session.date, **same)
