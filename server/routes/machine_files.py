"""Machines' files as requests bring them."""

from typing import Annotated

from fastapi import File, Form, UploadFile

from calib_core.errors import InputError, TooLargeError
from calib_core.messages import message

_MOST_FILES, _MOST_BYTES = 2000, 256_000_000
Files = Annotated[
    list[UploadFile], File(description="The controller's files, or a zip of its backup.", examples=[["PK"]])
]
Word = Annotated[str, Form(max_length=1000)]


def size_of(files: list[UploadFile]) -> int:
    """Return how many bytes files have; raises TooLargeError where they are too many."""
    size = sum(file.size or 0 for file in files)
    if size > _MOST_BYTES or len(files) > _MOST_FILES:
        to_do = message("Give the files with programs, tools and frames alone.")
        need = "at most {most_files} files and 256 MB"
        raise TooLargeError(
            need, "{count}, {size} bytes", to_do, "files", most_files=_MOST_FILES, count=len(files), size=size
        )
    return size


async def contents_of(files: list[UploadFile]) -> dict[str, bytes]:
    """Return files by name; raises InputError where two have one name."""
    contents: dict[str, bytes] = {}
    for place, file in enumerate(files):
        name = file.filename or message("file {place}", place=place + 1)
        if name in contents:
            raise InputError("names that differ", "'{name}' twice", "Name it once.", "files", name=name)
        contents[name] = await file.read()
    return contents
