"""Sessions in archives: one zip that loses nothing, that any BagIt tool verifies, and that still computes."""

import os
import re
import tempfile
from collections.abc import Generator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePosixPath
from typing import IO, Any, Final, cast

from pydantic import Field

from calib_core import __version__
from calib_core.archive.bag import Bag, Content, open_bag, opened_content, write_bag
from calib_core.archive.bag_names import MAX_NAME_BYTES, is_device_name
from calib_core.archive.bag_seal import SEAL_FILE, check_seal, seal_of
from calib_core.archive.bag_zip import LIMITS, ArchiveLimits
from calib_core.archive.folder import (
    MAX_SESSION_BYTES,
    SESSION_FILE,
    folder_of,
    load_session,
    parse_json,
    real_path,
)
from calib_core.archive.session_versions import to_present_format
from calib_core.archive.stored_results import require_result
from calib_core.disk import extended, remove_folder, rename_new, sync_folder, temporary_folder
from calib_core.errors import CalibrationError, ConflictError, InputError
from calib_core.formats.points import require_file_size
from calib_core.formats.shared.writing import replacing
from calib_core.messages import message
from calib_core.records import ReadFile, Record, Session, Verdict, parse_session
from calib_core.records.findings import Finding
from calib_core.records.plain_json import require_plain

SCENE_FILE: Final = "scene.html"
REPORT_FILE: Final = "report.html"


@dataclass(frozen=True)
class ArchivedSession:
    """A session as its archive holds it: the record, each stage's result as JSON data, and the files' reader."""

    session: Session
    results: Mapping[str, dict[str, Any]]
    read: ReadFile


class ArchiveFacts(Record):
    """What a verified archive holds: the session's name, its captures, each stage's verdict, and its size.

    `sealed` is true where it is as a key that is trusted here signed it, false where it was changed since, and
    null where another key or nobody signed it; `findings` say what is not as it was signed, or does not agree.
    `inputs_sha256` is what each stage was computed from, as its report prints it.
    """

    session: str
    captures: int
    results: dict[str, Verdict]
    software: list[str]
    files: int
    payload_bytes: int
    scene: bool
    report: bool
    inputs_sha256: dict[str, str] = Field(default_factory=dict[str, str])
    sealed: bool | None = None
    signed_by: str | None = None
    findings: list[Finding] = Field(default_factory=list[Finding])


def pack(folder: Path, out: Path, extra: Mapping[str, Content] | None = None) -> ArchiveFacts:
    """Write a session folder's archive, which is verified before it gets its name.

    Parameters
    ----------
    folder : Path
        The session folder; all its files go in, except those whose names begin with a full stop.
    out : Path
        The zip to write; an older one is replaced once the new one is whole.
    extra : mapping, optional
        Further files by their names in the folder, such as `SCENE_FILE` and `REPORT_FILE`; they go before the
        folder's own.

    Raises
    ------
    CalibrationError
        If the session cannot be read, a file is missing or outside of the folder, or a name cannot be stored
        everywhere.
    """
    folder = folder_of(folder)
    session, _ = load_session(folder)
    payload = {**folder_files(folder, out), **(extra or {})}
    with replacing(out) as file:
        facts = pack_files(session, payload, file, str(folder))
    sync_folder(out.parent)
    return facts


def pack_files(session: Session, payload: Mapping[str, Content], out: IO[bytes], where: str) -> ArchiveFacts:
    """Write the archive of a session whose files lie anywhere, and verify what was written.

    Parameters
    ----------
    session : Session
    payload : mapping
        The session folder's files by name, session.json among them.
    out : binary file
        To read and write.
    where : str
        What messages call the session.

    Raises
    ------
    CalibrationError
        As `pack`.
    """
    about = {
        "Bag-Software-Agent": f"scancell {__version__}",
        "External-Description": f"scancell session {session.name}",
    }
    try:
        write_bag(out, archive_name(session), payload, about, partial(_seal, payload))
    except CalibrationError as error:
        raise (
            error if error.where != "session" else type(error)(error.need, error.got, error.to_do, where)
        ) from None
    return verify(out, where)


def _seal(payload: Mapping[str, Content], digests: Mapping[str, str]) -> dict[str, bytes]:
    """Return the file with the seal of an archive that is being written, nothing where there is no key."""
    moments = [""]
    record: dict[str, Any] = {}
    for name, content in payload.items():
        if name == SESSION_FILE or PurePosixPath(name).match("results/*.json"):
            data: Any = None
            with suppress(InputError), opened_content(content) as file:  # it is said when the archive is verified
                data = parse_json(file.read(), name)
            if isinstance(data, dict):
                moments.append(str(cast("dict[str, Any]", data).get("solved") or ""))
                record = cast("dict[str, Any]", data) if name == SESSION_FILE else record
    seal = seal_of(record, digests, max(moments))
    return {} if seal is None else {SEAL_FILE: seal}


def archive_name(session: Session) -> str:
    """Return the name of a session's archive without its ending: letters, digits, and single hyphens."""
    name = re.sub(r"[^A-Za-z0-9]+", "-", session.name).strip("-")[:60].lower()
    return f"session-{name}" if is_device_name(name) else name or "session"


def verify(source: Path | IO[bytes], where: str = "", limits: ArchiveLimits = LIMITS) -> ArchiveFacts:
    """Check an archive as a whole: the zip, the bag, every SHA-256, the session and its results.

    Raises
    ------
    CalibrationError
        With the first thing that is wrong.
    """
    with open_bag(source, where, limits) as bag:
        bag.verify()
        archived = read_archive(bag)
        seal = check_seal(bag, archived.results)
        return ArchiveFacts(
            session=archived.session.name,
            captures=len(archived.session.captures),
            results={stage: result["verdict"] for stage, result in archived.results.items()},
            software=sorted({result["software"] for result in archived.results.values()}),
            files=len(bag.payload),
            payload_bytes=bag.payload_bytes,
            scene=SCENE_FILE in bag.payload,
            report=REPORT_FILE in bag.payload,
            inputs_sha256={stage: str(r.get("inputs_sha256", "")) for stage, r in archived.results.items()},
            sealed=seal.holds,
            signed_by=seal.signed_by,
            findings=seal.findings,
        )


def unpack(source: Path, target: Path, limits: ArchiveLimits = LIMITS) -> ArchiveFacts:
    """Write an archive's files as a folder: all of them, verified, or nothing.

    Parameters
    ----------
    source : Path
        The zip.
    target : Path
        The bag's folder, which must not exist or be empty; the session folder is `data` in it.

    Raises
    ------
    ConflictError
        If there is something at `target`.
    CalibrationError
        If the archive is refused, or the folder cannot be written; then nothing is left there.
    """
    facts = verify(source, limits=limits)
    target = extended(target, MAX_NAME_BYTES)
    if target.is_symlink() or (target.exists() and not (target.is_dir() and not any(target.iterdir()))):
        raise ConflictError("a folder that is new or empty", "something there", "Name another.", str(target))
    made = [parent for parent in target.parents if not parent.exists()]
    temporary: Path | None = None
    done = False
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}."))
        with open_bag(source, limits=limits) as bag:
            _write_all(bag, temporary)
        temporary.chmod(0o755)
        if target.exists():
            target.rmdir()
        rename_new(temporary, target)
        done = True
    except OSError as error:
        raise _no_place(error, target) from None
    finally:
        if not done:
            if temporary is not None:
                with suppress(OSError):
                    remove_folder(temporary)
            for parent in made:
                with suppress(OSError):
                    parent.rmdir()
    sync_folder(target.parent)
    return facts


@contextmanager
def opened(path: Path) -> Generator[Path]:
    """Give the session folder that a path names: itself, or that of an archive, unpacked meanwhile.

    Messages name the archive in place of the folder it is unpacked to.

    Raises
    ------
    CalibrationError
        If it is neither, or the archive is refused.
    """
    if not is_archive(path):
        yield folder_of(path)
        return
    with temporary_folder() as temporary:
        folder = temporary / "session"
        unpack(path, folder)
        try:
            yield folder / "data"
        except CalibrationError as error:
            place = error.where.replace(f"{folder / 'data'}{os.sep}", f"{path}: ").replace(str(folder), str(path))
            raise type(error)(error.need, error.got, error.to_do, place) from None


def is_archive(path: Path) -> bool:
    """Return whether a path names a file that is taken for an archive rather than for a session folder."""
    return path.is_file() and path.name != SESSION_FILE


def read_archive(bag: Bag) -> ArchivedSession:
    """Return the session in a bag, its results checked and all its captures' files there.

    Raises
    ------
    InputError
        If session.json or a result is not what it should be, or a capture's file is missing.
    TooLargeError
        If one of them is beyond the limits of a session folder.
    """
    place = f"{bag.where}: {SESSION_FILE}"
    session = parse_session(to_present_format(_json_object(bag, SESSION_FILE), place), place)
    read = _reader(bag)
    there = set(bag.payload)
    for capture in session.captures:
        for name in capture.files:
            if plain_name(name) not in there:
                place = f"{bag.where}: {SESSION_FILE}: captures[{capture.id}]"
                to_do = "Copy it there and pack again."
                raise InputError("the file {name}", "none", to_do, place, name=ascii(name)[:80])
    results: dict[str, dict[str, Any]] = {}
    for name in bag.payload:
        path = PurePosixPath(name)
        if path.parent == PurePosixPath("results") and path.suffix == ".json":
            results[path.stem] = _result(bag, name, path.stem)
    return ArchivedSession(session, results, read)


def _reader(bag: Bag) -> ReadFile:
    there = set(bag.payload)

    def read(name: str) -> bytes:
        plain = plain_name(name)
        place = f"{bag.where}: {name}"
        if plain not in there:
            raise InputError("a file of the session", "none", "Pack the session again.", place)
        require_file_size(bag.size(plain), place)
        return bag.read(plain)

    return read


def plain_name(name: str) -> str:
    """Return the name in an archive of a file that a record names, perhaps as ``./captures//p01.csv``."""
    return str(PurePosixPath(name))


def _result(bag: Bag, name: str, stage: str) -> dict[str, Any]:
    data = _json_object(bag, name)
    require_result(stage, data, f"{bag.where}: {name}")
    return data


def _json_object(bag: Bag, name: str) -> dict[str, Any]:
    where = f"{bag.where}: {name}"
    if name not in bag.payload:
        to_do = "Name another."
        raise InputError("an archive of a session, with data/{name}", "none", to_do, bag.where, name=name)
    require_file_size(bag.size(name), where, MAX_SESSION_BYTES)
    data = parse_json(bag.read(name), where)
    require_plain(data, where)
    if not isinstance(data, dict):
        raise InputError("a JSON object", "a {name}", "Pack the session again.", where, name=type(data).__name__)
    return cast("dict[str, Any]", data)


def folder_files(folder: Path, out: Path) -> dict[str, Path]:
    """Return a session folder's files by name, without hidden ones and what is to be written."""
    root = real_path(folder)
    files: dict[str, Path] = {}
    for place, folders, names in os.walk(folder, onerror=_raise):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in (name for name in folders if (Path(place) / name).is_symlink()):
            _refuse_entry(Path(place) / name, message("a link to a folder"))
        for name in names:
            path = Path(place) / name
            if name.startswith(".") or real_path(path) == real_path(out):
                continue
            if not real_path(path).is_relative_to(root):
                _refuse_entry(path, message("a link that leads out of it"))
            if not path.is_file():
                _refuse_entry(path, message("a device, a pipe or a broken link"))
            files[path.relative_to(folder).as_posix()] = path
    return files


def _raise(error: OSError) -> None:
    raise error


def _refuse_entry(path: Path, got: str) -> None:
    raise InputError("ordinary files in the session folder", got, "Put the file itself there.", str(path))


def _write_all(bag: Bag, folder: Path) -> None:
    """Write all files of a bag into an empty folder, on the disk when this returns."""
    folders = {folder}
    for name in bag.names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        folders |= {parent for parent in path.parents if parent.is_relative_to(folder)}
        with path.open("xb") as file:
            for chunk in bag.chunks(name):
                file.write(chunk)
            file.flush()
            os.fsync(file.fileno())
    for written in folders:
        sync_folder(written)


def _no_place(error: OSError, path: Path) -> InputError:
    got = (error.strerror or type(error).__name__).lower()
    return InputError("a place to write to", got, "Make room there, or name another folder.", str(path))
