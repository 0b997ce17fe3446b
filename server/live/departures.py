"""What the stripe does once robot or table have left a place: it must move with them, and not before."""

from typing import Generic, TypeVar

import numpy as np

from calib_core.messages import message
from calib_core.sphere.arc import ArcFit
from server.sources.device import Role, Sample

STRIPE_MOVED_MM = 0.5
"""A stripe that moved by more did not stand."""

STRIPE_STOOD_MM = 0.02
"""A stripe that moved by less stood."""

_TURNED_DEG = 0.5
_TOGETHER_S = 0.35
_Told = TypeVar("_Told")


class _LeftPlace(Generic[_Told]):
    """Remembers what was told and seen of a place that was left, until an exposure is of after the move.

    That may have been made `latency_s` before it arrives.
    """

    def __init__(self, latency_s: float) -> None:
        self._latency_s = latency_s
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._left: tuple[_Told, ArcFit] | None = None
        self._moved_s = np.inf

    def _settled(self, seen_s: float) -> tuple[_Told, ArcFit] | None:
        """Return what was left, once, where what is seen now is of after the move."""
        if self._left is None or seen_s <= self._moved_s + self._latency_s:
            return None
        left, self._left = self._left, None
        return left


class Departures(_LeftPlace[Sample]):
    """Holds when the robot or the table left a place against when the stripe did."""

    def forget(self) -> None:
        """Begin anew."""
        super().forget()
        self.together: Role | None = None
        """Who left together with the stripe; whoever reads it, forgets it."""

    def leave(self, sample: Sample, seen_s: float, arc: ArcFit) -> None:
        """Take what first told of a move, when the stripe was last seen where it stood, and where."""
        self._left = (sample, arc) if sample.host_time_s - seen_s <= _TOGETHER_S else None
        self._moved_s = sample.host_time_s

    def see(self, arc: ArcFit | None, seen_s: float) -> None:
        """Take what the scanner saw next; from soon after the poses left, it must be elsewhere."""
        left = self._settled(seen_s)
        if left and (arc is None or left[1].apart_mm(arc) > STRIPE_MOVED_MM):
            self.together = "robot" if left[0].base_from_tool0 is not None else "table"


class LateAngle(_LeftPlace[float]):
    """Holds what the table tells of a turn against what the stripe does meanwhile: a late angle turns alone."""

    def forget(self) -> None:
        """Begin anew."""
        super().forget()
        self.why = ""

    def leave(self, table_deg: float | None, arc: ArcFit) -> None:
        """Take what was told and seen in a stand that ends."""
        self.forget()
        self._left = None if table_deg is None else (table_deg, arc)

    def tell(self, table_deg: float, host_time_s: float) -> None:
        """Take an angle; from one on that is far enough away the stripe must have moved."""
        if self._left and np.isinf(self._moved_s) and _turn_deg(self._left[0], table_deg) > _TURNED_DEG:
            self._moved_s = host_time_s

    def see(self, arc: ArcFit, seen_s: float, table_deg: float | None) -> bool:
        """Take what was seen of a ball on the table; return whether it shows now that the angle is late."""
        if table_deg is None or (left := self._settled(seen_s)) is None:
            return False
        if left[1].apart_mm(arc) > STRIPE_STOOD_MM:
            return False
        self.why = message(
            "the table turned by {turned_deg:.1f}° while the stripe stood. Does its angle arrive late? If the "
            "ball stands near the table's axis, move it outwards",
            turned_deg=_turn_deg(left[0], table_deg),
        )
        return True


def _turn_deg(one: float, other: float) -> float:
    """Return how far a table turned, the shorter way round."""
    return abs((other - one + 180.0) % 360.0 - 180.0)
