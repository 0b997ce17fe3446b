"""Errors of a table that repeat with its angle: an axis that wobbles, an encoder that is eccentric.

Once a turn, an axis that leans with the table is part of the mounting, and one that leans in base is the axis;
twice and three times a turn are the bearing's.  Each adds unknowns to the normal equations at the answer; how much
likelier all captures get with them, and how large they are, follows from those (a score test).
"""

from dataclasses import dataclass

import numpy as np

from calib_core.chain.rejection import Judged
from calib_core.chain.score import Scores
from calib_core.findings import Finding
from calib_core.findings.codes.turntable import AXIS_WOBBLES, ENCODER_ECCENTRIC

_FAR_RAD = 5e-3
_RARE = 0.0005  # of three patterns: one sound table in 700 is doubted
_LEAST_LEAN_RAD = 2e-4
_LEAST_ECCENTRIC_RAD = np.deg2rad(0.02)
_LEAST_SPARE = 6  # captures beyond the unknowns that a pattern brings


@dataclass(frozen=True)
class Pattern:
    """One pattern: what repeats, how often a turn, its amplitude, and how rare so much is by chance.

    `axis`: its name, where several carry balls.
    """

    kind: str
    times: int
    size_rad: float
    chance: float
    axis: str = ""

    @property
    def finding(self) -> Finding:
        """What is noticed of it."""
        size_deg = float(np.rad2deg(self.size_rad))
        if self.kind == "wobble":
            said = f"{self.times} of several" if self.axis else self.times
            return AXIS_WOBBLES(size_deg=size_deg, times=said, axis=self.axis)
        return ENCODER_ECCENTRIC(size_deg=size_deg, of="several" if self.axis else "one", axis=self.axis)


def pattern_of(judged: Judged) -> Pattern | None:
    """Return the likeliest pattern that chance does not explain and that is large enough to matter, or None.

    Parameters
    ----------
    judged : Judged
        Of captures of the table, with others or alone.
    """
    layout = judged.data.walk.layout
    turning = [axis for axis in layout.carrying if layout.axes[axis].kind == "rotary"]
    each = [(p, _RARE / len(turning)) for axis in turning for p in _patterns(judged, axis)]
    found = [p for p, rare in each if p.chance < rare and p.size_rad > _least(p.kind)]
    return min(found, key=lambda p: p.chance, default=None)


def _least(kind: str) -> float:
    return _LEAST_LEAN_RAD if kind == "wobble" else _LEAST_ECCENTRIC_RAD


def _patterns(judged: Judged, table: int) -> list[Pattern]:
    from scipy.special import chdtrc  # scipy.stats has it too, but takes a second to import

    at, walk = judged.fit.minimum.at, judged.data.walk
    assert at.levers is not None
    on_table = walk.layout.rides[walk.place, table] & judged.used
    angle, first = walk.readings[:, table], walk.layout.axis(table).start
    tilts, by_angle = at.jacobian[:, :, first : first + 2], at.levers[:, :, table]
    found: list[Pattern] = []
    scores = Scores.of(judged)
    for kind, times in (("wobble", 2), ("wobble", 3), ("encoder", 1)):
        moves = tilts if kind == "wobble" else by_angle[:, :, None]
        waves = [np.cos(times * angle), np.sin(times * angle)]
        rows = np.concatenate([moves * (wave * on_table)[:, None, None] for wave in waves], axis=2)
        width = rows.shape[2]
        if np.count_nonzero(on_table) < width + _LEAST_SPARE:
            continue
        gain, size, _ = scores.gained(rows, _FAR_RAD)
        # The amplitude of a wave of two components (leans across, cos and sin), at its largest.
        largest = float(np.linalg.svd(size.reshape(2, -1), compute_uv=False)[0])
        # By the sigmas as they were found and by what is left of the misfit: either may flatter so few captures.
        chance = max(float(chdtrc(width, gain / judged.excess)), scores.chance(gain, width))
        found.append(Pattern(kind, times, largest, chance, walk.layout.named(table)))
    return found
