"""Session folders: session.json, the captures' files, and the results beside them.

Nothing stored is ever changed in place: a file is written beside its name, flushed to the disk, then renamed.
"""

import codecs
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from calib_core.archive.bag_names import require_distinct_names
from calib_core.archive.observation_store import OWN_FOLDER, KeptObservations
from calib_core.archive.seals import decisions_sealed, seal_state, signed_result, with_provenance
from calib_core.archive.session_versions import to_present_format
from calib_core.captures.observation_cache import KeepingReader
from calib_core.disk import extended
from calib_core.errors import ConflictError, InputError
from calib_core.formats.points import MAX_FILE_BYTES, require_file_size
from calib_core.formats.shared.writing import write_atomically
from calib_core.messages import message, with_parts
from calib_core.moment import now, text_of_seconds
from calib_core.records import ReadFile, Record, Session, parse_session
from calib_core.records.plain_json import require_plain, told_once

SESSION_FILE = "session.json"
HISTORY_FILE = "history.json"
"""The past of a session: earlier results, as a server's archive has it."""
_URDF_ENDINGS = (".urdf", ".xacro", ".xml", ".yaml", ".yml")
MAX_SESSION_BYTES = 32_000_000
_ROOM = 100  # for the names of captures' files
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)  # as PowerShell writes what is sent to a file


def load_session(path: Path) -> tuple[Session, ReadFile]:
    """Return the session in a folder, and the function that reads its captures' files.

    What is seen in them is kept in the folder's `.scancell/`, so that it is measured once.

    Parameters
    ----------
    path : Path
        The folder, or the session.json in it.

    Raises
    ------
    InputError
        If session.json is missing, not JSON or not a session, with the line or the field at fault.  The reader
        raises it too where a file is missing, not a file, or outside of the folder.
    TooLargeError
        If session.json, or later a capture's file, is beyond the limits.
    """
    folder = folder_of(path)
    file = folder / SESSION_FILE
    data = parse_json(read_bytes(file, message("Write the session's record."), MAX_SESSION_BYTES), str(file))
    if not isinstance(data, dict):
        to_do = "Write the session's record."
        raise InputError("a JSON object", "a {name}", to_do, str(file), name=type(data).__name__)
    record = to_present_format(cast("dict[str, Any]", data), str(file))
    record = _with_arm(record, folder)
    session = parse_session(record, str(file))
    require_plain(record, str(file))
    if _ignores_case(file):
        require_distinct_names(dict.fromkeys(name for c in session.captures for name in c.files), str(file))
    return session, KeepingReader(_reader(folder), KeptObservations(folder / OWN_FOLDER))


def _ignores_case(file: Path) -> bool:
    """Return whether a folder holds two names that differ in case for one, as on Windows and macOS."""
    return file.with_name(file.name.upper()).exists()


def _with_arm(record: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return a session's record with the joints of the URDF that its arm names, a file in the folder."""
    cell = record.get("cell")
    robot = cast("dict[str, Any]", cell).get("robot") if isinstance(cell, dict) else None
    arm = cast("dict[str, Any]", robot).get("arm") if isinstance(robot, dict) else None
    if not isinstance(arm, str) or not arm.lower().endswith(_URDF_ENDINGS):
        return record
    from calib_core.arms.urdf import arm_from_urdf

    table = arm_from_urdf(_reader(folder)(arm), arm).to_json()
    return {
        **record,
        "cell": {**cast("dict[str, Any]", cell), "robot": {**cast("dict[str, Any]", robot), "arm": table}},
    }


def folder_of(path: Path) -> Path:
    """Return the folder of a session: named by itself, by its session.json, or as an unpacked archive.

    Raises
    ------
    InputError
        If the path is nothing of these.
    """
    path = extended(path, _ROOM)
    if path.is_dir():
        return path / "data" if (path / "bagit.txt").is_file() and not (path / SESSION_FILE).exists() else path
    if path.name == SESSION_FILE and path.is_file():
        return path.parent
    need = message("a session folder with {session_file} in it", session_file=SESSION_FILE)
    if path.suffix.lower() == ".zip" and path.is_file():
        to_do = "Unpack it, and name the session folder inside."
        raise InputError(need, "an archive, a .zip file", to_do, str(path))
    got = message("something else") if path.exists() else message("nothing there")
    raise InputError(need, got, "Name the session's folder.", str(path))


def parse_json(data: bytes, where: str) -> Any:
    """Return the data of JSON text; raises InputError with line and column, or that the text was cut off."""
    to_do = message("Correct it there; a JSON checker shows the place.")
    try:
        text = data.decode("utf-16" if data.startswith(_UTF_16) else "utf-8-sig")
    except UnicodeDecodeError as error:
        need = "JSON (UTF-8 text)"
        raise InputError(need, "a byte that is no text at {start}", to_do, where, start=error.start) from None
    if not text.strip():
        raise InputError("JSON", "an empty file", "Copy or export it again.", where)
    try:
        return json.loads(text, object_pairs_hook=told_once)
    except InputError as error:
        raise error.at(where) from None
    except json.JSONDecodeError as error:
        if error.pos >= len(text.rstrip()):
            got = message("a text that ends too early, in line {lineno}", lineno=error.lineno)
            raise InputError("JSON", got, "Copy or export it again.", where) from None
        got = message(
            "something else in line {lineno}, column {colno} ({msg})",
            lineno=error.lineno,
            colno=error.colno,
            msg=error.msg.lower(),
        )
        raise InputError("JSON", got, to_do, where) from None
    except (RecursionError, ValueError):  # nested too deeply, or integers of thousands of digits
        raise InputError("JSON of ordinary depth and numbers", "something else", to_do, where) from None


def save_session(folder: Path, session: Session, files: Mapping[str, bytes | Path]) -> None:
    """Write a new session folder; session.json comes last, so that it never names a file that is not there.

    Files come as what they hold, or as where they lie: those are read one by one.

    Raises
    ------
    ConflictError
        If the folder holds other files under these names: nothing is written then.
    InputError
        If it cannot be written.
    """
    contents = {**files, SESSION_FILE: to_json_bytes(session.to_json())}
    for name, content in contents.items():
        path = folder / name
        if path.exists() and not (path.is_file() and path.read_bytes() == _held(content)):
            to_do = "Choose another folder."
            raise ConflictError("a folder without a session", "{name} there", to_do, str(folder), name=name)
    for name, content in contents.items():
        write_atomically(folder / name, _held(content))


def _held(content: bytes | Path) -> bytes:
    return content.read_bytes() if isinstance(content, Path) else content


def write_result(folder: Path, stage: str, result: Record, session: Session) -> dict[str, Any]:
    """Write a stage's result as `results/<stage>.json` in a folder; returns what it holds, raises InputError.

    One that was solved just now, from `session`, is given the time and signed, but where the very same result
    stands there already: that one stays.  One that came from elsewhere is written as it came.
    """
    path = folder / "results" / f"{stage}.json"
    data = result_data(result)
    if data.get("provenance") is None:
        stored = _same_before(path, data)
        if stored is not None:
            return stored
        _keep_past(folder, stage, path)
        before = decisions_of(past_of(folder)) if stage == "verify" else []
        data = signed_result({**data, "solved": data.get("solved") or now()}, session, before=before)
    write_atomically(path, to_json_bytes(data))
    return data


def past_of(folder: Path) -> dict[str, Any]:
    """Return what a folder keeps of its past, as JSON data; raises InputError where it is none."""
    path = folder / HISTORY_FILE
    if not path.exists():
        return {"format": "scancell-history/1", "results": []}
    to_do = message(
        "Put back a copy of it. Whoever removes it removes what was decided before: then captures and limits must "
        "be looked at anew."
    )
    try:
        data = parse_json(read_bytes(path, to_do), str(path))
    except InputError as error:
        raise InputError(error.need, error.got, to_do, error.where) from None
    if not isinstance(data, dict) or not _are_results(data.get("results", [])):
        raise InputError("the results that this session had before", "something else", to_do, str(path))
    return {"results": [], **cast("dict[str, Any]", data)}


def _are_results(past: Any) -> bool:
    """Return whether this is a list of results with their stage, each whole or, the latest, told elsewhere."""
    return isinstance(past, list) and all(
        isinstance(one, dict)
        and isinstance(one.get("stage"), str)
        and all(isinstance(one.get(name), dict | None) for name in ("record", "solved_from"))
        for one in cast("list[Any]", past)
    )


def _keep_past(folder: Path, stage: str, path: Path) -> None:
    """Keep a result that is about to be replaced: a verification, and what an archive's past refers to.

    Otherwise who leaves captures out, or widens a limit, until it passes would leave no trace of what was decided.
    """
    if not path.is_file():
        return
    past = past_of(folder)
    try:
        record = parse_json(read_bytes(path, message("Solve the session again.")), str(path))
    except InputError:  # damaged: it decided nothing
        return
    latest = [one for one in past["results"] if one["stage"] == stage and one.get("record") is None]
    if latest:
        latest[-1]["record"] = record
    elif stage == "verify":
        created = record.get("solved") or text_of_seconds(path.stat().st_mtime)
        past["results"].append({"stage": stage, "created": created, "record": record})
    else:
        return
    write_atomically(folder / HISTORY_FILE, to_json_bytes(past))


def decisions_of(past: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return when verifications that a past has decided, and what: those that their seals know of among them."""
    found: dict[str, dict[str, Any]] = {}
    for one in past["results"]:
        record = one.get("record") or {}
        if one["stage"] == "verify" and record.get("decision") is not None:
            itself = {"decision": record["decision"], "solved": record.get("solved") or one.get("created") or ""}
            found |= {known["solved"]: known for known in (*decisions_sealed(record), itself)}
    return [found[solved] for solved in sorted(found)]


def _same_before(path: Path, data: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the signed result that a file holds, None where it is another one or none."""
    same = dict.fromkeys(("solved", "seal", "provenance"))
    try:
        stored = json.loads(path.read_bytes())
        return stored if seal_state(stored) and {**stored, **same} == {**data, **same} else None
    except (OSError, ValueError, TypeError):
        return None


def load_results(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the results that a session folder holds, by stage; raises InputError where one is not JSON.

    Their provenance is what their seals prove.
    """
    results: dict[str, dict[str, Any]] = {}
    for path in sorted((folder / "results").glob("*.json")):
        data = parse_json(read_bytes(path, message("Solve the session again."), MAX_SESSION_BYTES), str(path))
        if isinstance(data, dict):
            results[path.stem] = with_provenance(cast("dict[str, Any]", data))
    return results


def result_data(result: Record) -> dict[str, Any]:
    """Return a result as JSON data, with its messages' parts; what is no finite number becomes null there."""
    return with_parts(json.loads(result.model_dump_json()))


def to_json_bytes(data: Any) -> bytes:
    """Return JSON text with its end of line; raises ValueError for NaN and infinities, unknown to JSON."""
    return (json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()


def real_path(path: Path) -> Path:
    """Return where a path leads, also where links lead in a circle."""
    return Path(os.path.realpath(path))


def _reader(folder: Path) -> ReadFile:
    root = real_path(folder)

    def read(name: str) -> bytes:
        path = folder / name
        if not real_path(path).is_relative_to(root):
            got = message("one that leads out of it")
            raise InputError("a file inside the session folder", got, "Copy it into captures/.", str(path))
        return read_bytes(path, message("Copy the file there, or remove its capture from session.json."))

    return read


def read_bytes(path: Path, to_do: str, limit_bytes: int = MAX_FILE_BYTES) -> bytes:
    """Return a file's bytes; its size is looked at before it is read."""
    if not path.is_file():
        got = message("something else") if path.exists() else message("no such file")
        raise InputError("a file", got, to_do, str(path))
    try:
        require_file_size(path.stat().st_size, str(path), limit_bytes)
        return path.read_bytes()
    except OSError as error:
        got = error.strerror or type(error).__name__
        need = "a file that can be read"
        raise InputError(need, got, "Check its permissions and the disk.", str(path)) from None
