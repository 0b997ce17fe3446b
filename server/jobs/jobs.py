"""Solves in worker processes: queued, followed, cancelled, and honest about how they ended."""

import logging
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from functools import partial
from typing import Any

from sqlalchemy.exc import DBAPIError

from calib_core.errors import ConflictError, NotFoundError
from calib_core.messages import message
from calib_core.steps import optics_stages
from server.http.errors import problem_of_status, storage_problem
from server.http.events import Hub, ended_job
from server.jobs import worker
from server.jobs.all_stages import AllStages
from server.jobs.ends import MOST_ATTEMPTS, cluster_gone, explained, worker_ended
from server.jobs.pool import Pool
from server.jobs.pools import ProcessPool, open_pool
from server.jobs.running import Running, apart
from server.jobs.waiting import WaitingJobs
from server.settings import Settings
from server.store.calibrations import measure_frames_anew
from server.store.database import Store
from server.store.models import Data
from server.store.provenance import note_replay
from server.store.sessions import load_session
from server.store.solves import (
    COMPARE,
    REPLAY,
    add_answer,
    add_result,
    fail_job,
    job_data,
    job_row,
    unfinished_jobs,
    update_job,
)
from server.store.unavailable import OUTAGES
from server.store.unreferenced import remove_unreferenced

log = logging.getLogger("scancell")


class Jobs:
    """The jobs of all sessions."""

    def __init__(self, settings: Settings, store: Store, hub: Hub, captures_wait: Callable[[], None]) -> None:
        self._settings = settings
        self._store, self._hub = store, hub
        self._captures_wait = captures_wait
        self._running: dict[str, Running] = {}
        self._lock = threading.RLock()
        self._ready: Future[bool] | None = None
        self._pool: Pool | None = None
        self._here: Pool | None = None  # beside a cluster without workers
        self._waiting = WaitingJobs(self._hand_on, self._call_back)
        self._all_stages = AllStages(
            store, self._waiting, self.submit, lambda job: ended_job(store, hub, job, settings.job_timeout_s)
        )

    def start(self) -> None:
        """Say of jobs that an earlier server left that they ended, and get the workers ready."""
        self._fail_unfinished(message("the server was restarted while the job ran"))
        self._pool = self._new_pool()
        self._waiting.start()

    @property
    def ready(self) -> bool:
        """Whether a worker waits for jobs, warm."""
        if not self._settings.warm_up:
            return self._pool is not None
        return self._ready is not None and self._ready.done() and self._ready.exception() is None

    def trouble(self) -> str | None:
        """Return in words why no job can be done now, None where they can; a cluster that is back is used again.

        Raises
        ------
        InputError
            If a cluster that went away is still not there.
        """
        pool = self._pool
        if pool is None:
            return None
        if pool.is_gone():
            self._replace(pool)
            return None
        return pool.trouble()

    def _replace(self, gone: Pool) -> None:
        """Go on with a new pool: what had not begun begins there, what ran has ended and says so."""
        pool = self._new_pool()
        with self._lock:
            if self._pool is not gone:  # the server stops
                pool.close()
                return
            self._pool = pool
            left = {job_id: job for job_id, job in self._running.items() if job.pool is gone}
            for job_id in left:
                del self._running[job_id]
        for job_id, job in left.items():
            if job.timer is not None:
                job.timer.cancel()
            if job.place is None:
                self._waiting.noting(partial(self._submit_again, job_id))
            else:
                self._waiting.noting(partial(self._wait_for, job_id, cluster_gone()))
        apart(gone.close)  # it may wait for what does not answer

    def _fail(self, job_id: str, error: Data) -> None:
        with self._store.write() as db:
            fail_job(db, job_id, error)
        self._waiting.forget(job_id)

    def _wait(self, job_id: str, got: str, pause_s: float = 0.0) -> None:
        """Have a job wait for what is away, and say so where that can be stored."""
        self._waiting.add(job_id, pause_s)
        with suppress(*OUTAGES), self._store.write() as db:
            update_job(db, job_id, "queued", message("waits: {why}", why=got), 0.0)

    def _wait_for(self, job_id: str, told: Data) -> None:
        """Have a job begin anew once what is away is back: no fault of the job, however often it comes."""
        is_late = self._waiting.waited_s(job_id) > self._settings.job_timeout_s
        self._fail(job_id, told) if is_late else self._wait(job_id, told["got"])

    def _try_again(self, job_id: str) -> None:
        """Have a job begin anew whose worker was killed, or say that too many were."""
        lost = self._waiting.lost(job_id)
        if lost >= MOST_ATTEMPTS:
            self._fail(job_id, worker_ended(lost))
        else:
            self._wait(job_id, worker_ended(lost)["got"], 2.0 ** (lost - 1))

    def _hand_on(self, job_id: str, waited_s: float) -> bool:
        """Return whether a job that waits need do so no longer: it was handed to workers, or has ended."""
        pool = self._pool
        if pool is None or self._files_are_away():
            return False
        here = not pool.takes_jobs()
        if here and waited_s < self._settings.cluster_patience_s:
            return False
        self._submit_again(job_id, here)
        return True

    def _files_are_away(self) -> bool:
        try:
            return self._store.blobs.trouble() is not None
        except OSError:
            return True

    def _call_back(self) -> None:
        """Solve here what has waited too long for a cluster that has no workers."""
        pool, now_s = self._pool, time.monotonic()
        if pool is None or not pool.is_elsewhere or pool.trouble() is None:
            return
        with self._lock:
            late = {
                job_id: job
                for job_id, job in self._running.items()
                if job.pool is pool
                and job.place is None
                and now_s - job.since_s > self._settings.cluster_patience_s
            }
            for job_id in late:
                del self._running[job_id]
        for job_id, job in late.items():
            job.future.cancel()
            self._waiting.noting(partial(self._submit_again, job_id, here=True))

    def stop(self) -> None:
        """End everything at once; unfinished jobs say so."""
        self._waiting.stop()
        with self._lock:
            pools, self._pool, self._here = (self._pool, self._here), None, None
            running, self._running = self._running, {}
        for job in running.values():
            job.kill()
        for pool in pools:
            if pool is not None:
                pool.close()
        try:
            self._fail_unfinished(message("the server was stopped while the job ran"))
        except (OSError, DBAPIError):  # the next start says it
            log.exception("what became of the jobs could not be stored")

    def submit(self, job_id: str) -> None:
        """Hand a stored job to the workers; it waits while what it needs is away."""
        try:
            self._submit(job_id)
        except OUTAGES as error:
            self._wait(job_id, storage_problem(error)["got"])

    def _submit(self, job_id: str, here: bool = False) -> None:
        with self._store.read() as db:
            row = job_row(db, job_id)
            if row.status != "queued":  # cancelled meanwhile
                return
            stored = load_session(db, self._store.blobs, row.session_id)
            stage = row.stage
        digests = dict(stored.digests)
        session = stored.session.to_json()
        solved_from: Data | None = None
        if stage in (COMPARE, REPLAY):
            work = partial(worker.replay, job_id, session, dict(stored.results), digests)
        else:
            solved_from = {"session": session, "files": digests}
            work = partial(worker.solve, job_id, session, stage, digests, dict(stored.results))
        asked = self._pool
        takes = here or (asked is not None and asked.takes_jobs())  # before the lock: it may take seconds
        with self._lock:
            if self._pool is None:  # the server stops, and says so of its jobs
                return
            pool = self._pool_here() if here else self._pool
            future = pool.submit(work) if takes else None
            if future is not None:
                self._running[job_id] = Running(pool, future, solved_from, session, stored.results)
        if future is None:
            self._wait(job_id, cluster_gone()["got"])
        else:
            # A cluster's client tells it in the very thread that would have to answer what is asked then.
            future.add_done_callback(lambda done: apart(partial(self._ended, job_id, done)))

    def submit_measuring(self, work: Callable[[], str]) -> "Future[str] | None":
        """Have a capture measured on the cluster; None where there is none that takes work."""
        pool = self._pool
        return None if pool is None else pool.submit_measuring(work)

    def submit_all(self, job_id: str, stages: Sequence[str]) -> None:
        """Solve stages one after the other for a stored job, which ends with the last or with one that fails."""
        self._all_stages.begin(job_id, stages)

    def cancel(self, job_id: str) -> Data:
        """End a job that waits or runs, and return it.

        Raises
        ------
        ConflictError
            If it has ended already.
        """
        with self._store.write() as db:
            cancelled = update_job(db, job_id, "cancelled", "cancelled")
            job = job_data(job_row(db, job_id))
        if not cancelled and job["status"] != "cancelled":
            to_do = "There is nothing to cancel."
            raise ConflictError("a job that waits or runs", "one that is {job}", to_do, job_id, job=job["status"])
        self.end(job_id)
        return job

    def end(self, job_id: str) -> None:
        """End what a job does, if it still does something; the store is not told."""
        if (child := self._all_stages.left(job_id)) is not None:
            with suppress(ConflictError, NotFoundError):  # it has ended by itself, or gone with its session
                self.cancel(child)
        with self._lock:
            running = self._running.get(job_id)
            if running is None:
                return
            running.ended_by_us, has_begun = True, running.place is not None
            if not running.future.cancel() or has_begun:  # an executor may call off what goes on all the same
                running.kill()

    def _fail_unfinished(self, got: str) -> None:
        error = problem_of_status(503, got, "Run it again.")
        with self._store.write() as db:
            for job_id in unfinished_jobs(db):
                fail_job(db, job_id, error)

    def _new_pool(self) -> Pool:
        pool = open_pool(self._settings, self._listen)
        if self._settings.warm_up:
            self._ready = pool.get_ready()
        return pool

    def _listen(self, message: worker.Message) -> None:
        try:
            self._note(*message)
        except Exception:  # the next report may be stored again: a full disk, a locked database
            log.exception("the progress of job %s could not be stored", message.job)

    def _note(self, job_id: str, kind: str, value: Any) -> None:
        if kind == "started":
            with self._lock:
                running = self._running.get(job_id)
                if running is None:
                    return
                again, running.place = running.place is not None, value
                if running.ended_by_us:
                    running.kill()
                if again and running.timer is not None:
                    running.timer.cancel()
                # A cluster gives a job to another worker when one is killed, until it has none left.
                if again and (lost := self._waiting.lost(job_id)) >= MOST_ATTEMPTS:
                    apart(partial(self._lost, job_id, lost))
                    return
                running.timer = threading.Timer(self._settings.job_timeout_s, self._time_out, [job_id])
                running.timer.daemon = True
                running.timer.start()
            fraction, text = 0.0, "started"
        else:
            running = self._running.get(job_id)
            if running is None or running.place is None:  # it waits to begin anew: said of what was before
                return
            fraction, text = value
        with self._store.write() as db:
            update_job(db, job_id, "running", text, min(max(fraction, 0.0), 1.0))

    def _time_out(self, job_id: str) -> None:
        limit = f"{self._settings.job_timeout_s:g} s"
        error = problem_of_status(
            504,
            message("the job was still running after {limit}", limit=limit),
            "Give it less data, or raise SCANCELL_JOB_TIMEOUT_S; then run it again.",
        )
        self._fail(job_id, error)
        self.end(job_id)

    def _lost(self, job_id: str, times: int) -> None:
        self._waiting.noting(partial(self._fail, job_id, worker_ended(times)))
        self.end(job_id)

    def _ended(self, job_id: str, future: Future[worker.Solved]) -> None:
        with self._lock:
            running = self._running.get(job_id)
            if running is None or running.future is not future:  # the server stops, or it began anew
                return
            del self._running[job_id]
            if running.timer is not None:
                running.timer.cancel()
        error = CancelledError() if future.cancelled() else future.exception()
        if error is None:
            self._waiting.noting(partial(self._told, job_id, lambda: self._keep(job_id, running, future.result())))
        elif running.ended_by_us:
            self._waiting.forget(job_id)
        else:
            self._waiting.noting(partial(self._told, job_id, lambda: self._failed(job_id, running.pool, error)))

    def _told(self, job_id: str, tell: Callable[[], None]) -> None:
        """Store how a job ended; where that meets an error of the program, the job says so and has ended, too."""
        try:
            tell()
        except OUTAGES:
            raise
        except Exception as error:
            self._fail(job_id, explained(error))

    def _failed(self, job_id: str, pool: Pool, error: BaseException) -> None:
        """Have a job begin anew that an outage has ended, or say why it failed; `cancel` has noted it before."""
        if isinstance(error, OUTAGES):
            self._wait_for(job_id, storage_problem(error))
        elif not (isinstance(error, CancelledError) or pool.is_broken_by(error)):
            self._fail(job_id, explained(error))
        elif pool.takes_jobs():
            self._try_again(job_id)
        else:
            self._wait_for(job_id, cluster_gone())

    def _keep(self, job_id: str, running: Running, solved: worker.Solved) -> None:
        """Store what a job found."""
        with self._store.write() as db:
            if running.solved_from is None:
                note_replay(db, job_id, running.session, running.results, solved.result, solved.fresh)
                add_answer(db, job_id, solved.result)
                return
            former = add_result(db, job_id, solved.result, running.solved_from, solved.outputs)
            row = job_row(db, job_id) if solved.result["stage"] in optics_stages() else None
            wait = row is not None and measure_frames_anew(db, row.session_id, row.stage)
        self._waiting.forget(job_id)
        if wait:
            self._captures_wait()
        remove_unreferenced(self._store, former)

    def _pool_here(self) -> Pool:
        """Return the processes of this server, beside a cluster if there is one."""
        if self._here is None:
            self._here = ProcessPool(self._settings, self._listen)
        return self._here

    def _submit_again(self, job_id: str, here: bool = False) -> None:
        with self._store.write() as db:
            if not update_job(db, job_id, "queued", "waiting for its turn again", 0.0):
                self._waiting.forget(job_id)
                return
        try:
            self._submit(job_id, here)
        except NotFoundError:
            log.info("job %s went with its session", job_id)
