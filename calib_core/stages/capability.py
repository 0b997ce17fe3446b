"""Capability of a cell by rechecks or repeated captures: repeatability, and Cg and Cgk against a tolerance."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from calib_core.evidence.numbers import fixed
from calib_core.frames import FloatArray
from calib_core.messages import Message, message, sentences
from calib_core.records import Session
from calib_core.records.evidence import AnyBlock, Column, Row, Table
from calib_core.stages.recheck.record import RecheckRound

LEAST_REPEATED: Final = 3
"""Rounds, or captures of one pose."""
_SHARE_OF_TOLERANCE: Final = 0.2
"""Of the tolerance, that six standard deviations are held against."""


def capability(rounds: Sequence[RecheckRound], tolerance_mm: float) -> tuple[float, float, float, float]:
    """Return repeatability (s) and bias in mm, Cg and Cgk.

    Parameters
    ----------
    rounds : sequence of RecheckRound
        Two at least.
    tolerance_mm : float
        The whole width.

    Notes
    -----
    Cg = 0.2 T / (6 s) and Cgk = (0.1 T − |bias|) / (3 s), with s and bias along the scanner's axis that is worst:
    s is that of the rounds' changes about their mean, bias the mean itself, which is how far the cell is from its
    calibration.
    """
    changes = np.array([one.change_in_laser_mm for one in rounds])
    spreads, biases = changes.std(axis=0, ddof=1), np.abs(changes.mean(axis=0))
    half = _SHARE_OF_TOLERANCE * tolerance_mm / 2
    worst = int(np.argmin((half - biases) / spreads))
    return (
        float(spreads.max()),
        float(biases.max()),
        float(half / (3 * spreads.max())),
        float((half - biases[worst]) / (3 * spreads[worst])),
    )


def capability_of_repeated(
    groups: Sequence[FloatArray], bias_mm: float, tolerance_mm: float
) -> tuple[float, float, float, float]:
    """Return the same of captures of one pose or several, each taken more than once.

    Parameters
    ----------
    groups : sequence of (N, 3)
        Where the captures of each pose saw the sphere's centre; s is that about the mean of each.
    bias_mm : float
        How far the cell is from its calibration.
    tolerance_mm : float
        The whole width.
    """
    squares = sum(np.square(one - one.mean(axis=0)).sum(axis=0) for one in groups)
    spread = float(np.sqrt(np.max(squares / sum(len(one) - 1 for one in groups))))
    half = _SHARE_OF_TOLERANCE * tolerance_mm / 2
    return spread, bias_mm, half / (3 * spread), (half - bias_mm) / (3 * spread)


def tolerance_of(session: Session) -> float | None:
    """Return the limit of the tool's error, or the error that is wanted, half of the tolerance; else None."""
    return session.cell.verification.tool_mm or session.cell.wanted_mm


def capability_of_rounds(session: Session, rounds: Sequence[RecheckRound]) -> list[AnyBlock]:
    """Return the table of three rounds or more of a cell that has a limit of the tool's error, or wants one."""
    limit_mm = tolerance_of(session)
    if limit_mm is None or len(rounds) < LEAST_REPEATED:
        return []
    of = message("Of {count} rounds, along the scanner's worst axis.", count=len(rounds))
    return capability_table(of, capability(rounds, 2 * limit_mm), limit_mm)


def capability_table(of: Message, found: tuple[float, float, float, float], limit_mm: float) -> list[AnyBlock]:
    """Return repeatability, bias, Cg and Cgk as a table; `of` says what they were found from."""
    repeatability, bias, cg, cgk = found
    rule = message(
        "The tolerance is ± {limit:g} mm. Cg = 0.2 T / (6 s), Cgk = (0.1 T − bias) / (3 s); 1.33 is usually "
        "asked for, of 25 or more.",
        limit=limit_mm,
    )
    return [
        Table(
            id="capability",
            title="Capability",
            caption=sentences([of, rule]),
            columns=[
                Column(label="Repeatability s", align="left"),
                Column(label="Bias"),
                Column(label="Cg"),
                Column(label="Cgk"),
            ],
            rows=[Row(cells=[fixed(repeatability, 4, "mm"), fixed(bias, 4, "mm"), fixed(cg, 2), fixed(cgk, 2)])],
        )
    ]
