"""Zip files among files that were given: their contents in their place."""

import io
import zipfile
import zlib
from collections.abc import Mapping

from calib_core.errors import InputError
from calib_core.messages import message

_MOST_FILES, _MOST_BYTES = 20_000, 256_000_000
_DAMAGED = (zipfile.BadZipFile, zlib.error, RuntimeError, NotImplementedError, EOFError, OSError)


def opened_files(files: Mapping[str, bytes], skipped: dict[str, str] | None = None) -> dict[str, bytes]:
    """Return files with those in zip files in their place.

    Parameters
    ----------
    files : mapping
    skipped : dict, optional
        Takes up what cannot be opened, and why; left out, that is refused.

    Raises
    ------
    InputError
        If a zip file is damaged or holds more than a controller's backup does.
    """
    opened: dict[str, bytes] = {}
    for name, data in files.items():
        if not data.startswith(b"PK\x03\x04"):
            opened[name] = data
            continue
        try:
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                entries = [entry for entry in archive.infolist() if not entry.is_dir()]
                if len(entries) > _MOST_FILES or sum(entry.file_size for entry in entries) > _MOST_BYTES:
                    to_do = message("Give the files with programs, tools and frames alone.")
                    need = "at most {most_files} files and 256 MB"
                    raise InputError(need, "more", to_do, name, most_files=_MOST_FILES)
                for entry in entries:
                    try:
                        opened[entry.filename] = archive.read(entry)
                    except _DAMAGED as error:
                        if skipped is None:
                            raise
                        skipped[entry.filename] = str(error) or "damaged"
        except _DAMAGED as error:
            to_do = message("Copy it from the controller again, or unpack it and give the folder.")
            refusal = InputError("a whole zip archive", str(error) or "damaged content", to_do, name)
            if skipped is None or len(files) == 1:
                raise refusal from None
            skipped[name] = refusal.reason
    return opened


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
