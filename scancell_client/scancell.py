"""What programs do with a workbench, in a few calls: solve and wait, results as records, safe changes."""

from collections.abc import Callable, Mapping
from typing import Any, Self
from urllib.parse import quote

from .connection import ProblemError, problem_of
from .models import RESULTS, Record, SessionAnswer
from .operations import Operations

_LONGEST_WAIT_S = 60
_ATTEMPTS = 20
_CHANGED_MEANWHILE = 412


class Scancell(Operations):
    """A workbench; see `Connection` for its arguments.

    Each operation of the API is a method that returns the answer's data (`sessions_create`, `captures_add`, …);
    the methods here put them together.
    """

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def solve(self, session_id: str, stage: str = "all") -> dict[str, Any]:
        """Solve a stage, or all that there are captures for; return the session's results by stage.

        Raises
        ------
        ProblemError
            If it cannot be solved, with what to do.
        """
        self.wait(self.solves_solve(session_id, stage)["id"])
        return self.results(session_id)

    def wait(self, job_id: str) -> dict[str, Any]:
        """Return a job once it is done; raises ProblemError if it failed or was cancelled."""
        job: dict[str, Any] = self.solves_get_job(job_id)
        while job["status"] in ("queued", "running"):
            job = self._ended(job_id)
        if job["status"] != "done":
            raise problem_of(job["error"] or {"detail": f"the job was {job['status']}: {job['message']}"})
        return job

    def results(self, session_id: str) -> dict[str, Any]:
        """Return the latest result of each stage as its record; `stale` says whether its inputs have changed.

        The records are those of `scancell_client.models`, such as `TcpResult`; a stage that a newer server has
        comes as a plain `Record`.
        """
        found: dict[str, Any] = self.solves_list_results(session_id)
        return {stage: RESULTS.get(stage, Record).model_validate(data) for stage, data in found.items()}

    def answer(self, session_id: str) -> SessionAnswer:
        """Return the frames to act on; `faults` is empty where nothing speaks against it."""
        return SessionAnswer.model_validate(self.answers_get_answer(session_id))

    def change_capture(
        self, session_id: str, capture_id: str, change: Callable[[Mapping[str, Any]], Mapping[str, Any]]
    ) -> dict[str, Any]:
        """Change a capture by what `change` makes of it, again where somebody else was faster."""
        path = f"/api/v1/sessions/{quote(session_id, safe='')}/captures/{quote(capture_id, safe='')}"
        return self._change(path, change)

    def change_session(
        self, session_id: str, change: Callable[[Mapping[str, Any]], Mapping[str, Any]]
    ) -> dict[str, Any]:
        """Change a session by what `change` makes of it, again where somebody else was faster."""
        return self._change(f"/api/v1/sessions/{quote(session_id, safe='')}", change)

    def _change(self, path: str, change: Callable[[Mapping[str, Any]], Mapping[str, Any]]) -> dict[str, Any]:
        for attempt in range(_ATTEMPTS):
            now, tag = self.read(path)
            try:
                return self.request("PATCH", path, json=change(now), headers={"If-Match": tag})
            except ProblemError as error:
                if error.status != _CHANGED_MEANWHILE or attempt == _ATTEMPTS - 1:
                    raise
        raise AssertionError("unreachable")

    def _ended(self, job_id: str) -> dict[str, Any]:
        return self.request("GET", f"/api/v1/jobs/{job_id}", params={"wait": _LONGEST_WAIT_S})
