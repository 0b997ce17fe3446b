"""Whether pose and stripe leave a place together: no clock tells that a device was late from its start on."""

from calib_core.sphere.arc import ArcFit
from server.sources.device import Role, Sample

_TOGETHER_S = 0.35
STRIPE_MOVED_MM = 0.5
"""A stripe that moved by more did not stand."""


class Departures:
    """Holds when the robot or the table left a place against when the stripe did.

    Parameters
    ----------
    latency_s : float
        How long before its arrival an exposure may have been made.
    """

    def __init__(self, latency_s: float) -> None:
        self._latency_s = latency_s
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._left: tuple[Sample, ArcFit] | None = None
        self.together: Role | None = None
        """Who left together with the stripe; whoever reads it, forgets it."""

    def leave(self, sample: Sample, seen_s: float, arc: ArcFit) -> None:
        """Take what first told of a move, when the stripe was last seen where it stood, and where."""
        self._left = (sample, arc) if sample.host_time_s - seen_s <= _TOGETHER_S else None

    def see(self, arc: ArcFit | None, seen_s: float) -> None:
        """Take what the scanner saw next; from soon after the poses left, it must be elsewhere."""
        if self._left is None or seen_s <= self._left[0].host_time_s + self._latency_s:
            return
        (sample, left), self._left = self._left, None
        if arc is None or left.apart_mm(arc) > STRIPE_MOVED_MM:
            self.together = "robot" if sample.base_from_tool0 is not None else "table"
