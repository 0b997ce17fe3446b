"""A tool put into a copy of a controller's backup: a file, several of them, or a zip."""

from collections.abc import Callable, Collection, Mapping
from typing import Any

from calib_core.errors import InputError
from calib_core.exports.answer import Answer
from calib_core.exports.export import write_export
from calib_core.exports.registry import export_named
from calib_core.formats.zip_files import opened_files, with_file_replaced
from calib_core.messages import message

_MOST_REASONS = 3


def write_into(
    backup: Mapping[str, bytes],
    answer: Answer,
    name: str,
    allow: Collection[str] = (),
    settings: Mapping[str, Any] | None = None,
) -> tuple[str, bytes]:
    """Return the name and the bytes of the one file of a backup that holds the entry, with the entry changed.

    A zip comes back whole, with that file in it changed; every other byte of every other file is as it was.

    Raises
    ------
    InputError
        If no file of the backup holds the entry, or several do, or it cannot be changed.
    ConflictError
        If the answer has faults that are not allowed.
    """

    def patched(data: bytes) -> bytes:
        return write_export(answer, name, allow, settings, data)[0]

    answer.require_usable(allow)
    if suits := export_named(name).suits:
        suits(opened_files(backup))
    if len(backup) == 1:
        ((file, data),) = backup.items()
        if not data.startswith(b"PK\x03\x04"):
            return file, patched(data)
        inner, content = _only(opened_files(backup), patched)
        return file, with_file_replaced(data, inner, content, file)
    return _only(backup, patched)


def _only(files: Mapping[str, bytes], patched: Callable[[bytes], bytes]) -> tuple[str, bytes]:
    """Return the one file that can be changed, changed."""
    done: dict[str, bytes] = {}
    reasons: list[str] = []
    for file, data in files.items():
        try:
            done[file] = patched(data)
        except InputError as error:
            if not error.got.startswith("none") and error.need:
                reasons.append(f"{file}: {error}")
    if len(done) == 1:
        return next(iter(done.items()))
    if done:
        listed = ", ".join(list(done)[:5])
        raise InputError("one file that defines it", f"{len(done)}: {listed}", "Give the right one alone.", "into")
    got = "; ".join(reasons[:_MOST_REASONS]) or message("none of {count} files", count=len(files))
    to_do = message("Give the file that defines it, or name another with --tool or --frame.")
    raise InputError("a file that defines the tool", got, to_do, "into")
