"""Solves in worker processes: queued, followed, cancelled, and honest about how they ended."""

import asyncio
import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from sqlalchemy.exc import DBAPIError

from calib_core.errors import CalibrationError, ConflictError, NotFoundError
from calib_core.graph.registry import STAGES
from calib_core.messages import message, with_parts
from calib_core.steps import optics_stages
from server.http.errors import problem, problem_of_status
from server.http.events import Hub, ended_job
from server.jobs import worker
from server.jobs.pool import Pool
from server.jobs.pools import open_pool
from server.settings import Settings
from server.store.calibrations import measure_frames_anew
from server.store.database import Store
from server.store.models import Data
from server.store.provenance import note_replay
from server.store.sessions import load_session, locked_session
from server.store.solves import (
    REPLAY,
    add_answer,
    add_result,
    create_job,
    fail_job,
    job_data,
    job_row,
    unfinished_jobs,
    update_job,
)
from server.store.unreferenced import remove_unreferenced

log = logging.getLogger("scancell")


@dataclass
class _Running:
    """A job that is with the executor."""

    pool: Pool
    future: Future[worker.Solved]
    solved_from: Data | None  # what a result is stored with; a replay leaves none
    session: Data
    results: Mapping[str, Data]
    place: worker.Place | None = None  # of its worker, once it has begun
    ended_by_us: bool = False  # by force: the store knows why already
    timer: threading.Timer | None = field(default=None, repr=False)


class Jobs:
    """The jobs of all sessions."""

    def __init__(self, settings: Settings, store: Store, hub: Hub, captures_wait: Callable[[], None]) -> None:
        self._settings = settings
        self._store, self._hub = store, hub
        self._captures_wait = captures_wait
        self._running: dict[str, _Running] = {}
        self._children: dict[str, str] = {}  # of a job that solves all stages: the one that runs
        self._lock = threading.RLock()
        self._ready: Future[bool] | None = None
        self._pool: Pool | None = None

    def start(self) -> None:
        """Say of jobs that an earlier server left that they ended, and get the workers ready."""
        self._fail_unfinished("the server was restarted while it ran")
        self._pool = self._new_pool()

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
        if pool.is_gone:
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
                self._submit_again(job_id)
            else:
                self._fail(job_id, _cluster_gone())
        gone.close()

    def _fail(self, job_id: str, error: Data) -> None:
        with self._store.write() as db:
            fail_job(db, job_id, error)

    def stop(self) -> None:
        """End everything at once; unfinished jobs say so."""
        with self._lock:
            pool, self._pool = self._pool, None
            running, self._running = self._running, {}
        for job in running.values():
            _kill(job)
        if pool is not None:
            pool.close()
        try:
            self._fail_unfinished("the server was stopped while it ran")
        except (OSError, DBAPIError):  # the next start says it
            log.exception("what became of the jobs could not be stored")

    def submit(self, job_id: str) -> None:
        """Hand a stored job to the workers."""
        with self._store.read() as db:
            row = job_row(db, job_id)
            if row.status != "queued":  # cancelled meanwhile
                return
            stored = load_session(db, self._store.blobs, row.session_id)
            stage = row.stage
        digests = dict(stored.digests)
        session = stored.session.to_json()
        solved_from: Data | None = None
        if stage == REPLAY:
            work = partial(worker.replay, job_id, session, dict(stored.results), digests)
        else:
            solved_from = {"session": session, "files": digests}
            work = partial(worker.solve, job_id, session, stage, digests, dict(stored.results))
        with self._lock:
            if self._pool is None:  # the server stops, and says so of its jobs
                return
            if not self._pool.takes_jobs:
                threading.Thread(target=self._fail, args=(job_id, _cluster_gone()), daemon=True).start()
                return
            future = self._pool.submit(work)
            self._running[job_id] = _Running(self._pool, future, solved_from, session, stored.results)
        future.add_done_callback(lambda done: self._ended(job_id, done))

    def submit_measuring(self, work: Callable[[], str]) -> "Future[str] | None":
        """Have a capture measured on the cluster; None where there is none that takes work."""
        pool = self._pool
        return pool.submit_measuring(work) if pool is not None and pool.takes_jobs else None

    def submit_all(self, job_id: str, stages: Sequence[str]) -> None:
        """Solve stages one after the other for a stored job, which ends with the last or with one that fails."""
        threading.Thread(target=self._solve_all, args=(job_id, stages), name="all stages", daemon=True).start()

    def _solve_all(self, job_id: str, stages: Sequence[str]) -> None:
        try:
            for number, stage in enumerate(stages):
                with self._store.write() as db:
                    if self._pool is None or not update_job(db, job_id, "running", stage, number / len(stages)):
                        return
                    child = create_job(db, locked_session(db, job_row(db, job_id).session_id), stage).id
                with self._lock:
                    self._children[job_id] = child
                self.submit(child)
                ended = asyncio.run(ended_job(self._store, self._hub, child, self._settings.job_timeout_s))
                if ended["status"] == "failed" and STAGES.get(stage, "stage").is_second_opinion:
                    continue  # its own job says why
                if ended["status"] != "done":
                    error = ended["error"] or problem_of_status(503, f"{stage}: {ended['message']}")
                    self._fail(job_id, error)  # unless it was cancelled itself
                    return
            with self._store.write() as db:
                update_job(db, job_id, "done", "done", 1.0)
        except NotFoundError:
            log.info("job %s went with its session", job_id)
        except Exception as error:
            self._fail(job_id, _explain(error))
        finally:
            with self._lock:
                self._children.pop(job_id, None)

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
            raise ConflictError(
                "a job that waits or runs",
                "one that is {job}",
                "There is nothing to cancel.",
                job_id,
                job=job["status"],
            )
        self.end(job_id)
        return job

    def end(self, job_id: str) -> None:
        """End what a job does, if it still does something; the store is not told."""
        with self._lock:
            child = self._children.pop(job_id, None)
            running = self._running.get(job_id)
            if child is not None:
                with suppress(ConflictError, NotFoundError):  # it has ended by itself, or gone with its session
                    self.cancel(child)
            if running is None:
                return
            has_begun = running.place is not None
            if not running.future.cancel() or has_begun:  # an executor may call off what goes on all the same
                running.ended_by_us = True
                _kill(running)

    def _fail_unfinished(self, got: str) -> None:
        error = problem_of_status(
            503, message("the job did not end: {found}", found=got), "The server restarted; run it again."
        )
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
                    _kill(running)
                if again:  # a cluster gives a job to another worker when one is killed; here that is told instead
                    threading.Thread(target=self._lost, args=(job_id,), daemon=True).start()
                    return
                running.timer = threading.Timer(self._settings.job_timeout_s, self._time_out, [job_id])
                running.timer.daemon = True
                running.timer.start()
            fraction, text = 0.0, "started"
        else:
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

    def _lost(self, job_id: str) -> None:
        self._fail(job_id, _worker_ended())
        self.end(job_id)

    def _ended(self, job_id: str, future: Future[worker.Solved]) -> None:
        with self._lock:
            running = self._running.pop(job_id, None)
            if running is None:  # the server stops
                return
            if running.timer is not None:
                running.timer.cancel()
        error = CancelledError() if future.cancelled() else future.exception()
        broken = error is not None and running.pool.is_broken_by(error)
        if error is not None:
            ended = _worker_ended() if running.pool.takes_jobs else _cluster_gone()
            gone = broken or isinstance(error, CancelledError)
            self._fail(job_id, ended if gone else _explain(error))  # `cancel` has noted it before
            return
        solved = future.result()
        with self._store.write() as db:
            if running.solved_from is None:
                note_replay(db, job_id, running.session, running.results, solved.result, solved.fresh)
                add_answer(db, job_id, solved.result)
                return
            former = add_result(db, job_id, solved.result, running.solved_from, solved.outputs)
            row = job_row(db, job_id) if solved.result["stage"] in optics_stages() else None
            wait = row is not None and measure_frames_anew(db, row.session_id, row.stage)
        if wait:
            self._captures_wait()
        remove_unreferenced(self._store, former)

    def _submit_again(self, job_id: str) -> None:
        with self._store.write() as db:
            if not update_job(db, job_id, "queued", "waiting for its turn again", 0.0):
                return
        try:
            self.submit(job_id)
        except NotFoundError:
            log.info("job %s went with its session", job_id)


def _kill(running: _Running) -> None:
    """End the worker that a job runs in."""
    if running.place is not None and (running.future.cancelled() or not running.future.done()):
        running.pool.end_worker(running.place)


def _cluster_gone() -> Data:
    return problem_of_status(
        503, "the Dask cluster went away", "Run it again once GET /health says that it is back."
    )


def _worker_ended() -> Data:
    got = "the worker process ended unexpectedly (it was killed, or memory ran out)"
    return problem_of_status(503, got, "Run it again.")


def _explain(error: BaseException) -> Data:
    if isinstance(error, CalibrationError):
        return with_parts(problem(error))
    log.error("a job failed unexpectedly", exc_info=error)
    return problem_of_status(
        500,
        message("an error of the program itself ({name}: {error})", name=type(error).__name__, error=error),
        "Look into the server's log.",
    )
