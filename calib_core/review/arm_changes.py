"""Which joints' zeros moved from session to session: each held against all that those before tell of the arm.

That one zero moved and the arm is the same otherwise is told far better than each session tells a zero by itself:
links and other zeros, which are told together with it, are the same ones in both.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from calib_core.arms.errors import places_of_zeros
from calib_core.frames import FloatArray
from calib_core.records.results import ArmTerms
from calib_core.review.between_sessions import Measured, SolvedSession

_GEARS_DEG: Final = 0.015
"""Gears put so much into a joint's zero, by the poses: the model of the arm has no gears."""
_LOOSE: Final = 1.5  # arms' errors over what is believed of them
_UNKNOWN: Final = 100.0  # of a change of a zero


@dataclass(frozen=True)
class ZeroChange:
    """By how much a joint's zero moved, deg, ± (1 σ), and beyond what it is a change (None: the first session)."""

    change_deg: float
    sigma_deg: float
    limit_deg: float | None
    moved: bool


def joint_zeros(answers: Sequence[tuple[SolvedSession, Mapping[str, Any]]]) -> dict[int, list[Measured]]:
    """Return the zeros, deg, of joints as the sessions tell the arm's errors, by the joint's number."""
    found: dict[int, list[Measured]] = {}
    for session, answer in answers:
        terms = list(_terms(answer.get("arm_model")))
        for joint, place in places_of_zeros([name for name, _, _ in terms]).items():
            _, value, sigma = terms[place]
            one = Measured(session, np.array([value]), np.array([[sigma**2 + _GEARS_DEG**2]]))
            found.setdefault(joint, []).append(one)
    return found


def _terms(model: Mapping[str, Any] | None) -> Iterable[tuple[str, float, float]]:
    """Return names, values and standard deviations, also of members that the likelihood left out."""
    if not model:
        return ()
    if not model.get("told"):
        return zip(model["names"], model["values"], model["sigmas"], strict=True)
    told = ArmTerms.model_validate(model["told"])
    covariance, believed = _Known.of(told).covariance(), np.array(told.believed)
    values, sigmas = covariance @ told.vector * believed, np.sqrt(np.diag(covariance)) * believed
    return zip(told.names, values.tolist(), sigmas.tolist(), strict=True)


def zero_changes(answers: Sequence[Mapping[str, Any]], false_alarm: float) -> dict[int, list[ZeroChange]]:
    """Return each joint's changes over the sessions that tell an arm's errors, by its number.

    Empty where a session does not tell what it is held against, or tells it of another arm.

    Parameters
    ----------
    answers : sequence of mapping
        Results in order.
    false_alarm : float
        The share of sessions of an arm that did not change in which a joint may be said to have moved.
    """
    models = [model for answer in answers if (model := answer.get("arm_model"))]
    told = [ArmTerms.model_validate(model["told"]) for model in models if model.get("told")]
    if not told or len(told) < len(models) or any(one.believed != told[0].believed for one in told):
        return {}
    from scipy.special import chdtri  # late: it brings what takes a third of a second

    zeros = places_of_zeros(told[0].names)
    if not zeros:
        return {}
    places, believed = list(zeros.values()), np.array(told[0].believed)
    beyond = float(np.sqrt(chdtri(1, false_alarm / len(places))))
    before = _Known.of(told[0])
    alone = np.sqrt(np.diag(before.covariance()))
    rows = {place: [ZeroChange(0.0, float(alone[place] * believed[place]), None, False)] for place in places}
    for now in map(_Known.of, told[1:]):
        moved: list[int] = []
        while True:
            found = {place: before.change(now, place, moved) for place in places}
            chart = {place: _charted(*found[place], believed[place], beyond) for place in places}
            left = [place for place in places if chart[place].moved and place not in moved]
            if not left:
                break
            moved.append(max(left, key=lambda place: abs(found[place][0]) / found[place][1]))
        for place in places:
            rows[place].append(chart[place])
        before = now if moved else before.with_other(now)
    return {number: rows[place] for number, place in zeros.items()}


def _charted(change: float, sigma: float, believed: float, beyond: float) -> ZeroChange:
    spread = float(np.hypot(sigma * believed, np.sqrt(2) * _GEARS_DEG))
    size = abs(change) * float(believed)
    return ZeroChange(size, spread, beyond * spread, size > beyond * spread)


@dataclass(frozen=True, eq=False)
class _Known:
    """What sessions tell of one arm: information (p, p) and vector (p,)."""

    information: FloatArray
    vector: FloatArray

    @classmethod
    def of(cls, told: ArmTerms) -> "_Known":
        return cls(np.array(told.information), np.array(told.vector))

    def covariance(self) -> FloatArray:
        """Return the covariance (p, p) of the terms with what is believed of them."""
        return np.asarray(np.linalg.inv(self.information + np.eye(len(self.vector)) / _LOOSE**2), dtype=float)

    def with_other(self, other: "_Known") -> "_Known":
        return _Known(self.information + other.information, self.vector + other.vector)

    def change(self, now: "_Known", place: int, moved: Sequence[int]) -> tuple[float, float]:
        """Return by how much a term is another one now, and its standard deviation; some others may have moved."""
        free = [*(one for one in moved if one != place), place]
        both, count = self.with_other(now), len(self.vector)
        hessian = np.zeros((count + len(free), count + len(free)))
        hessian[:count, :count] = both.information + np.eye(count) / _LOOSE**2
        hessian[:count, count:], hessian[count:, :count] = now.information[:, free], now.information[free]
        hessian[count:, count:] = now.information[np.ix_(free, free)] + np.eye(len(free)) / _UNKNOWN**2
        covariance = np.linalg.inv(hessian)
        found = covariance @ np.concatenate([both.vector, now.vector[free]])
        return float(found[-1]), float(np.sqrt(covariance[-1, -1]))
