"""How a job ends that has not ended well: problem details."""

import logging
from typing import Final

from calib_core.errors import CalibrationError
from calib_core.messages import message, with_parts
from server.http.errors import problem, problem_of_status, unavailable
from server.http.program_files import RESTART, UPDATED, is_updated
from server.store.models import Data

log = logging.getLogger("scancell")
MOST_ATTEMPTS: Final = 6
"""How often a job begins whose workers are killed, perhaps by what the job needs; each pause is longer."""


def cluster_gone() -> Data:
    """Return that the cluster is away."""
    return unavailable(
        message("the Dask cluster went away"), "Run it again once GET /health says that it is back."
    )


def worker_ended(attempt: int) -> Data:
    """Return that a job's worker was killed, perhaps for what the job needs."""
    got = message(
        "the worker process ended unexpectedly (it was killed, or memory ran out), attempt {attempt} of {most}",
        attempt=attempt,
        most=MOST_ATTEMPTS,
    )
    to_do = message("Give the workers more memory, or the job less data; then run it again.")
    return problem_of_status(503, got, to_do)


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
