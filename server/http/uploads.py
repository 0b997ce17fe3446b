"""The files of an upload, under the names that the capture's record gives them.

How large a request may be, `server/http/request_size.py` says.
"""

import asyncio
from collections.abc import AsyncGenerator, Mapping
from contextlib import asynccontextmanager
from hashlib import sha256
from pathlib import PurePosixPath
from typing import Any

from calib_core.archive.bag_names import is_device_name
from calib_core.errors import InputError

_SMALL_BYTES = 256 * 1024


class UploadMemory:
    """How many bytes of uploads may be in memory at once; who comes when it is full waits for others to end.

    Until then an upload lies in a temporary file.  Small ones neither wait nor count.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._taken = 0
        self._released = asyncio.Event()

    @asynccontextmanager
    async def taken(self, size: int) -> AsyncGenerator[None]:
        """Take so many bytes; what is larger than all of it waits until it is alone."""
        if size <= _SMALL_BYTES:
            yield
            return
        while self._taken and self._taken + size > self._size:
            await self._released.wait()
        self._taken += size
        try:
            yield
        finally:
            self._taken -= size
            self._released.set()
            self._released = asyncio.Event()


def comes_in_pieces(path: str) -> bool:
    """Return whether a route takes bodies of gigabytes, piece by piece, never all of one in memory."""
    return path.startswith("/api/v1/archives") or path.endswith("/captures/batch")


def named_files(record: dict[str, Any], uploads: list[tuple[str, bytes]]) -> dict[str, bytes]:
    """Return the uploads under the record's file names; a record without `files` is given some.

    Uploads belong to the names whose last part they bear; where none does, to the names in their order.

    Parameters
    ----------
    record : dict
        A capture's record as it came; `files` is filled in where it was left out.
    uploads : list of (file name, content)

    Raises
    ------
    InputError
        If there are more or fewer uploads than names.
    """
    if not record.get("files") and uploads:
        record["files"] = _invented_names(str(record.get("id")), [name for name, _ in uploads])
    names = record.get("files") or []
    where = f"{record.get('id', 'capture')}: files"
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError("a list of file names", repr(names)[:80], "Name each file of the capture.", where)
    if len(set(names)) != len(names):
        raise InputError("names that differ", "one that stands twice", "Name it once.", where)
    if len(names) != len(uploads):
        need = "as many files as the record names: {count}"
        to_do = "Send each file of the record's `files` as a part named `files`."
        raise InputError(need, f"{len(uploads)}", to_do, where, count=len(names))
    by_last_part = {PurePosixPath(name).name: content for name, content in uploads}
    if set(by_last_part) == {PurePosixPath(name).name for name in names} and len(by_last_part) == len(names):
        return {name: by_last_part[PurePosixPath(name).name] for name in names}
    return {name: content for name, (_, content) in zip(names, uploads, strict=True)}


def _invented_names(capture_id: str, uploaded: list[str]) -> list[str]:
    """Return names from the capture's id and the uploads' endings: nothing else of a foreign name is used."""
    endings = [PurePosixPath(name).suffix.lower() for name in uploaded]
    endings = [ending if ending[1:].isalnum() and len(ending) <= 6 else "" for ending in endings]
    name = f"capture-{capture_id}" if is_device_name(capture_id) else capture_id
    if len(endings) == 1:
        return [f"captures/{name}{endings[0]}"]
    return [f"captures/{name}-{number:04d}{ending}" for number, ending in enumerate(endings, start=1)]


def digests_of(contents: Mapping[str, bytes]) -> dict[str, str]:
    """Return the SHA-256 of each file, by name."""
    return {name: sha256(content).hexdigest() for name, content in contents.items()}
