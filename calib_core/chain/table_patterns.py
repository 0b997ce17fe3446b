"""Errors of a table that repeat with its angle: an axis that wobbles, an encoder that is eccentric.

Once a turn, an axis that leans with the table is part of the mounting, and one that leans in base is the axis;
twice and three times a turn are the bearing's.  Each adds unknowns to the normal equations at the answer; how much
likelier all captures get with them, and how large they are, follows from those (a score test).

A way that is an oval is no circle by a shift that turns against the table: an arm or a tracker whose scale differs
by direction draws it as well as a bearing, so it is not named; nor is what it looks like half a turn long, a push.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.rejection import Judged
from calib_core.chain.score import Scores, more_than_chance
from calib_core.estimation import chance_of
from calib_core.findings import Finding
from calib_core.findings.codes.turntable import AXIS_WOBBLES, ENCODER_ECCENTRIC
from calib_core.frames import FloatArray

_FAR_RAD = 5e-3
_FAR_MM = 1.0
_RARE = 0.0005  # of three patterns: one sound table in 700 is doubted
_LEAST_LEAN_RAD = 2e-4
_LEAST_ECCENTRIC_RAD = np.deg2rad(0.02)
_BEYOND_MM = 200.0
_LEAST_SPARE = 6  # captures beyond the unknowns that a pattern brings


@dataclass(frozen=True, eq=False)
class Pattern:
    """One pattern: what repeats, how often a turn, its amplitude, and what it did to the answer.

    `rarity`, `step` and `share` are as a `TableMove`'s, `chance` is how often so much comes of chance, whatever
    measures it.  `axis`: its name, where several carry balls.
    """

    kind: str
    times: int
    size_rad: float
    rarity: float
    chance: float
    step: FloatArray
    share: float
    axis: str = ""

    @property
    def said(self) -> bool:
        """Whether chance does not explain it and it is large enough to matter."""
        least = _LEAST_LEAN_RAD if self.kind == "wobble" else _LEAST_ECCENTRIC_RAD
        return self.chance < _RARE and self.size_rad > least

    @property
    def finding(self) -> Finding:
        """What is noticed of it."""
        size_deg = float(np.rad2deg(self.size_rad))
        if self.kind == "wobble":
            said = f"{self.times} of several" if self.axis else self.times
            return AXIS_WOBBLES(size_deg=size_deg, times=said, axis=self.axis)
        return ENCODER_ECCENTRIC(size_deg=size_deg, of="several" if self.axis else "one", axis=self.axis)


def pattern_of(judged: Judged, scores: Scores, known: Pattern | None) -> Pattern | None:
    """Return the pattern that chance explains least, None where captures are too few to show one.

    Parameters
    ----------
    judged : Judged
        Of captures of the table, with others or alone.
    scores : Scores
        Of the same.
    known : Pattern or None
        What captures of the table alone said, with others before them now: a tool that is free, and readings that
        seem to scatter, take up part of it.
    """
    layout = judged.data.walk.layout
    turning = [axis for axis in layout.carrying if layout.axes[axis].kind == "rotary"]
    each = [one for axis in turning for one in _patterns(judged, axis, scores, len(turning))]
    if known is not None:
        each = [
            replace(
                one,
                rarity=min(one.rarity, known.rarity),
                chance=min(one.chance, known.chance),
                share=max(one.share, known.share),
            )
            if (one.kind, one.times, one.axis) == (known.kind, known.times, known.axis)
            else one
            for one in each
        ]
    return min(each, key=lambda one: one.rarity, default=None)


def rarity_of_oval(judged: Judged, scores: Scores) -> float:
    """Return how rare by chance a ball's way on a table is an oval, as `Pattern.rarity`; inf where none tells."""
    layout, walk, at = judged.data.walk.layout, judged.data.walk, judged.fit.minimum.at
    tables = [axis for axis in layout.carrying if layout.axes[axis].kind == "rotary"]
    found: list[float] = []
    for table in tables:
        on_table = layout.rides[walk.place, table] & judged.used
        if np.count_nonzero(on_table) < 2 + _LEAST_SPARE:
            continue
        first, angle = layout.axis(table).start, walk.readings[:, table]
        x, y = at.jacobian[:, :, first + 2], at.jacobian[:, :, first + 3]
        cosine, sine = (np.cos(angle) * on_table)[:, None], (np.sin(angle) * on_table)[:, None]
        gain, _, _ = scores.gained(np.stack([x * cosine - y * sine, x * sine + y * cosine], axis=2), _FAR_MM)
        found.append(scores.chance(gain, 2) * len(tables) / _RARE)
    return min(found, default=np.inf)


def _patterns(judged: Judged, table: int, scores: Scores, tables: int) -> Iterator[Pattern]:
    at, data = judged.fit.minimum.at, judged.data
    layout, walk = data.walk.layout, data.walk
    assert at.levers is not None
    on_table = layout.rides[walk.place, table] & judged.used
    angle, by_angle = walk.readings[:, table], at.levers[:, :, table]
    leans = _leans(judged, table)
    trials = [("wobble", times, lean) for times in (2, 3) for lean in leans]
    for kind, times, moves in [*trials, ("encoder", 1, by_angle[:, :, None])]:
        waves = [np.cos(times * angle), np.sin(times * angle)]
        rows = np.concatenate([moves * (wave * on_table)[:, None, None] for wave in waves], axis=2)
        width = rows.shape[2]
        if np.count_nonzero(on_table) < width + _LEAST_SPARE:
            continue
        gain, size, step = scores.gained(rows, _FAR_RAD)
        # The amplitude of a wave of two components (leans across, cos and sin), at its largest.
        largest = float(np.linalg.svd(size.reshape(2, -1), compute_uv=False)[0])
        by_misfit, share = scores.chance(gain, width), more_than_chance(gain, width)
        many = tables * (len(leans) if kind == "wobble" else 1)
        # By the sigmas as they were found, too: either may flatter so few captures.
        chance = max(chance_of(gain / judged.excess, width), by_misfit) * many
        rarity = by_misfit * many / _RARE
        yield Pattern(kind, times, largest, rarity, chance, step[: data.width], share, layout.named(table))


def _leans(judged: Judged, table: int) -> list[FloatArray]:
    """Return how leans (2) of an axis move each capture's expected sphere, (K, 3, 2), about some pivots on it.

    Where its bearing is nobody tells: it may be between the spheres, or beyond the last on either side.
    """
    layout, at = judged.data.walk.layout, judged.fit.minimum.at
    first, heights = layout.axis(table).start, judged.fit.state.position.places[layout.on_axis(table), 2]
    low, high = float(heights.min(initial=0.0)), float(heights.max(initial=0.0))
    pivots = sorted({low - _BEYOND_MM, low, high, high + _BEYOND_MM})
    by_lean, by_shift = at.jacobian[:, :, first : first + 2], at.jacobian[:, :, first + 2 : first + 4]
    across = np.stack([-by_shift[:, :, 1], by_shift[:, :, 0]], axis=2)  # by lean, of each mm higher
    return [by_lean - pivot * across for pivot in pivots]
