"""What the answer of a table has no room for: a wobble (`table_patterns.py`), or a move on the way.

Both look like each other; the one that chance explains less is named, unless a way that is an oval explains more:
seven real positioners were "pushed" at the same angle.  The answer is less sure by what it did, also where so much
is not rare enough to be said.
"""

from dataclasses import dataclass

import numpy as np

from calib_core.chain.rejection import Judged
from calib_core.chain.score import Scores
from calib_core.chain.table_moves import TableMove, table_move_of
from calib_core.chain.table_patterns import Pattern, pattern_of, rarity_of_oval
from calib_core.frames import FloatArray

_DOUBTED = 50.0
"""From so many times what may be said falsely on: two or three sound tables in a hundred are less sure for it."""


@dataclass(frozen=True, eq=False)
class TableErrors:
    """The pattern or the move that is said, and a covariance (P, P) of the edges' unknowns by what it did."""

    pattern: Pattern | None
    move: TableMove | None
    spread: FloatArray


def table_errors_of(judged: Judged, count: int, known: Pattern | None = None) -> TableErrors:
    """Return what captures of tables, the last `count` of those judged, show beyond the answer.

    `known`: the pattern that they said alone.
    """
    scores = Scores.of(judged)
    pattern, move = pattern_of(judged, scores, known), table_move_of(judged, count, scores)
    some = [one for one in (pattern, move) if one is not None]
    likeliest = min(some, key=lambda one: (not one.said, one.rarity), default=None)
    if likeliest is None or likeliest.rarity > _DOUBTED:
        return TableErrors(None, None, np.zeros((judged.data.width, judged.data.width)))
    named = likeliest.said and likeliest.rarity <= rarity_of_oval(judged, scores)
    return TableErrors(
        pattern if likeliest is pattern and named else None,
        move if likeliest is move and named else None,
        likeliest.share * np.outer(likeliest.step, likeliest.step),
    )
