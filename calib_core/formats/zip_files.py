"""Zip files among files that were given: their contents in their place."""

import io
import zipfile
import zlib
from collections.abc import Mapping

from calib_core.errors import InputError
from calib_core.messages import message

_MOST_FILES, _MOST_BYTES = 20_000, 256_000_000
_DEEPEST = 3
_DAMAGED = (zipfile.BadZipFile, zlib.error, RuntimeError, NotImplementedError, EOFError, OSError)


def opened_files(files: Mapping[str, bytes], skipped: dict[str, str] | None = None) -> dict[str, bytes]:
    """Return files with those in zip files in their place.

    Parameters
    ----------
    files : mapping
    skipped : dict, optional
        Takes up what cannot be opened, and why, and zip files within zip files are opened as well; left out, what
        cannot be opened is refused, and what lies in a zip file stays as it is.

    Raises
    ------
    InputError
        If a zip file is damaged or holds more than a controller's backup does.
    """
    opened: dict[str, bytes] = {}
    budget = _Budget()
    for name, data in files.items():
        if not _is_zip(data):
            opened[name] = data
            continue
        refusal = _open(name, data, opened, skipped, budget)
        if refusal is None:
            continue
        if skipped is None or len(files) == 1:
            raise refusal
        skipped[name] = refusal.reason
    if skipped is not None:
        _open_within(opened, skipped, budget)
    return opened


class _Budget:
    """What all zip files of one reading may hold together, however deep they lie."""

    def __init__(self) -> None:
        self._files, self._bytes = _MOST_FILES, _MOST_BYTES

    def take(self, entries: list[zipfile.ZipInfo], name: str) -> None:
        """Count entries; raises InputError where they are too many or too large."""
        self._files -= len(entries)
        self._bytes -= sum(entry.file_size for entry in entries)
        if self._files < 0 or self._bytes < 0:
            to_do = message("Give the files with programs, tools and frames alone.")
            raise InputError("at most {most_files} files and 256 MB", "more", to_do, name, most_files=_MOST_FILES)


def _is_zip(data: bytes) -> bool:
    return data.startswith(b"PK\x03\x04")


def _open(
    name: str,
    data: bytes,
    opened: dict[str, bytes],
    skipped: dict[str, str] | None,
    budget: _Budget,
    within: str = "",
) -> InputError | None:
    """Open a zip file; return why where it cannot be."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = [entry for entry in archive.infolist() if not entry.is_dir()]
            budget.take(entries, name)
            for entry in entries:
                try:
                    opened[within + entry.filename] = archive.read(entry)
                except _DAMAGED as error:
                    if skipped is None:
                        raise
                    skipped[within + entry.filename] = str(error) or "damaged"
    except _DAMAGED as error:
        to_do = message("Copy it from the controller again, or unpack it and give the folder.")
        return InputError("a whole zip archive", str(error) or "damaged content", to_do, name)
    return None


def _open_within(opened: dict[str, bytes], skipped: dict[str, str], budget: _Budget) -> None:
    """Put what lies in zip files within zip files in their place, under both names; name what cannot be opened."""
    for depth in range(_DEEPEST + 1):
        inner = [name for name, data in opened.items() if _is_zip(data)]
        for name in inner:
            data = opened.pop(name)
            if depth == _DEEPEST:
                skipped[name] = message("zip files lie in each other, more than {most} deep", most=_DEEPEST)
                continue
            refusal = _open(name, data, opened, skipped, budget, f"{name}/")
            if refusal is not None:
                skipped[name] = refusal.reason


def with_file_replaced(archive: bytes, name: str, content: bytes, where: str) -> bytes:
    """Return a zip file with one of its files replaced: names, dates and contents of all others stay.

    Raises
    ------
    InputError
        If it holds that name twice: which of the two counts is not said.
    """
    target = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(archive)) as old, zipfile.ZipFile(target, "w") as new:
        if old.namelist().count(name) != 1:
            got = message("{name} files named {name_other}", name=old.namelist().count(name), name_other=name)
            raise InputError("each file once", got, "Unpack it and give the folder.", where)
        new.comment = old.comment
        for entry in old.infolist():
            new.writestr(entry, content if entry.filename == name else old.read(entry), entry.compress_type)
    return target.getvalue()


def zipped(files: Mapping[str, bytes]) -> bytes:
    """Return files by their names as a zip, the same for the same files."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return packed.getvalue()
