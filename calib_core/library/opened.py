"""A session at hand: loaded from a folder or an archive, or made of arrays."""

import tempfile
import weakref
from collections.abc import Collection, Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib_core.archive import archive
from calib_core.archive.dates import ANSWER_FILE
from calib_core.archive.folder import HISTORY_FILE, SESSION_FILE, load_session, save_session, write_result
from calib_core.disk import temporary_folder
from calib_core.errors import InputError
from calib_core.frames import FloatArray
from calib_core.records import Capture, Cell, Finding, Progress, ReadFile, Result, ResultsData, Session

if TYPE_CHECKING:
    from calib_core.exports.answer import Answer
    from calib_core.frame_graph import FoundTransform
    from calib_core.robots.read_back import ReadBack


class Results(dict[str, Any]):
    """Results by stage; `files` has what a merge made, by name."""

    def __init__(self, results: Mapping[str, Any], files: Mapping[str, bytes] | None = None) -> None:
        super().__init__(results)
        self.files = files or {}

    def __str__(self) -> str:
        return "\n\n".join(str(result) for result in self.values()) or "nothing solved"

    def _repr_html_(self) -> str:
        return "".join(result._repr_html_() for result in self.values())

    @property
    def points_mm(self) -> FloatArray:
        """The merged cloud, N×3 in the frame that the merge names; raises KeyError before a merge."""
        import numpy as np

        from calib_core.archive.stored_clouds import CLOUD_FILE, StoredFile

        stored = StoredFile(BytesIO(self.files[CLOUD_FILE]), CLOUD_FILE)
        return np.concatenate(list(stored.tables()))[:, :3].astype(float)


class OpenSession:
    """A session with its captures' files and its results.

    Parameters
    ----------
    record : Session
        As session.json holds it.
    read : callable
        Returns the bytes of a capture's file by its name.
    results : mapping, optional
        By stage.
    folder : Path, optional
        What it was loaded from: what else lies there, as its past, is saved with it.

    Attributes
    ----------
    results : Results
        What was stored or solved last, by stage.
    """

    def __init__(
        self, record: Session, read: ReadFile, results: Mapping[str, Any] | None = None, folder: Path | None = None
    ) -> None:
        self.record, self.read = record, read
        self.results = Results(results or {})
        self._folder, self._loaded = folder, dict(self.results)
        self.files: dict[str, bytes] = {}

    @property
    def cell(self) -> Cell:
        """The cell."""
        return self.record.cell

    @property
    def captures(self) -> list[Capture]:
        """The captures, in their order."""
        return self.record.captures

    def run(self, stage: str = "all", progress: Progress | None = None) -> Results:
        """Solve a stage, or all that there are captures for; return the results.

        `results` keeps them too, also what was solved before a later stage was refused.

        Raises
        ------
        CalibrationError
            If the stage is unknown or has no captures, or what its solver says.
        """
        from calib_core.stages.pipeline import run

        found: dict[str, Result] = {}
        try:
            found = run(self.record, self.read, stage, progress, self._store, found)
        finally:  # what is solved is kept though a later stage is refused
            self.results.update(found)
        return Results(found, self.files)

    def check(self) -> list[Finding]:
        """Return what is wrong with the session, and what is still missing."""
        from calib_core.review.check import check_session

        return check_session(self.record, self.read)

    def export(
        self,
        name: str,
        settings: Mapping[str, Any] | None = None,
        into: str | Path | None = None,
        allow: Collection[str] = (),
    ) -> bytes:
        """Return the answer in the format of a controller or a program.

        Parameters
        ----------
        name : str
        settings : mapping, optional
            The format's own, such as the tool's number.
        into : str or Path, optional
            A controller's backup, of which the file with the tool is returned, that one entry changed.
        allow : collection of str
            The names of faults, such as `stale`, in spite of which it is exported, and marked.

        Raises
        ------
        InputError
            If the format or a setting is unknown, or the backup does not hold the tool.
        ConflictError
            If nothing is solved yet, or the answer has faults that are not allowed.
        """
        from calib_core.exports.backups import write_into
        from calib_core.exports.export import write_export
        from calib_core.library.machines import files_of

        if into is None:
            return write_export(self._answer(), name, allow, settings)[0]
        return write_into(files_of(Path(into)), self._answer(), name, allow, settings)[1]

    def read_back(
        self, numbers: Sequence[float] | str | Path, convention: str | None = None, tool: str | None = None
    ) -> "ReadBack":
        """Compare the tool as it stands in the controller with the answer: equal, or what differs, in words.

        Parameters
        ----------
        numbers : sequence of float, or str or Path
            As the pendant shows them, or the controller's file or folder.
        convention : str, optional
            What the numbers mean; the cell's where it is left out.
        tool : str, optional
            The tool's number or name in the file.

        Raises
        ------
        InputError
            If the numbers are no pose, or the file holds no such tool.
        ConflictError
            If nothing is solved yet.
        """
        from calib_core.library.machines import files_of
        from calib_core.review.in_controller import compared_with

        if isinstance(numbers, (str, Path)):
            return compared_with(self._answer(), files=files_of(Path(numbers)), named=tool)
        return compared_with(self._answer(), numbers=list(numbers), convention=convention)

    def frame(self, into: str, outof: str, capture: str | None = None) -> "FoundTransform":
        """Return the transform ``into_from_outof`` between two frames of the cell, with its covariance.

        Parameters
        ----------
        into, outof : str
            Among base, tool0, laser, camera, board, turntable.
        capture : str, optional
            The capture whose robot pose counts, where the way leads over the robot.

        Raises
        ------
        InputError, NotFoundError
            If a frame is unknown, or there is no such capture.
        ConflictError
            If the transform does not follow from what is measured, known and solved.
        """
        from calib_core.archive.folder import result_data
        from calib_core.graph.keys import Graph
        from calib_core.review.cell_frames import frame_graph

        results = {stage: result_data(result) for stage, result in self.results.items()}
        stale = Graph.stale_of(self.record, self.read, results)
        return frame_graph(self.record, results, stale, capture).find(into, outof)

    def _answer(self) -> "Answer":
        from calib_core.archive.folder import result_data
        from calib_core.exports.answer import answer_of
        from calib_core.graph.keys import Graph
        from calib_core.review.provenance import replayed

        results = {
            stage: {**result.to_json(), "seal": None} if result.provenance == "imported" else result_data(result)
            for stage, result in self.results.items()
        }
        results = replayed(self.record, self.read, results)
        return answer_of(self.record, results, Graph.stale_of(self.record, self.read, self.results))

    def save(self, folder: str | Path) -> Path:
        """Write a new folder with all files, results and the past; raises ConflictError where another stands."""
        folder = Path(folder)
        files = {name: self.read(name) for name in self._names()}
        save_session(folder, self.record, {**self._beside(folder), **files, **self.files})
        # What was decided before comes first: writing what followed keeps it in the folder's past.
        for results in (self._loaded, self.results):
            for stage, result in results.items():
                if result is not self._loaded.get(stage) or not (folder / "results" / f"{stage}.json").exists():
                    write_result(folder, stage, result, self.record)
        return folder

    def _beside(self, folder: Path) -> dict[str, Path]:
        """Return what lies in the loaded folder beside session and results, without the pages made of them."""
        if self._folder is None:
            return {}
        made = {SESSION_FILE, ANSWER_FILE, archive.SCENE_FILE, archive.REPORT_FILE}
        if (folder / HISTORY_FILE).exists():  # saved there before, and grown since
            made.add(HISTORY_FILE)
        files = archive.folder_files(self._folder, folder)
        return {name: file for name, file in files.items() if name not in made and not name.startswith("results/")}

    def pack(self, file: str | Path) -> Path:
        """Write the session's archive; an older file of the name is replaced once the new one is whole."""
        with temporary_folder() as folder:
            archive.pack(self.save(folder / "session"), Path(file))
        return Path(file)

    def _names(self) -> Iterator[str]:
        for capture in self.captures:
            yield from capture.files

    def _store(self, name: str, pieces: Any) -> None:
        self.files[name] = b"".join(pieces)

    def __repr__(self) -> str:
        name = self.record.name or "session"
        done = ", ".join(f"{stage} {result.verdict}" for stage, result in self.results.items())
        return f"<{name}: {len(self.captures)} captures; {done or 'nothing solved'}>"


def load(path: str | Path) -> OpenSession:
    """Return the session in a folder or in an archive, with its stored results.

    Parameters
    ----------
    path : str or Path
        A session folder, its session.json, or an archive, which is verified and unpacked for as long as the
        session is used.

    Raises
    ------
    CalibrationError
        If it is none of these, or the archive is damaged.
    """
    place = Path(path)
    if not archive.is_archive(place):
        return _loaded(place)
    temporary = tempfile.TemporaryDirectory(prefix="scancell-", ignore_cleanup_errors=True)
    archive.unpack(place, Path(temporary.name) / "session")
    session = _loaded(Path(temporary.name) / "session" / "data")
    weakref.finalize(session, temporary.cleanup)
    return session


def simulate(scenario: str, seed: int = 1) -> tuple[OpenSession, dict[str, Any]]:
    """Return the session of a simulated cell, and its truth; raises InputError for an unknown scenario."""
    from calib_core.simulation import simulate as simulate_cell

    made = simulate_cell(scenario, seed)
    return in_memory(made.session, made.files), made.truth


def in_memory(record: Session, files: Mapping[str, bytes]) -> OpenSession:
    """Return a session whose captures' files are given by name."""

    def read(name: str) -> bytes:
        if name not in files:
            raise InputError("a file of the session", "none named '{name}'", "Add it.", name, name=name)
        return files[name]

    return OpenSession(record, read)


def _loaded(place: Path) -> OpenSession:
    from calib_core.archive.folder import folder_of
    from calib_core.archive.stored_results import stored_results

    record, read = load_session(place)
    folder = folder_of(place)
    return OpenSession(record, read, as_records(record, stored_results(folder)), folder)


def as_records(session: Session, stored: ResultsData) -> dict[str, Result]:
    """Return results given as JSON data as records; evidence that an older version did not write is made."""
    from calib_core.archive.stored_results import result_record
    from calib_core.stages.evidence import stored_evidence
    from calib_core.steps import stage_names

    found: dict[str, Result] = {}
    for stage, data in stored.items():
        if stage in stage_names():
            record = result_record(stage).model_validate(data)
            found[stage] = record.model_copy(update={"evidence": stored_evidence(session, data)})
    return found
