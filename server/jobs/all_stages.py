"""A job that solves all stages of a session, one after the other, each as a job of its own."""

import asyncio
import logging
import threading
from collections.abc import Callable, Coroutine, Sequence
from functools import partial
from typing import Any

from calib_core.errors import NotFoundError
from calib_core.graph.registry import STAGES
from server.http.errors import problem_of_status
from server.jobs.ends import explained
from server.jobs.waiting import WaitingJobs
from server.store.database import Store
from server.store.models import Data
from server.store.sessions import locked_session
from server.store.solves import create_job, fail_job, job_row, update_job

log = logging.getLogger("scancell")


class AllStages:
    """Threads that go from stage to stage.

    Parameters
    ----------
    store : Store
    waiting : WaitingJobs
        Bears outages of the store.
    submit : callable
        Hands the job of a stage to the workers.
    end_of : callable
        Waits for the end of a job, and returns it.
    """

    def __init__(
        self,
        store: Store,
        waiting: WaitingJobs,
        submit: Callable[[str], None],
        end_of: Callable[[str], Coroutine[Any, Any, Data]],
    ) -> None:
        self._store, self._waiting, self._submit, self._end_of = store, waiting, submit, end_of
        self._children: dict[str, str] = {}

    def begin(self, job_id: str, stages: Sequence[str]) -> None:
        """Solve stages for a stored job, which ends with the last or with one that fails."""
        threading.Thread(target=self._solve, args=(job_id, stages), name="all stages", daemon=True).start()

    def left(self, job_id: str) -> str | None:
        """Return the job of the stage that is being solved, for which nobody waits from now on."""
        return self._children.pop(job_id, None)

    def _solve(self, job_id: str, stages: Sequence[str]) -> None:
        try:
            for number, stage in enumerate(stages):
                begin = partial(self._begin_stage, job_id, stage, number / len(stages))
                child = self._waiting.through_outages(begin)
                if child is None:
                    return
                self._children[job_id] = child
                self._submit(child)
                ended = self._waiting.through_outages(lambda child=child: asyncio.run(self._end_of(child)))
                if ended["status"] == "failed" and STAGES.get(stage, "stage").is_second_opinion:
                    continue  # its own job says why
                if ended["status"] != "done":
                    error = ended["error"] or problem_of_status(503, f"{stage}: {ended['message']}")
                    self._waiting.noting(partial(self._fail, job_id, error))  # unless it was cancelled itself
                    return
            self._waiting.noting(partial(self._done, job_id))
        except NotFoundError:
            log.info("job %s went with its session", job_id)
        except Exception as error:
            self._waiting.noting(partial(self._fail, job_id, explained(error)))
        finally:
            self._children.pop(job_id, None)

    def _begin_stage(self, job_id: str, stage: str, progress: float) -> str | None:
        """Make the job of one stage; None where all were cancelled, or the server stops."""
        with self._store.write() as db:
            if not update_job(db, job_id, "running", stage, progress):
                return None
            return create_job(db, locked_session(db, job_row(db, job_id).session_id), stage).id

    def _fail(self, job_id: str, error: Data) -> None:
        with self._store.write() as db:
            fail_job(db, job_id, error)

    def _done(self, job_id: str) -> None:
        with self._store.write() as db:
            update_job(db, job_id, "done", "done", 1.0)
