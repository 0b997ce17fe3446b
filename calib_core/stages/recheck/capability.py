"""Capability of a cell by its rechecks: repeatability, and Cg and Cgk against a tolerance."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from calib_core.evidence.numbers import fixed
from calib_core.messages import message
from calib_core.records import Session
from calib_core.records.evidence import AnyBlock, Column, Row, Table
from calib_core.stages.recheck.record import RecheckRound

_LEAST_ROUNDS: Final = 3
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


def capability_table(session: Session, rounds: Sequence[RecheckRound]) -> list[AnyBlock]:
    """Return the table of three rounds or more of a cell that has a limit of the tool's error, or wants one."""
    limit_mm = session.cell.verification.tool_mm or session.cell.wanted_mm
    if limit_mm is None or len(rounds) < _LEAST_ROUNDS:
        return []
    repeatability, bias, cg, cgk = capability(rounds, 2 * limit_mm)
    return [
        Table(
            id="capability",
            title="Capability",
            caption=message(
                "Of {count} rounds, along the scanner's worst axis; the tolerance is ± {limit:g} mm. "
                "Cg = 0.2 T / (6 s), Cgk = (0.1 T − bias) / (3 s); 1.33 is what is usually asked for, "
                "of 25 rounds or more.",
                count=len(rounds),
                limit=limit_mm,
            ),
            columns=[
                Column(label="Repeatability s", align="left"),
                Column(label="Bias"),
                Column(label="Cg"),
                Column(label="Cgk"),
            ],
            rows=[Row(cells=[fixed(repeatability, 4, "mm"), fixed(bias, 4, "mm"), fixed(cg, 2), fixed(cgk, 2)])],
        )
    ]
