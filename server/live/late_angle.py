"""Whether a table's angle arrives late: it turns while the ball that is on the table stands."""

import numpy as np

from calib_core.messages import message
from calib_core.sphere.arc import ArcFit

_TURNED_DEG = 0.5
STRIPE_STOOD_MM = 0.02
"""A stripe that moved by less stood."""


class LateAngle:
    """Holds what the table tells of a turn against what the stripe does meanwhile.

    Parameters
    ----------
    latency_s : float
        How long before its arrival an exposure may have been made.
    """

    def __init__(self, latency_s: float) -> None:
        self._latency_s = latency_s
        self._left: tuple[float, ArcFit] | None = None
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._left = None
        self._turned_s, self.why = np.inf, ""

    def leave(self, table_deg: float | None, arc: ArcFit) -> None:
        """Take what was told and seen in a stand that ends."""
        self.forget()
        self._left = None if table_deg is None else (table_deg, arc)

    def tell(self, table_deg: float, host_time_s: float) -> None:
        """Take an angle; from one on that is far enough away the stripe must have moved."""
        if (
            self._left is not None
            and np.isinf(self._turned_s)
            and _turn_deg(self._left[0], table_deg) > _TURNED_DEG
        ):
            self._turned_s = host_time_s

    def see(self, arc: ArcFit, host_time_s: float, table_deg: float | None) -> bool:
        """Take what was seen of a ball on the table; return whether it shows now that the angle is late."""
        if self._left is None or table_deg is None or host_time_s <= self._turned_s + self._latency_s:
            return False
        (before_deg, before), self._left = self._left, None
        if before.apart_mm(arc) > STRIPE_STOOD_MM:
            return False
        self.why = message(
            "the table turned by {turned_deg:.1f}° while the stripe stood. Does its angle arrive late? If the "
            "ball stands near the table's axis, move it outwards",
            turned_deg=_turn_deg(before_deg, table_deg),
        )
        return True


def _turn_deg(one: float, other: float) -> float:
    """Return how far a table turned, the shorter way round."""
    return abs((other - one + 180.0) % 360.0 - 180.0)
