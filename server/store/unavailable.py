"""What the server rests on goes away and comes back: the one way in which that is told."""

from typing import Final

from sqlalchemy.exc import InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from calib_core.messages import message

RETRY_AFTER_S: Final = 2
"""When whoever was refused should come again: the server looks as often."""


class UnavailableError(OSError):
    """A store or a cluster that does not answer now; the same, asked again later, may be answered.

    No `CalibrationError`: nothing that is measured or solved may take it for a fault of what was captured.

    Parameters
    ----------
    got : str
        What does not answer, and what it said.
    to_do : str, optional
        What the person should do now, as a sentence in the imperative.
    """

    def __init__(self, got: str, to_do: str = "") -> None:
        super().__init__(got)
        self.got, self.to_do = got, to_do or message("Try again in a moment; nothing that was stored is touched.")


OUTAGES: Final = (UnavailableError, OperationalError, InterfaceError, PoolTimeoutError)
"""What says that files or database are away; `InterfaceError`: cut off in the midst."""
