"""What the server's processes hand each other of a session: without the database, which only the service opens."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from calib_core.errors import CalibrationError
from calib_core.records import Session

if TYPE_CHECKING:
    from server.store.models import OutputRow

Data = dict[str, Any]


@dataclass(frozen=True)
class Output:
    """A file that a stage made beside its result, by the SHA-256 of its blob and its size in bytes."""

    sha256: str
    size: int

    def to_row(self, session_id: str, name: str, stage: str) -> "OutputRow":
        """Return the row by which a session has this file."""
        from server.store.models import OutputRow

        return OutputRow(session_id=session_id, name=name, stage=stage, sha256=self.sha256, size=self.size)


class SessionTexts(NamedTuple):
    """What a guide is made of, as JSON texts.

    `record` is the session's without captures; `captures` are in their order, and `measured` is what was seen in
    each; `results` are the latest by stage; `digests` maps the captures' files to the SHA-256 of their content.
    """

    id: str
    record: str
    captures: tuple[str, ...]
    measured: tuple[str, ...]
    results: Mapping[str, str]
    digests: Mapping[str, str]


def with_stale(session: Session, results: Mapping[str, Data], digests: Mapping[str, str]) -> dict[str, Data]:
    """Return what `StoredSession.results_with_stale` does."""
    from calib_core.graph.keys import Graph

    stale = Graph(session, digests.__getitem__).stale(results)
    return {
        stage: {**result, "stale": stage in stale, **_seen_from_poses(session, result)}
        for stage, result in results.items()
    }


def _seen_from_poses(session: Session, result: Data) -> Data:
    from calib_core.exports.workpiece import at_workpiece, turned_deg

    try:
        at = [row.to_json() for row in at_workpiece(session, result)]
        return {"at_workpiece": at, "turned_deg": turned_deg(session, result)}
    except CalibrationError:
        return {"at_workpiece": [], "turned_deg": {}}  # of an archive whose numbers are none
