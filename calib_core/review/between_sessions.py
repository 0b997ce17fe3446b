"""How much sessions of one program of poses scatter: errors that they share, as most of an arm's, are no scatter.

A stated ± holds for any poses.  From night to night the same arm errs alike at the same poses, so that answers
agree far better than their ±, and far smaller changes can be told.  How well is estimated from the sessions
themselves, in the direction in which they scatter most; where they are few, or of other poses, the stated ± is all
that is known.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from calib_core.captures.poses import middle_pose
from calib_core.errors import InputError
from calib_core.frames import FloatArray
from calib_core.records import ResultsData, Session
from calib_core.records.policy import Environment, Equipment
from calib_core.review.common_errors import Common

LEAST_LIKE: Final = 5
"""So many sessions of one program must be there before their scatter counts."""
_LEAST_RATIO: Final = 0.0025
"""Of the stated variance: results that repeat themselves to the last digit promise nothing for the next."""
_ALIKE_MM, _ALIKE_RAD = 5.0, 0.01
"""Poses so near have the same errors of the arm: those change over 400 mm and 0.5 rad (`arms.alike`)."""


@dataclass(frozen=True, eq=False)
class SolvedSession:
    """A session of a cell: its latest results as JSON data, when they were solved, and which of them are stale.

    `limit_mm` is that of the tool's error, where the cell has one; `environment` the temperatures that were told;
    `program` the flange's poses (K, 4, 4) that the answer rests on, None where they are not known; `equipment`
    says which scanner and ball there were, as far as the cell tells.
    """

    session: str
    name: str
    date: str
    results: ResultsData
    stale: frozenset[str] = frozenset()
    limit_mm: float | None = None
    environment: Environment | None = None
    program: FloatArray | None = None
    equipment: tuple[str, ...] = ()

    def of(self, stage: str) -> Mapping[str, Any] | None:
        """Return a stage's result, None without one that its captures and its cell still give."""
        return None if stage in self.stale else self.results.get(stage)

    @property
    def answer(self) -> Mapping[str, Any] | None:
        """The whole chain or, without one, the tool."""
        return self.of("chain") or self.of("tcp")


@dataclass(frozen=True, eq=False)
class Measured:
    """A figure of one session: its value (n,) and covariance (n, n), and what it shares with other sessions."""

    session: SolvedSession
    value: FloatArray
    covariance: FloatArray
    common: Common | None = None


@dataclass(frozen=True, eq=False)
class Together:
    """Sessions in one linear model: values (N, n), designs (N, n, q), covariances (N, n, n), prior (q, q).

    The prior is the information about the unknowns before any session: about the common errors, the last of them.
    """

    values: FloatArray
    designs: FloatArray
    covariances: FloatArray
    prior: FloatArray

    def informing(self) -> tuple[FloatArray, FloatArray]:
        """Return the information (N, q, q) that each session adds, and its value so weighed (N, q)."""
        weights = np.swapaxes(self.designs, 1, 2) @ np.linalg.inv(self.covariances)
        return weights @ self.designs, (weights @ self.values[:, :, None])[:, :, 0]


def together(measured: Sequence[Measured], of: Common | None, places: FloatArray) -> Together:
    """Return sessions in one model: a figure along `places` (N, p), and the errors common to the equipment `of`.

    Sessions of other equipment count by their whole ±, as if nothing were shared.
    """
    size, some = len(measured[0].value), 0 if of is None else len(of.belief)
    told = [
        (one.common.value, one.common.by, one.common.own)
        if of is not None and one.common is not None and one.common.equipment == of.equipment
        else (one.value, np.zeros((size, some)), one.covariance)
        for one in measured
    ]
    values, by, covariances = (np.array(column) for column in zip(*told, strict=True))
    along = np.kron(places[:, None, :], np.eye(size))
    prior = np.zeros((along.shape[2] + some,) * 2)
    if of is not None:
        prior[-some:, -some:] = np.linalg.inv(of.belief)
    designs = np.asarray(np.concatenate([along, by], axis=2), dtype=np.float64)
    return Together(values, designs, covariances, prior)


def solved_session(
    identifier: str, date: str, session: Session, results: ResultsData, stale: frozenset[str], unnamed: str = ""
) -> SolvedSession:
    """Return a session as drift takes it, with the poses that its answer rests on."""
    found = SolvedSession(
        session=identifier,
        name=session.name or unnamed,
        date=date,
        results=results,
        stale=stale,
        limit_mm=session.cell.verification.tool_mm,
        environment=session.environment,
        equipment=_scanner_and_ball(session),
    )
    return replace(found, program=_program(session, found.answer))


def _scanner_and_ball(session: Session) -> tuple[str, ...]:
    pieces: list[Equipment] = session.cell.equipment or []
    serials = [f"{one.kind} {one.serial}" for one in pieces if one.kind in ("scanner", "sphere")]
    return (f"{session.cell.sphere_diameter_mm}", *sorted(serials))


def _program(session: Session, answer: Mapping[str, Any] | None) -> FloatArray | None:
    used = {row["capture"] for row in (answer or {}).get("residuals") or () if row["used"]}
    captures = [capture for capture in session.captures if capture.id in used]
    try:
        return np.array([middle_pose(session.cell, one).matrix for one in captures]) if captures else None
    except InputError:
        return None


def like_last(measured: Sequence[Measured]) -> list[tuple[int, Measured]]:
    """Return those that are of the last one's program of poses, each with its place; the last is among them."""
    last = measured[-1].session.program
    return [(k, one) for k, one in enumerate(measured) if one is measured[-1] or _alike(one.session.program, last)]


def _alike(program: FloatArray | None, other: FloatArray | None) -> bool:
    if program is None or other is None or program.shape != other.shape:
        return False
    if program is other:
        return True
    apart_mm = np.linalg.norm(program[:, :3, 3] - other[:, :3, 3], axis=1)
    # |A − B| of two rotations is √8 · sin(angle / 2).
    apart_rad = np.linalg.norm(program[:, :3, :3] - other[:, :3, :3], axis=(1, 2)) / np.sqrt(2)
    return bool(np.all(apart_mm < _ALIKE_MM) and np.all(apart_rad < _ALIKE_RAD))


def scatter_ratio(residuals: FloatArray, freedom: int) -> float:
    """Return how large the scatter's variance is to the stated one, in the direction in which that is most.

    Parameters
    ----------
    residuals : (N, n)
        Of the sessions' figures, in the stated standard deviations.
    freedom : int
        What they have left.
    """
    return max(float(np.linalg.eigvalsh(residuals.T @ residuals / freedom)[-1]), _LEAST_RATIO)


def in_sigmas(values: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return rows (N, n) in the standard deviations of a covariance (n, n)."""
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), np.atleast_2d(values).T).T
    return np.asarray(whitened, dtype=np.float64)


def held_against_like(one: Measured, like: Sequence[Measured]) -> tuple[float, float]:
    """Return a session's squared distance from the mean of others of its program, and their scatter's ratio."""
    before = np.array([other.value for other in like])
    mean, count = before.mean(axis=0), len(before)
    (change,) = in_sigmas(one.value - mean, one.covariance)
    rows = in_sigmas(before - mean, one.covariance)
    return float(change @ change) / (1 + 1 / count), scatter_ratio(rows, count - 1)
