"""The REST client that `--server` uses: in a checkout beside the server, in the wheel a copy within it.

The plain name belongs to the wheel scancell-client, which can be installed alone.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scancell_client import ProblemError, Scancell
else:
    try:
        from server.scancell_client import ProblemError, Scancell
    except ModuleNotFoundError:
        from scancell_client import ProblemError, Scancell

__all__ = ["ProblemError", "Scancell"]
