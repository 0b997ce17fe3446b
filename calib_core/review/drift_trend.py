"""How a figure creeps from session to session: slope, cumulative sum, forecast, and what temperature explains."""

from collections.abc import Sequence
from datetime import datetime
from typing import Final

import numpy as np

from calib_core.estimation import chance_of, f_chance_of
from calib_core.frames import FloatArray
from calib_core.messages import message, sentences
from calib_core.moment import text_of
from calib_core.records import Finite, Record
from calib_core.review.between_sessions import (
    LEAST_LIKE,
    Measured,
    SolvedSession,
    in_sigmas,
    like_last,
    scatter_ratio,
    together,
)

FALSE_TREND: Final = 0.013
_FALSE_BY_TEMPERATURE: Final = 0.005
_LEAST_OF_TREND: Final = 4
_SLACK: Final = 0.5
_ALARM: Final = {1: 7.05, 2: 9.13, 3: 10.94}
"""The sum that one in a hundred quiet series of sixty sessions reaches, by the figure's degrees of freedom."""
_LEAST_RANGE_K: Final = 2.0
_MOST_DAYS: Final = 3650.0
_TEMPERATURES: Final = {
    "arm_c": message("the arm's temperature"),
    "air_c": message("the air's temperature"),
    "ball_c": message("the sphere's temperature"),
}


class DriftForecast(Record):
    """When the trend reaches a limit: in how many sessions, at the earliest (slope + its ±), on which day."""

    limit_mm: Finite
    sessions: int
    earliest_sessions: int
    date: str | None = None


class DriftTrend(Record):
    """A straight line through the sessions since the last step: its slope a session, ± `uncertainty` (k = 2).

    `chance` is how often sessions without a trend show as much; `found` where that is rare, or where the
    cumulative sum of the changes (`cusum`, in standard deviations) exceeds its limit.
    """

    per_session: Finite
    uncertainty: Finite
    chance: Finite
    sessions: int
    found: bool
    cusum: Finite = 0.0
    cusum_limit: Finite = 0.0
    forecast: DriftForecast | None = None


class ByTemperature(Record):
    """How a figure follows a temperature that was told, a kelvin, ± `uncertainty` (k = 2)."""

    of: str
    per_k: Finite
    uncertainty: Finite
    chance: Finite
    found: bool


def trend_of(measured: Sequence[Measured]) -> DriftTrend | None:
    """Return a straight line through sessions by generalised least squares; None of fewer than four.

    Its slope's squared length in sigmas is of as many degrees of freedom as the figure has.
    """
    count = len(measured)
    if count < _LEAST_OF_TREND:
        return None
    slope, uncertainty, chance = _slope(measured, np.arange(count, dtype=np.float64) - (count - 1) / 2)
    cusum, limit = cusum_of(measured), _ALARM[min(len(measured[0].value), 3)]
    return DriftTrend(
        per_session=slope,
        uncertainty=uncertainty,
        chance=chance,
        sessions=count,
        found=chance < FALSE_TREND or cusum > limit,
        cusum=cusum,
        cusum_limit=limit,
    )


def cusum_of(measured: Sequence[Measured]) -> float:
    """Return the largest cumulative sum (Crosier's) of each session's change from the mean of those before.

    The changes, in their standard deviations, are independent where nothing changes.
    """
    seen = together(measured, measured[0].common, np.ones((len(measured), 1)))
    information, weighed = seen.informing()
    # Of those before each: what they know together, and what they expect.
    known = np.linalg.inv(seen.prior + np.cumsum(information, axis=0)[:-1])
    designs = seen.designs[1:]
    expected = designs @ known @ np.cumsum(weighed, axis=0)[:-1, :, None]
    spreads = seen.covariances[1:] + designs @ known @ np.swapaxes(designs, 1, 2)
    changes = np.linalg.solve(np.linalg.cholesky(spreads), seen.values[1:, :, None] - expected)[:, :, 0]
    total, most = np.zeros(changes.shape[1]), 0.0
    for change in changes:
        total = total + change
        length = float(np.linalg.norm(total))
        total = total * max(0.0, 1 - _SLACK / length) if length else total
        most = max(most, float(np.linalg.norm(total)))
    return most


def forecast(trend: DriftTrend, measured: Sequence[Measured]) -> DriftForecast | None:
    """Return when the line meets the newest session's limit, counted from the newest session."""
    limit = measured[-1].session.limit_mm
    if limit is None or not trend.found or trend.per_session <= 0:
        return None
    past = len(measured) - 1
    left, earliest = (
        max(0, int(np.ceil(limit / slope)) - past)
        for slope in (trend.per_session, trend.per_session + trend.uncertainty)
    )
    return DriftForecast(
        limit_mm=limit, sessions=left, earliest_sessions=earliest, date=_day_after(measured, left)
    )


def by_temperature(measured: Sequence[Measured]) -> ByTemperature | None:
    """Return how a figure follows the arm's, the air's or the sphere's temperature; None where it is not told.

    It takes four sessions that tell one of them, over at least 2 K.
    """
    for name in _TEMPERATURES:
        told = [(one, float(value)) for one in measured if (value := _temperature(one.session, name)) is not None]
        values = np.array([value for _, value in told])
        if len(told) < _LEAST_OF_TREND or np.ptp(values) < _LEAST_RANGE_K:
            continue
        slope, uncertainty, chance = _slope([one for one, _ in told], values - values.mean())
        return ByTemperature(
            of=name, per_k=slope, uncertainty=uncertainty, chance=chance, found=chance < _FALSE_BY_TEMPERATURE
        )
    return None


def said_trend(title: str, unit: str, trend: DriftTrend | None) -> str:
    """Return what is said of a trend, nothing where there is none."""
    if trend is None or not trend.found:
        return ""
    unit, digits = ("mm", 3) if unit == "mm" else ("°", 4)
    told = message(
        "{title} creeps by {per_session:.{digits}f} ± {uncertainty:.{digits}f} {unit} a session over "
        "{sessions} sessions.",
        title=title,
        per_session=trend.per_session,
        uncertainty=trend.uncertainty,
        unit=unit,
        digits=digits,
        sessions=trend.sessions,
    )
    return sentences([told, _said_forecast(trend.forecast)])


def said_by_temperature(title: str, unit: str, found: ByTemperature | None) -> str:
    """Return what is said of a figure that follows a temperature, nothing where none does."""
    if found is None or not found.found:
        return ""
    unit, digits = ("mm", 4) if unit == "mm" else ("°", 5)
    return message(
        "{title} follows {what}: {per_k:.{digits}f} ± {uncertainty:.{digits}f} {unit} per kelvin.",
        title=title,
        what=_TEMPERATURES[found.of],
        per_k=found.per_k,
        uncertainty=found.uncertainty,
        unit=unit,
        digits=digits,
    )


def _said_forecast(found: DriftForecast | None) -> str:
    if found is None:
        return ""
    day = "" if found.date is None else message("At this pace that is about {day}.", day=found.date[:10])
    told = message(
        "It reaches the limit of {limit:g} mm after {count} more sessions, at the earliest after {earliest}.",
        limit=found.limit_mm,
        count=found.sessions,
        earliest=found.earliest_sessions,
    )
    return sentences([told, day])


_Slope = tuple[float, float, float]
"""The length of a figure's slope over places, its ± (k = 2), and how often chance gives as much."""


def _slope(measured: Sequence[Measured], places: FloatArray) -> _Slope:
    """Return the slope by the stated covariances, or by the scatter of sessions of the newest's program."""
    like = like_last(measured)
    by_stated = _slope_as_stated(measured, places)
    if len(like) < LEAST_LIKE or float(np.ptp(at := places[[k for k, _ in like]])) == 0:
        return by_stated
    by_scatter = _slope_by_scatter([one for _, one in like], at - at.mean())
    slope, uncertainty, chance = min(by_stated, by_scatter, key=lambda found: found[2])
    return slope, uncertainty, min(1.0, 2 * chance)  # the better of two


def _slope_by_scatter(like: Sequence[Measured], places: FloatArray) -> _Slope:
    covariance = np.mean([one.covariance for one in like], axis=0)
    values, known = np.array([one.value for one in like]), float(places @ places)
    rows = in_sigmas(values - values.mean(axis=0), covariance)
    slope, left = places @ rows / known, len(like) - 2
    ratio = scatter_ratio(rows - np.outer(places, slope), left)
    uncertainty = 2 * float(np.sqrt(ratio * np.linalg.eigvalsh(covariance)[-1] / known))
    chance = f_chance_of(float(slope @ slope) * known / ratio, 1, left)
    return float(np.linalg.norm(places @ values / known)), uncertainty, chance


def _slope_as_stated(measured: Sequence[Measured], places: FloatArray) -> _Slope:
    size = len(measured[0].value)
    seen = together(measured, measured[0].common, np.column_stack([np.ones(len(places)), places]))
    information, weighed = seen.informing()
    covariance = np.linalg.inv(seen.prior + information.sum(axis=0))
    slopes = slice(size, 2 * size)
    slope, spread = (covariance @ weighed.sum(axis=0))[slopes], covariance[slopes, slopes]
    chance = chance_of(float(slope @ np.linalg.solve(spread, slope)), size)
    return float(np.linalg.norm(slope)), 2 * float(np.sqrt(np.linalg.eigvalsh(spread)[-1])), chance


def _temperature(session: SolvedSession, name: str) -> float | None:
    return None if session.environment is None else getattr(session.environment, name)


def _day_after(measured: Sequence[Measured], sessions: int) -> str | None:
    """Return the day so many sessions after the newest, at the pace of these; None where that is not known."""
    try:
        first, last = (datetime.fromisoformat(measured[k].session.date) for k in (0, -1))
        pace = (last - first) / (len(measured) - 1)
    except (ValueError, TypeError):
        return None
    days = pace.total_seconds() * sessions / 86400
    return None if not 0 < days < _MOST_DAYS else text_of(last + pace * sessions)
