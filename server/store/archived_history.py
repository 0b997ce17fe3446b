"""A session's past within its archive, `history.json`: when captures came, and all results with their origin."""

from typing import Annotated, Any, Final, Literal

from pydantic import Field, ValidationError
from sqlalchemy import select, update
from sqlalchemy.orm import Session as Transaction

from calib_core.archive.bag import Bag
from calib_core.archive.folder import HISTORY_FILE, parse_json, to_json_bytes
from calib_core.archive.stored_results import require_result
from calib_core.errors import InputError
from calib_core.formats.points import require_file_size
from calib_core.messages import message
from calib_core.records import Record, input_error, parse_session
from calib_core.records.plain_json import require_plain
from calib_core.steps import stage_names
from server.store.history import PastResult, past_results
from server.store.models import CaptureRow, Data, ResultRow

_MOST_BYTES: Final = 256 << 20
_MOST_RESULTS: Final = 10_000

Moment = Annotated[str, Field(pattern=r"^\d{4}-[01]\d-[0-3]\dT[0-2]\d:[0-5]\d:[0-5]\d\.\d{3}Z$")]
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class SolvedFrom(Record):
    """What a result was computed from: the session's record as it was then, and its files' SHA-256."""

    session: dict[str, Any]
    files: dict[str, Digest]


class ArchivedResult(Record):
    """One result; the stage's latest one stands in `results/` and is null here."""

    stage: str
    created: Moment
    record: dict[str, Any] | None = None
    solved_from: SolvedFrom | None = None

    def origin(self) -> Data | None:
        """Return what it was solved from as the store keeps it."""
        return None if self.solved_from is None else self.solved_from.to_json()


class ArchivedHistory(Record):
    """What a time line needs beside session and latest results; `captures` is when each came."""

    format: Literal["scancell-history/1"] = "scancell-history/1"
    captures: dict[str, Moment] = Field(default_factory=dict)
    results: list[ArchivedResult] = Field(default_factory=list[ArchivedResult], max_length=_MOST_RESULTS)


def history_bytes(db: Transaction, session_id: str) -> bytes:
    """Return a session's past as it goes into an archive."""
    rows = db.execute(select(CaptureRow.id, CaptureRow.created).where(CaptureRow.session_id == session_id))
    past = past_results(db, session_id)
    latest = {result.stage: result.number for result in past}
    results = [_archived(result, latest=latest[result.stage] == result.number) for result in past]
    return to_json_bytes(ArchivedHistory(captures=dict(rows.all()), results=results).to_json())


def read_history(bag: Bag) -> ArchivedHistory:
    """Return the past that an archive holds, an empty one where it holds none.

    Raises
    ------
    InputError
        If it is not what it should be.
    TooLargeError
        If it is longer than any history.
    """
    if HISTORY_FILE not in bag.payload:
        return ArchivedHistory()
    where = f"{bag.where}: {HISTORY_FILE}"
    require_file_size(bag.size(HISTORY_FILE), where, _MOST_BYTES)
    data = parse_json(bag.read(HISTORY_FILE), where)
    require_plain(data, where)
    try:
        history = ArchivedHistory.model_validate(data)
    except ValidationError as error:
        raise input_error(error, data, where) from None
    for number, result in enumerate(history.results):
        place = f"{where}: results[{number}]"
        if result.stage not in stage_names():
            raise InputError.unknown(
                result.stage, stage_names(), f"{place}.stage", message("Pack the session again.")
            )
        if result.record is not None:
            require_result(result.stage, result.record, place)
        if result.solved_from is not None:
            parse_session(result.solved_from.session, f"{place}: solved_from")
    return history


def restore(db: Transaction, session_id: str, history: ArchivedHistory) -> dict[str, ArchivedResult]:
    """Store when captures came and all results but the latest; returns what is known of the latest, by stage.

    The session's captures are stored already; the latest results come after these.
    """
    for capture, created in history.captures.items():
        named = update(CaptureRow).where(CaptureRow.session_id == session_id, CaptureRow.id == capture)
        db.execute(named.values(created=created))
    latest: dict[str, ArchivedResult] = {}
    for result in history.results:
        if result.record is None:
            latest[result.stage] = result
            continue
        row = ResultRow(session_id=session_id, stage=result.stage, created=result.created)
        row.record, row.verdict, row.solved_from = result.record, result.record["verdict"], result.origin()
        db.add(row)
        db.flush()  # numbers follow the order
    return latest


def _archived(result: PastResult, *, latest: bool) -> ArchivedResult:
    solved_from = None
    if result.session is not None:
        solved_from = SolvedFrom(session=result.session.to_json(), files=dict(result.files))
    return ArchivedResult(
        stage=result.stage,
        created=result.created,
        record=None if latest else result.record,
        solved_from=solved_from,
    )
