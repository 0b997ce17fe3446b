"""Archives: a stored session out as one zip, and one in, all or nothing."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import IO

from sqlalchemy.orm import Session as Transaction

from calib_core.archive.archive import (
    REPORT_FILE,
    SCENE_FILE,
    ArchivedSession,
    pack_files,
    plain_name,
    read_archive,
)
from calib_core.archive.bag import PAYLOAD, Bag, Content, open_bag
from calib_core.archive.bag_zip import LIMITS, ArchiveLimits
from calib_core.archive.dates import ANSWER_FILE
from calib_core.archive.folder import SESSION_FILE, to_json_bytes
from calib_core.archive.stored_clouds import REFERENCE_FILE
from calib_core.archive.stored_results import output_names
from calib_core.errors import CalibrationError, ConflictError, InputError
from calib_core.messages import message
from calib_core.records import FORMAT, Measured, Session
from calib_core.steps import stage_names
from server.measuring import Measure, check_poses, measure
from server.store.archived_files import add_archived_files
from server.store.archived_history import HISTORY_FILE, ArchivedHistory, read_history, restore
from server.store.blobs import Blobs
from server.store.calibrations import without_captures
from server.store.capture_writes import Arrival, add_captures
from server.store.models import Data, SessionRow
from server.store.process_data import Output
from server.store.references import add_reference
from server.store.sessions import STORE_FIELDS, StoredSession, create_session
from server.store.solves import store_result

_MAX_NAME = 500
_WHERE = "archive"
_MADE_ANEW = (REPORT_FILE, SCENE_FILE, ANSWER_FILE)


@dataclass
class Import:
    """A session on its way from an archive into the store: all of it is checked, its files are blobs."""

    session: Session
    results: Mapping[str, Data]
    history: ArchivedHistory
    measured: dict[str, Measured] = field(default_factory=dict[str, Measured])
    digests: dict[str, str] = field(default_factory=dict[str, str])
    sizes: dict[str, int] = field(default_factory=dict[str, int])
    outputs: dict[str, dict[str, Output]] = field(default_factory=dict[str, dict[str, Output]])
    reference: tuple[str, Output] | None = None
    kept: dict[str, Output] = field(default_factory=dict[str, Output])


def pack_stored(
    stored: StoredSession, kept: Mapping[str, Output], out: IO[bytes], pages: Mapping[str, bytes]
) -> None:
    """Write a stored session's archive.

    Parameters
    ----------
    stored : StoredSession
    kept : mapping
        What an archive that it was imported from held beside it; its pages give way to new ones.
    out : binary file
        To read and write.
    pages : mapping
        What goes in beside the session: its scene, its report, its past, by file name.

    Raises
    ------
    ConflictError
        If a capture's file would be another file of the session folder too.
    CalibrationError
        If a name cannot be stored everywhere, or a stored file is damaged.
    """
    taken = {*_MADE_ANEW, *(plain_name(name) for name in stored.digests)}
    files = {name: file for name, file in kept.items() if name not in taken}
    files |= {name: file for name, file in stored.outputs.items() if name not in stored.digests}
    payload: dict[str, Content] = {
        **{name: partial(stored.blobs.open, file.sha256) for name, file in files.items()},
        SESSION_FILE: to_json_bytes({"format": FORMAT, **stored.session.to_json()}),
        **{f"results/{stage}.json": to_json_bytes(result) for stage, result in stored.results.items()},
        **pages,
    }
    for name, digest in stored.digests.items():
        if plain_name(name) in payload:
            got = message("a capture's file named {name}", name=name)
            raise ConflictError("names that differ", got, "Rename the file.", stored.id)
        payload[plain_name(name)] = partial(stored.blobs.open, digest)
    pack_files(stored.session, payload, out, stored.id)


def read_import(
    file: IO[bytes], blobs: Blobs, measured_by: Measure = measure, limits: ArchiveLimits = LIMITS
) -> Import:
    """Check an archive as a whole, measure its captures, and then store its files as blobs.

    Raises
    ------
    CalibrationError
        With the first thing that is wrong; nothing is stored then.
    """
    with open_bag(file, _WHERE, limits) as bag:
        bag.verify()
        archived = read_archive(bag)
        found = Import(archived.session, archived.results, read_history(bag))
        _require_storable(archived)
        session = without_captures(archived.session, archived.results)
        for capture in archived.session.captures:
            check_poses(session, capture)
            found.measured[capture.id] = measured_by(session, capture, archived.read)
        for name in dict.fromkeys(name for capture in archived.session.captures for name in capture.files):
            content = archived.read(name)
            found.digests[name], found.sizes[name] = blobs.put(content), len(content)
        _store_others(found, bag, blobs)
    return found


def _store_others(found: Import, bag: Bag, blobs: Blobs) -> None:
    """Store what stands beside session and captures: what stages made, the reference mesh, all that is kept."""
    rest = set(bag.payload) - {SESSION_FILE, HISTORY_FILE, *(f"results/{stage}.json" for stage in found.results)}
    rest -= {plain_name(name) for name in found.digests}

    def stored(name: str) -> Output:
        rest.remove(name)
        return Output(*blobs.put_pieces(bag.chunks(PAYLOAD + name)))

    for stage, result in found.results.items():
        found.outputs[stage] = {name: stored(name) for name in output_names(result) if name in rest}
    named = found.session.cell.merge.reference or REFERENCE_FILE
    found.reference = (named, stored(named)) if named in rest else None
    found.kept = {name: stored(name) for name in sorted(rest)}


def add_import(db: Transaction, found: Import) -> SessionRow:
    """Store what an archive holds as a new session."""
    record = {name: value for name, value in found.session.to_json().items() if name not in STORE_FIELDS}
    del record["captures"]
    row = create_session(db, record, None)
    arrivals = [
        Arrival(
            capture,
            found.measured[capture.id],
            {name: found.digests[name] for name in capture.files},
            {name: found.sizes[name] for name in capture.files},
        )
        for capture in found.session.captures
    ]
    for answer in add_captures(db, row.id, arrivals, record):
        if isinstance(answer, CalibrationError):
            raise answer
    db.refresh(row)
    known = restore(db, row.id, found.history)
    for stage, result in found.results.items():
        past = known.get(stage)
        solved_from, created = (past.origin(), past.created) if past else (None, None)
        store_result(db, row, stage, result, solved_from, found.outputs.get(stage), created)
    if found.reference is not None:
        add_reference(db, row.id, *found.reference)
    add_archived_files(db, row.id, found.kept)
    return row


def _require_storable(archived: ArchivedSession) -> None:
    """Refuse what a session folder may have and the store has no place for."""
    where = f"{_WHERE}: {SESSION_FILE}"
    if len(archived.session.name) > _MAX_NAME:
        got = f"{len(archived.session.name)}"
        raise InputError("a name of at most {max_name} characters", got, "Shorten it.", where, max_name=_MAX_NAME)
    for stage in archived.results:
        if stage not in stage_names():
            raise InputError(
                "results of the stages {stage_names}",
                "one of '{alone}'",
                "Import it with a version of scancell that solves this stage.",
                f"{_WHERE}: results",
                stage_names=", ".join(stage_names()),
                alone=stage[:60],
            )
    if any(len(set(capture.files)) != len(capture.files) for capture in archived.session.captures):
        raise InputError("names that differ", "one that stands twice", "Name it once.", where)
