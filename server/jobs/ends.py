"""How a job ends that has not ended well: problem details."""

import logging

from calib_core.errors import CalibrationError
from calib_core.messages import message, with_parts
from server.http.errors import problem, problem_of_status, unavailable
from server.http.program_files import RESTART, UPDATED, is_updated
from server.store.models import Data

log = logging.getLogger("scancell")


def cluster_gone() -> Data:
    """Return that the cluster is away."""
    return unavailable(
        message("the Dask cluster went away"), "Run it again once GET /health says that it is back."
    )


def worker_ended() -> Data:
    """Return that the worker was killed, perhaps for what the job needs."""
    got = "the worker process ended unexpectedly (it was killed, or memory ran out)"
    return problem_of_status(503, got, "Run it again.")


def explained(error: BaseException) -> Data:
    """Return what a solver said, or that the program is at fault."""
    if isinstance(error, CalibrationError):
        return with_parts(problem(error))
    log.error("a job failed unexpectedly", exc_info=error)
    if is_updated(error):
        return unavailable(UPDATED, RESTART)
    return problem_of_status(
        500,
        message("an error of the program itself ({name}: {error})", name=type(error).__name__, error=error),
        "Check the server's log and report it.",
    )
