"""Token buckets: how much somebody may do in a time.

The rates stand in `server/settings.py`; `middleware.py` and `refusals.py` take from the buckets.
"""

import time
from collections import OrderedDict
from collections.abc import Callable

_MOST_KEYS = 10_000


class Buckets:
    """One bucket a key; each holds up to `burst` and fills up at `rate_per_s`.

    Keys that were quiet longest are forgotten beyond ten thousand: their buckets are the fullest.
    """

    def __init__(self, rate_per_s: float, burst: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._rate_per_s = rate_per_s
        self._burst = burst
        self._clock = clock
        self._held: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def wait_s(self, key: str, factor: float = 1.0) -> float:
        """Take one out of a key's bucket and return 0; or, where it is empty, how long to wait for the next.

        Parameters
        ----------
        key : str
        factor : float
            How many times larger and faster this key's bucket is.
        """
        now_s = self._clock()
        rate_per_s, burst = self._rate_per_s * factor, self._burst * factor
        held, since_s = self._held.pop(key, (burst, now_s))
        held = min(burst, held + (now_s - since_s) * rate_per_s)
        left = held - 1 if held >= 1 else held
        self._held[key] = (left, now_s)
        if len(self._held) > _MOST_KEYS:
            self._held.popitem(last=False)
        return 0.0 if held >= 1 else (1 - held) / rate_per_s
