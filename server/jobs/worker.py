"""What runs in a worker process: one solve at a time, which it tells of."""

import logging
import os
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from multiprocessing import parent_process
from typing import TYPE_CHECKING, Any, NamedTuple

from calib_core.captures.observation_cache import keeping
from calib_core.errors import InputError
from calib_core.messages import message
from server.settings import BlobPlace
from server.store.blob_places import open_blobs
from server.store.blobs import Blobs
from server.store.process_data import Output
from server.store.unavailable import UnavailableError

if TYPE_CHECKING:
    from calib_core.graph.stage_input import FindCrew
    from server.settings import Settings

Place = int | str
"""Where a worker is: its process id, or its address in a cluster."""


class Message(NamedTuple):
    """What a worker tells of a job: that it is "started", at its place; or "progress", (fraction, message)."""

    job: str
    kind: str
    value: Any


log = logging.getLogger("scancell")

_REPORT_EVERY_S = 0.2
_REPORT_STEP = 0.03  # a long step's name is told however soon it follows the one before
_settings: "Settings | None" = None
_place: Place = 0
_tell: Callable[[Message], None] | None = None
_crew: "FindCrew | None" = None


@dataclass(frozen=True)
class Solved:
    """A stage's result (or a replay's comparison) as JSON data, and the files that it made, by name, as blobs.

    `fresh` is what a replay found anew, by stage.
    """

    result: dict[str, Any]
    outputs: Mapping[str, Output]
    fresh: Mapping[str, dict[str, Any]] = field(default_factory=dict[str, dict[str, Any]])


def initialize(tell: Callable[[Message], None], settings: "Settings") -> None:
    """Prepare a fresh worker process."""
    begin(settings, os.getpid(), tell)
    threading.Thread(target=end_with_the_server, daemon=True).start()
    if settings.warm_up:
        try:
            warm_up()
        except Exception:  # the solve itself will meet the fault again and say so
            log.exception("a worker could not be warmed up")


def begin(
    settings: "Settings", place: Place, tell: Callable[[Message], None], crew: "FindCrew | None" = None
) -> None:
    """Say what this process works with, where it is, whom it tells, and who does the work of a merge."""
    global _settings, _place, _tell, _crew
    _settings, _place, _tell, _crew = settings, place, tell, crew


def end_with_the_server() -> None:
    """Wait for the end of the server, and end too."""
    server = parent_process()
    if server is not None:
        server.join()
        os._exit(1)


@cache
def warm_up() -> None:
    """Import and compile what a solve needs, by solving a small simulated session: once, and for all forks."""
    from calib_core.simulation import simulate
    from calib_core.stages.pipeline import solve_stage

    simulated = simulate("tcp", 1)
    solve_stage(simulated.session, "tcp", simulated.files.__getitem__)


def ready() -> bool:
    """Return that this process has been initialized."""
    return True


def solve(
    job_id: str,
    session: Mapping[str, Any],
    stage: str,
    digests: Mapping[str, str],
    solved: Mapping[str, Mapping[str, Any]],
) -> Solved:
    """Solve a stage of a session, files given by the SHA-256 of their blobs.

    `solved` are stored results: those that are fresh are not solved again where the stage rests on them.

    Raises
    ------
    CalibrationError
        What the stage's solver says; also where there is no room for the files that it makes.
    """
    progress = started(job_id)
    from calib_core.archive.folder import result_data
    from calib_core.graph.keys import Graph
    from calib_core.graph.stage_input import Kept
    from calib_core.records import parse_session
    from calib_core.stages.pipeline import solve_stage

    record = parse_session(session)
    kept = Kept.of_stored(Graph(record, digests.__getitem__), solved, without=stage)
    outputs = _Outputs(_blobs(), stage)
    result = solve_stage(record, stage, _reader(digests), progress, outputs.store, kept, _crew)
    return Solved(result_data(result), outputs.stored)


def replay(
    job_id: str, session: Mapping[str, Any], results: Mapping[str, Any], digests: Mapping[str, str]
) -> Solved:
    """Solve every stage with a stored result afresh and compare: the record `Recomputed` as JSON data.

    Raises
    ------
    CalibrationError
        Where no result is stored; a stage that cannot be solved any more says so in the comparison.
    """
    progress = started(job_id)
    from calib_core.records import parse_session
    from calib_core.review.compare import Compared, compare_results
    from calib_core.review.replay import replay as compare_all

    record = parse_session(session)
    fresh: dict[str, Any] = {}
    compared = compare_all(record, _reader(digests), results, progress, fresh=fresh.__setitem__)
    stages = {
        stage: compare_results(Compared("", results[stage], record), Compared("", new, record)).to_json()
        for stage, new in fresh.items()
    }
    return Solved({"replay": compared.to_json(), "stages": stages}, {}, fresh)


def measure(cell: Mapping[str, Any], capture: Mapping[str, Any], digests: Mapping[str, str]) -> str:
    """Return what is measured in a capture as JSON text, its files given by the SHA-256 of their blobs.

    Raises
    ------
    CalibrationError
        If the record or a file is of no use at all.
    """
    from calib_core.records import parse_capture, parse_session
    from server.measuring import check_poses, measured_with_text

    session, record = parse_session(cell, "session"), parse_capture(capture, "record")
    check_poses(session, record)
    return measured_with_text(session, record, _reader(digests))[1]


def started(job_id: str) -> Callable[[float, str], None]:
    """Say that a job runs here, and return what tells of its progress."""
    assert _tell is not None
    tell = _tell
    tell(Message(job_id, "started", _place))
    told_s = told_fraction = 0.0

    def progress(fraction: float, message: str) -> None:
        nonlocal told_s, told_fraction
        if time.monotonic() - told_s > _REPORT_EVERY_S or fraction - told_fraction > _REPORT_STEP:
            told_s, told_fraction = time.monotonic(), fraction
            tell(Message(job_id, "progress", (float(fraction), message)))

    return progress


@cache
def _opened(place: BlobPlace) -> Blobs:
    return open_blobs(place, look=False)  # the server has looked


def _blobs() -> Blobs:
    assert _settings is not None
    return _opened(_settings.blob_place)


def _reader(digests: Mapping[str, str]) -> Callable[[str], bytes]:
    assert _settings is not None
    return keeping(BlobReader(_settings.blob_place, digests), _blobs().observations)


@dataclass(frozen=True)
class BlobReader:
    """Reads a session's files by name where they lie; other processes that it is sent to do so themselves."""

    place: BlobPlace
    digests: Mapping[str, str]

    def __call__(self, name: str) -> bytes:
        """Return the bytes of a file; raises NotFoundError, DamagedError."""
        return _opened(self.place).read(self.digests[name])


class _Outputs:
    """What a stage makes beside its result, stored as blobs; the server refers to them once the job is done."""

    def __init__(self, blobs: Blobs, stage: str) -> None:
        self._blobs, self._stage = blobs, stage
        self.stored: dict[str, Output] = {}

    def store(self, name: str, pieces: Iterable[bytes | memoryview]) -> None:
        """Store one file; raises InputError where there is no room for it."""
        try:
            self.stored[name] = Output(*self._blobs.put_pieces(pieces))
        except UnavailableError:
            raise
        except OSError as error:
            got = (error.strerror or type(error).__name__).lower()
            to_do = message("Make room there, then run it again; what was stored before is untouched.")
            raise InputError("room in the data folder for {name}", got, to_do, self._stage, name=name) from None
