"""`scancell` under a clock that is wrong: `python -m tests.server.shifted_clock SECONDS serve …`."""

import datetime
import sys
import time

from server.cli import main


def shift(seconds: float) -> None:
    """Set this process's clock forward, or back where `seconds` is negative."""
    true_time, true_datetime = time.time, datetime.datetime

    class Shifted(true_datetime):
        @classmethod
        def now(cls, tz: datetime.tzinfo | None = None) -> "Shifted":
            return cls.fromtimestamp(true_time() + seconds, tz)

    time.time = lambda: true_time() + seconds
    datetime.datetime = Shifted


if __name__ == "__main__":
    shift(float(sys.argv[1]))
    sys.exit(main(sys.argv[2:]))
