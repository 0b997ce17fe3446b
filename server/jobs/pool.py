"""What every pool of workers can do."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future

from server.jobs import worker

Listen = Callable[[worker.Message], None]


class Pool(ABC):
    """Workers that do jobs, wherever they are."""

    @abstractmethod
    def submit(self, work: Callable[[], worker.Solved]) -> "Future[worker.Solved]":
        """Have work done by whichever worker is free."""

    def submit_measuring(self, work: Callable[[], str]) -> "Future[str] | None":
        """Have a capture measured, None where the server has processes of its own for that."""
        return None

    @abstractmethod
    def get_ready(self) -> "Future[bool]":
        """Return what is done once a worker waits for jobs."""

    @abstractmethod
    def end_worker(self, place: worker.Place) -> None:
        """End a worker at once, whatever it does."""

    @abstractmethod
    def is_broken_by(self, error: BaseException) -> bool:
        """Return whether a job failed because its worker is gone."""

    def trouble(self) -> str | None:
        """Return in words why no job can be done now, None where they can."""
        return None

    @property
    def is_elsewhere(self) -> bool:
        """Whether its workers are not this server's: they come and go, and jobs begin anew on others."""
        return False

    def takes_jobs(self) -> bool:
        """Return whether jobs can be submitted; a pool elsewhere is asked, which takes a while."""
        return True

    def is_gone(self) -> bool:
        """Return whether it must be made anew, whatever becomes of its jobs; asks as `takes_jobs` does."""
        return False

    @abstractmethod
    def close(self) -> None:
        """End all workers that are this pool's own."""
