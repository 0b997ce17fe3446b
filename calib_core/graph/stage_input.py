"""What a stage's solver gets, and what the stages of one run hand on to each other."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from calib_core.chain.observations import SphereObservation, SphereSize, TableObservation
from calib_core.errors import MeasurementError, MotionError
from calib_core.findings import sentence_of
from calib_core.graph.registry import stages
from calib_core.records import Capture, Finding, Progress, ReadFile, Result, Session, StoreFile

if TYPE_CHECKING:
    from calib_core.chain.late_scanner import LateScanner
    from calib_core.chain.tcp_solution import TcpSolution
    from calib_core.chain.turntable import TurntableSolution
    from calib_core.fusion.crew import Crew, MergeOptions
    from calib_core.graph.keys import Graph


@dataclass(frozen=True, eq=False)
class Observed:
    """A stage's captures as the solvers take them, and why others are of no use."""

    observations: list[SphereObservation]
    failed: dict[str, MeasurementError]
    unused: list[Finding]

    def explaining(self, error: MotionError) -> MotionError:
        """Return an error about too few captures with why others are of no use."""
        told = [sentence_of(one) for one in self.unused if self.failed.keys().isdisjoint(one.captures)]
        return error.with_failures(self.failed).after(told)


@dataclass(frozen=True, eq=False)
class SolvedTcp:
    """The tcp captures' solution and what it was solved from."""

    solution: "TcpSolution"
    observations: list[SphereObservation]
    sphere: SphereSize
    unused: list[Finding]
    noticed: list[Finding] = field(default_factory=list)

    @property
    def left_out(self) -> set[str]:
        """The captures that are of no use, but for those that the user excluded."""
        return {name for finding in self.unused for name in finding.captures}


@dataclass(frozen=True, eq=False)
class SolvedTable:
    """The table captures' solution and what it was solved from; scanners that it places, for the whole chain.

    `sought`: where scanners were found to be by the balls on axes, before these were fitted, if so.
    """

    solution: "TurntableSolution"
    observations: list[TableObservation]
    unused: list[Finding]
    late: "Sequence[LateScanner]" = ()
    sought: "TcpSolution | None" = None


@dataclass(eq=False)
class Kept:
    """What the stages of one run have solved already of the same captures, so that nothing is solved twice."""

    tcp: "SolvedTcp | None" = None
    table: "SolvedTable | None" = None
    results: dict[str, Result] = field(default_factory=dict[str, Result])
    graph: "Graph | None" = None

    @classmethod
    def of_stored(cls, graph: "Graph", stored: Mapping[str, Mapping[str, Any]], without: str) -> "Kept":
        """Return what stored results, as JSON data, spare a solve: the fresh ones, but not `without` itself."""
        stale = graph.stale(stored)
        return cls(
            results={
                stage.name: stage.result.model_validate(stored[stage.name])
                for stage in stages()
                if stage.name in stored and stage.name not in (without, *stale)
            },
            graph=graph,
        )


SolveOther = Callable[[str, Progress], Result]
FindCrew = Callable[["MergeOptions"], AbstractContextManager["Crew"]]


def _alone(stage: str, _progress: Progress) -> Result:
    raise ValueError(f"a stage that rests on '{stage}' was started without it")


@dataclass(frozen=True, eq=False)
class StageInput:
    """What a stage's solver gets: the session, the stage's captures, their files, and whom to tell progress.

    `store` takes files that a stage makes beside its result, by name and in pieces; without one they are not made.
    `solve_other` gives the result of another stage that this one rests on.  `crew` gives who does the work of a
    merge, where that is not this process alone.
    """

    session: Session
    captures: list[Capture]
    read: ReadFile
    inputs_sha256: str
    progress: Progress
    store: StoreFile | None = None
    kept: Kept = field(default_factory=Kept)
    solve_other: SolveOther = _alone
    crew: FindCrew | None = None
