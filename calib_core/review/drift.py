"""How a cell's answers moved from session to session: control charts of tool, axis and verification.

Every figure of a session is held against the mean of those before it, weighed by their covariances.  A difference
that the uncertainties explain in fewer than 0.06 % of cases is flagged, so that a series of thirty raises a false
alarm in fewer than 2 %; from there on the series has a new level.  Sessions of one program of poses are held
against how they scatter as well (`between_sessions`): that is less than their ±, of which they share most.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from pydantic import Field

from calib_core.cell.found import as_used, placed_table, scanner_frame
from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform, skew, vector_from_rotation
from calib_core.messages import message, sentences
from calib_core.records import Finite, Record
from calib_core.records.policy import Environment
from calib_core.review.between_sessions import LEAST_LIKE, Measured, SolvedSession, held_against_like, like_last
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

FALSE_ALARM: Final = 6e-4
_FALSE_BY_SCATTER: Final = 4e-4
_LEAST_STEP: Final = 1.0
"""In stated standard deviations, squared: half the ± that is stated, or a change matters to nobody."""
_LEAST_SIGMA: Final = 1e-9
_OF_TOOL: Final = ("tool", "verification")
"""The figures that the limit of the tool's error holds for."""


class DriftPoint(Record):
    """One session in a series: how far its figure lies from the mean of those before, ± `uncertainty` (k = 2).

    `limit` is the control limit in the direction of the change, null for the first of a level; it rests on how
    the `like` sessions before it scatter that had the same poses, or (0) on the stated ±.  `level` counts the
    levels: a flagged session begins another, unless the next one is back at the level before: then it is an
    `outlier`.
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
    environment: Environment | None = None


class DriftSeries(Record):
    """A figure over a cell's sessions, the oldest first; `trend` is that since the last step.

    `temperature` is how it follows the first of arm's, air's and sphere's temperature that enough sessions tell.
    """

    figure: Literal["tool", "tool-orientation", "axis", "axis-direction", "verification"]
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
    tables = [(s, table) for s in good if (table := _table(s)) is not None]
    found = [
        _series("tool", "Scanner at the workpiece", "mm", [_tool_point(s, a, point) for s, a in answers]),
        _series("tool-orientation", "Scanner's orientation", "deg", _turns(answers)),
        _series("axis", "Turntable's axis", "mm", _axes(tables, _axis_point)),
        _series("axis-direction", "Axis direction", "deg", _axes(tables, _axis_direction)),
        _series("verification", "Tool's error when verified", "mm", [v for s in good if (v := _verified(s))]),
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


def charted(measured: Sequence[Measured]) -> list[Charted]:
    """Return the chart of a figure's sessions in order.

    A flagged session begins a new level.  Where the next one lies at the level before it and not at its own, it
    was an outlier, and that level goes on without it.
    """
    rows: list[Charted] = []
    level, earlier = _Level(), None
    for one in measured:
        if not rows:
            rows.append(Charted(0.0, 2 * _worst(one.covariance), None))
            level.add(one)
            continue
        held = level.held_against(one)
        back = earlier.held_against(one) if earlier is not None and held.flagged else None
        if back is not None and earlier is not None and not back.flagged:
            rows[-1] = replace(rows[-1], outlier=True)
            rows.append(replace(back, level=rows[-1].level - 1))
            level, earlier = earlier, None
        else:
            rows.append(replace(held, level=rows[-1].level + held.flagged))
            level, earlier = (_Level(), level) if held.flagged else (level, None)
        level.add(one)
    return rows


class _Level:
    """Sessions between two changes: their mean, weighed by the covariances."""

    def __init__(self) -> None:
        self._information: FloatArray = np.zeros((1, 1))
        self._weighed: FloatArray = np.zeros(1)
        self._members: list[Measured] = []

    def add(self, one: Measured) -> None:
        information = np.linalg.inv(one.covariance)
        self._information = self._information + information
        self._weighed = self._weighed + information @ one.value
        self._members.append(one)

    def held_against(self, one: Measured) -> Charted:
        """Return a session's change from the mean, its ±, the control limit that way, and whether it is beyond."""
        from scipy.special import chdtri  # late: it brings what takes a third of a second

        mean, covariance = self.mean()
        change, spread = one.value - mean, one.covariance + covariance
        length, squared = float(np.linalg.norm(change)), float(change @ np.linalg.solve(spread, change))
        crossed = float(chdtri(len(change), FALSE_ALARM))
        limit = (length / np.sqrt(squared) if squared > 0 else _worst(spread)) * np.sqrt(crossed)
        by_scatter, like = self._limit_by_scatter(one, length)
        shortest = min(float(limit), by_scatter)
        return Charted(
            length, 2 * _worst(spread), shortest, length > shortest, like=like if by_scatter < limit else 0
        )

    def _limit_by_scatter(self, one: Measured, length: float) -> tuple[float, int]:
        """Return how far a session may lie from others of its program as those scatter, and how many they are."""
        from scipy.special import fdtri  # late, as above

        like = [other for _, other in like_last([*self._members, one])][:-1]
        if len(like) < LEAST_LIKE:
            return np.inf, 0
        squared, ratio = held_against_like(one, like)
        crossed = max(_LEAST_STEP, float(fdtri(1, len(like) - 1, 1 - _FALSE_BY_SCATTER)) * ratio)
        return (length * np.sqrt(crossed / squared) if squared > 0 else np.inf), len(like)

    def mean(self) -> tuple[FloatArray, FloatArray]:
        covariance: FloatArray = np.asarray(np.linalg.inv(self._information), dtype=np.float64)
        return covariance @ self._weighed, covariance


def _worst(covariance: FloatArray) -> float:
    return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))


def _series(figure: Any, title: str, unit: Literal["mm", "deg"], measured: Sequence[Measured]) -> DriftSeries:
    chart = charted(measured)
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


def _tool_point(session: SolvedSession, answer: Mapping[str, Any], point: FloatArray) -> Measured:
    """Return where a point of L lies on the flange."""
    answer, tool = as_used(answer), scanner_frame(answer)
    follows = np.hstack([-tool.rotation @ skew(point), np.eye(3)])
    covariance = follows @ np.array(answer["covariance"], dtype=float) @ follows.T
    return Measured(session, tool.apply(point), _regular(covariance))


def _turns(answers: Sequence[tuple[SolvedSession, Mapping[str, Any]]]) -> list[Measured]:
    """Return how each session's scanner is turned against the first one's, degrees about its axes."""
    tools = [scanner_frame(answer) for _, answer in answers]
    return [
        Measured(
            session,
            np.rad2deg(vector_from_rotation(tools[0].rotation.T @ tool.rotation)),
            _regular(np.array(answer["covariance"], dtype=float)[:3, :3] * np.rad2deg(1) ** 2),
        )
        for (session, answer), tool in zip(answers, tools, strict=True)
    ]


_Table = tuple[RigidTransform, FloatArray]


def _table(session: SolvedSession) -> _Table | None:
    """Return base_from_turntable and its covariance (6, 6), None without one that holds."""
    chain, table = session.of("chain"), session.of("turntable")
    found = chain or table
    if found is None or found.get("verdict") == "fail" or "base_from_turntable" not in found:
        return None
    found, frame = as_used(found), placed_table(found)
    covariance = found.get("turntable_covariance") if chain else found.get("covariance")
    if covariance is None:
        return None
    return frame, np.array(covariance, dtype=float)


def _axes(
    tables: Sequence[tuple[SolvedSession, _Table]],
    figure: Callable[[RigidTransform, FloatArray, RigidTransform], tuple[FloatArray, FloatArray]],
) -> list[Measured]:
    return [
        Measured(session, *figure(frame, covariance, tables[0][1][0])) for session, (frame, covariance) in tables
    ]


def _axis_point(
    frame: RigidTransform, covariance: FloatArray, first: RigidTransform
) -> tuple[FloatArray, FloatArray]:
    """Return where the axis passes the plane through the first one's origin, across it (2,)."""
    across = first.rotation[:, :2].T
    local = first.inverse().apply(frame.translation_mm)
    direction = first.rotation.T @ frame.rotation[:, 2]
    place = local[:2] - direction[:2] / direction[2] * local[2]
    follows = np.hstack([np.zeros((2, 3)), across])
    follows[:, :3] = across @ (-frame.rotation @ skew(np.array([0.0, 0.0, -local[2]])))
    return place, _regular(follows @ covariance @ follows.T)


def _axis_direction(
    frame: RigidTransform, covariance: FloatArray, first: RigidTransform
) -> tuple[FloatArray, FloatArray]:
    """Return how the axis is tilted against the first one (2,), degrees."""
    across = first.rotation[:, :2].T
    follows = across @ (-frame.rotation @ skew(np.array([0.0, 0.0, 1.0])))
    degrees = float(np.rad2deg(1))
    spread = follows @ covariance[:3, :3] @ follows.T * degrees**2
    return np.rad2deg(across @ frame.rotation[:, 2]), _regular(spread)


def _verified(session: SolvedSession) -> Measured | None:
    checks = (session.of("verify") or {}).get("checks") or []
    found = next((check for check in checks if check["name"] == "tool"), None)
    if found is None:
        return None
    sigma = max(float(found["uncertainty_mm"]) / 2, _LEAST_SIGMA)
    # Its captures are others than those of the answer: of its poses nothing is known here.
    alone = replace(session, program=None)
    return Measured(alone, np.array([float(found["value_mm"])]), np.array([[sigma**2]]))


def _regular(covariance: FloatArray) -> FloatArray:
    """Return a covariance that can be inverted."""
    return covariance + _LEAST_SIGMA**2 * np.eye(len(covariance))
