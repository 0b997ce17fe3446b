"""How a cell's answers moved from session to session: control charts of tool, axis and verification.

Every figure of a session is held against the mean of those before it, weighed by their covariances.  A difference
that the uncertainties explain in fewer than 0.06 % of cases is flagged, so that a series of thirty raises a false
alarm in fewer than 2 %; from there on the series has a new level.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from pydantic import Field

from calib_core.cell.found import as_used, placed_table, scanner_frame
from calib_core.errors import InputError
from calib_core.estimation import chance_of
from calib_core.frames import FloatArray, RigidTransform, skew, vector_from_rotation
from calib_core.messages import message
from calib_core.records import Finite, Record
from calib_core.steps import tool_stages

FALSE_ALARM: Final = 6e-4
FALSE_TREND: Final = 0.012
_LEAST_SIGMA: Final = 1e-9
_LEAST_OF_TREND: Final = 4


class DriftPoint(Record):
    """One session in a series: how far its figure lies from the mean of those before, ± `uncertainty` (k = 2).

    `limit` is the control limit in the direction of the change, null for the first of a level.  `level` counts the
    levels: a flagged session begins another.
    """

    session: str
    name: str
    date: str
    change: Finite
    uncertainty: Finite
    limit: Finite | None
    flagged: bool
    level: int


class DriftTrend(Record):
    """A straight line through the sessions since the last step: its slope a session, ± `uncertainty` (k = 2).

    `chance` is how often sessions without a trend show as much; `found` where that is rare.
    """

    per_session: Finite
    uncertainty: Finite
    chance: Finite
    sessions: int
    found: bool


class DriftSeries(Record):
    """A figure over a cell's sessions, the oldest first; `trend` is that since the last step."""

    figure: Literal["tool", "tool-orientation", "axis", "axis-direction", "verification"]
    title: str
    unit: Literal["mm", "deg"]
    points: list[DriftPoint]
    trend: DriftTrend | None = None


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

    `trends` has one for each figure that creeps: a warning, no fault.

    `left_out` says which sessions do not count, and why; `within` how far each drifted while it was captured.
    """

    series: list[DriftSeries]
    flags: list[str] = Field(default_factory=list[str])
    trends: list[str] = Field(default_factory=list[str])
    left_out: dict[str, str] = Field(default_factory=dict[str, str])
    within: list[DriftWithin] = Field(default_factory=list[DriftWithin])


@dataclass(frozen=True, eq=False)
class SolvedSession:
    """A session of a cell: its latest results as JSON data, when they were solved, and which of them are stale."""

    session: str
    name: str
    date: str
    results: Mapping[str, Mapping[str, Any]]
    stale: frozenset[str] = frozenset()

    def of(self, stage: str) -> Mapping[str, Any] | None:
        """Return a stage's result, None without one that its captures and its cell still give."""
        return None if stage in self.stale else self.results.get(stage)

    @property
    def answer(self) -> Mapping[str, Any] | None:
        """The whole chain or, without one, the tool."""
        return self.of("chain") or self.of("tcp")


@dataclass(frozen=True, eq=False)
class Measured:
    """A figure of one session: its value (n,) and covariance (n, n)."""

    session: SolvedSession
    value: FloatArray
    covariance: FloatArray


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
    trends = [said for one in series if (said := _creeping(one))]
    return CellDrift(series=series, flags=flags, trends=trends, left_out=left_out, within=within)


def charted(measured: Sequence[Measured]) -> list[tuple[float, float, float | None, bool, int]]:
    """Return change, its uncertainty (k = 2), limit, whether it is flagged, and the level, of each in order."""
    from scipy.special import chdtri  # late: it brings what takes a third of a second

    rows: list[tuple[float, float, float | None, bool, int]] = []
    before = _Level()
    for one in measured:
        if not rows:
            rows.append((0.0, 2 * _worst(one.covariance), None, False, 1))
            before.add(one)
            continue
        mean, covariance = before.mean()
        change, spread = one.value - mean, one.covariance + covariance
        length, squared = float(np.linalg.norm(change)), float(change @ np.linalg.solve(spread, change))
        crossed = float(chdtri(len(change), FALSE_ALARM))
        limit = (length / np.sqrt(squared) if squared > 0 else _worst(spread)) * np.sqrt(crossed)
        flagged = squared > crossed
        rows.append((length, 2 * _worst(spread), float(limit), flagged, rows[-1][4] + flagged))
        before = _Level() if flagged else before
        before.add(one)
    return rows


class _Level:
    """Sessions between two changes: their mean, weighed by the covariances."""

    def __init__(self) -> None:
        self._information: FloatArray = np.zeros((1, 1))
        self._weighed: FloatArray = np.zeros(1)

    def add(self, one: Measured) -> None:
        information = np.linalg.inv(one.covariance)
        self._information = self._information + information
        self._weighed = self._weighed + information @ one.value

    def mean(self) -> tuple[FloatArray, FloatArray]:
        covariance: FloatArray = np.asarray(np.linalg.inv(self._information), dtype=np.float64)
        return covariance @ self._weighed, covariance


def _worst(covariance: FloatArray) -> float:
    return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))


def _series(figure: Any, title: str, unit: Literal["mm", "deg"], measured: Sequence[Measured]) -> DriftSeries:
    points = [
        DriftPoint(
            session=one.session.session,
            name=one.session.name,
            date=one.session.date,
            change=change,
            uncertainty=uncertainty,
            limit=limit,
            flagged=flagged,
            level=level,
        )
        for one, (change, uncertainty, limit, flagged, level) in zip(measured, charted(measured), strict=True)
    ]
    since = [one for one, point in zip(measured, points, strict=True) if point.level == points[-1].level]
    return DriftSeries(figure=figure, title=title, unit=unit, points=points, trend=trend_of(since))


def trend_of(measured: Sequence[Measured]) -> DriftTrend | None:
    """Return a straight line through sessions by generalised least squares; None of fewer than four.

    Its slope's squared length in sigmas is of as many degrees of freedom as the figure has.
    """
    count = len(measured)
    if count < _LEAST_OF_TREND:
        return None
    size = len(measured[0].value)
    information, weighed = np.zeros((2 * size, 2 * size)), np.zeros(2 * size)
    for place, one in enumerate(measured):
        design = np.hstack([np.eye(size), (place - (count - 1) / 2) * np.eye(size)])
        known = np.linalg.inv(one.covariance)
        information += design.T @ known @ design
        weighed += design.T @ known @ one.value
    covariance: FloatArray = np.asarray(np.linalg.inv(information), dtype=np.float64)
    slope, spread = (covariance @ weighed)[size:], covariance[size:, size:]
    chance = chance_of(float(slope @ np.linalg.solve(spread, slope)), size)
    length = float(np.linalg.norm(slope))
    return DriftTrend(
        per_session=length,
        uncertainty=2 * _worst(spread),
        chance=chance,
        sessions=count,
        found=chance < FALSE_TREND,
    )


def _creeping(series: DriftSeries) -> str:
    """Return what is said of a trend, nothing where there is none."""
    trend = series.trend
    if trend is None or not trend.found:
        return ""
    unit, digits = ("mm", 3) if series.unit == "mm" else ("°", 4)
    return message(
        "{title} creeps by {per_session:.{digits}f} ± {uncertainty:.{digits}f} {unit} a session over "
        "{sessions} sessions.",
        title=series.title,
        per_session=trend.per_session,
        uncertainty=trend.uncertainty,
        unit=unit,
        digits=digits,
        sessions=trend.sessions,
    )


def _flags(series: DriftSeries) -> list[str]:
    unit, digits = ("mm", 2) if series.unit == "mm" else ("°", 3)
    return [
        message(
            "{title} changed by {change:.{digits}f} ± {uncertainty:.{digits}f} {unit} with session "
            "{p}: more than uncertainty explains (limit {limit:.{digits}f} {unit}).",
            title=series.title,
            change=p.change,
            uncertainty=p.uncertainty,
            unit=unit,
            digits=digits,
            p=p.name or p.session,
            limit=p.limit,
        )
        for p in series.points
        if p.flagged and p.limit is not None
    ]


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
    return Measured(session, np.array([float(found["value_mm"])]), np.array([[sigma**2]]))


def _regular(covariance: FloatArray) -> FloatArray:
    """Return a covariance that can be inverted."""
    return covariance + _LEAST_SIGMA**2 * np.eye(len(covariance))
