"""Which latest results of sessions are stale, for lists: told again without reading until the session changes."""

from collections.abc import Collection, Mapping

from sqlalchemy import func, select
from sqlalchemy.orm import Session as Transaction

from calib_core.records import parse_session
from server.store.models import CaptureRow, ResultRow, SessionRow
from server.store.session_files import files_read

_MOST = 20_000  # sessions; then all are forgotten
_State = tuple[str, int, str, frozenset[tuple[str, str]]]
_known: dict[_State, frozenset[str]] = {}


def stale_stages(db: Transaction, session_ids: Collection[str]) -> dict[str, frozenset[str]]:
    """Return the stages whose latest result was solved from something else, of each session that has results."""
    hashes = _latest_hashes(db, session_ids)
    query = select(SessionRow.id, SessionRow.revision, SessionRow.updated).where(SessionRow.id.in_(hashes))
    states = {
        row.id: (row.id, row.revision, row.updated, frozenset(hashes[row.id].items())) for row in db.execute(query)
    }
    unknown = [session_id for session_id, state in states.items() if state not in _known]
    found = _read(db, {session_id: hashes[session_id] for session_id in unknown}) if unknown else {}
    told = {
        session_id: found[session_id] if session_id in found else _known[state]
        for session_id, state in states.items()
    }
    if len(_known) + len(found) > _MOST:
        _known.clear()
    _known.update({states[session_id]: stale for session_id, stale in found.items()})
    return told


def _latest_hashes(db: Transaction, session_ids: Collection[str]) -> dict[str, dict[str, str]]:
    """Return what each stage's latest result was solved from, by session and stage."""
    latest = select(func.max(ResultRow.number)).where(ResultRow.session_id.in_(session_ids))
    sha256 = ResultRow.record["inputs_sha256"].as_string()
    query = select(ResultRow.session_id, ResultRow.stage, sha256).where(
        ResultRow.number.in_(latest.group_by(ResultRow.session_id, ResultRow.stage))
    )
    found: dict[str, dict[str, str]] = {}
    for session_id, stage, solved_from in db.execute(query):
        found.setdefault(session_id, {})[stage] = solved_from or ""
    return found


def _read(db: Transaction, hashes: Mapping[str, Mapping[str, str]]) -> dict[str, frozenset[str]]:
    """Return the stale stages of sessions, each read as a whole: 0.5 to 2 ms of the processor a session."""
    from calib_core.graph.keys import Graph

    captures: dict[str, list[object]] = {}
    rows = select(CaptureRow.session_id, CaptureRow.record).where(CaptureRow.session_id.in_(hashes))
    for session_id, record in db.execute(rows.order_by(CaptureRow.position)):
        captures.setdefault(session_id, []).append(record)
    digests: dict[str, dict[str, str]] = {}
    for session_id, name, sha256 in db.execute(files_read(hashes)):
        digests.setdefault(session_id, {})[name] = sha256
    found: dict[str, frozenset[str]] = {}
    for session_id, record in db.execute(
        select(SessionRow.id, SessionRow.record).where(SessionRow.id.in_(hashes))
    ):
        session = parse_session({**record, "captures": captures.get(session_id, [])}, session_id)
        results = {stage: {"inputs_sha256": sha256} for stage, sha256 in hashes[session_id].items()}
        found[session_id] = Graph(session, digests.get(session_id, {}).__getitem__).stale(results)
    return found
