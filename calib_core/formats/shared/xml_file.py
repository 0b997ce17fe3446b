"""XML files of controllers, plain or gzipped: their elements with line numbers; entities are refused."""

import gzip
import io
import struct
import zlib
from dataclasses import dataclass, field
from xml.parsers import expat

from calib_core.errors import InputError
from calib_core.messages import message

_LARGEST_BYTES = 64_000_000


@dataclass
class Element:
    """One element: its name without namespace, its attributes, the text in it, and those around it.

    `start` is the byte at which it begins.
    """

    name: str
    attributes: dict[str, str]
    line: int
    path: tuple["Element", ...]
    text: str = field(default="")
    start: int = 0


def is_gzip(data: bytes) -> bool:
    """Return whether data are gzipped."""
    return data.startswith(b"\x1f\x8b")


def unzipped(data: bytes, name: str) -> bytes:
    """Return data as they are, or unpacked where they are gzipped.

    Raises
    ------
    InputError
        If the packed data are damaged, or larger than a controller's file is.
    """
    if not is_gzip(data):
        return data
    try:
        with gzip.open(io.BytesIO(data)) as stream:
            unpacked = stream.read(_LARGEST_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError("a whole gzipped file", str(error), "Copy or export it again.", name) from None
    if len(unpacked) > _LARGEST_BYTES:
        to_do = "Give the file as its program wrote it."
        raise InputError("a file of at most 64 MB unpacked", "more", to_do, name)
    return unpacked


def gzipped_as(original: bytes, plain: bytes) -> bytes:
    """Return data gzipped under the header of the file that they come from: its time, name and system stay."""
    packed = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    ends = struct.pack("<LL", zlib.crc32(plain), len(plain) & 0xFFFFFFFF)
    return original[: _header_length(original)] + packed.compress(plain) + packed.flush() + ends


def _header_length(data: bytes) -> int:
    """Return how long the header of a gzip file is that could be unpacked (RFC 1952)."""
    flags, at = data[3], 10
    if flags & 4:
        at += 2 + struct.unpack_from("<H", data, at)[0]
    for text in (8, 16):  # the file's name, a comment
        if flags & text:
            at = data.index(b"\0", at) + 1
    return at + (2 if flags & 2 else 0)


def elements(data: bytes, name: str) -> list[Element]:
    """Return all elements of an XML file in their order.

    Raises
    ------
    InputError
        If it is not whole XML, or declares entities.
    """
    parser = expat.ParserCreate()
    found: list[Element] = []
    open_ones: list[Element] = []

    def begin(tag: str, attributes: dict[str, str]) -> None:
        plain = {key.rpartition(":")[2]: value for key, value in attributes.items()}
        name, line = tag.rpartition(":")[2], parser.CurrentLineNumber
        element = Element(name, plain, line, tuple(open_ones), start=parser.CurrentByteIndex)
        found.append(element)
        open_ones.append(element)

    def end(_: str) -> None:
        open_ones.pop()

    def text(characters: str) -> None:
        if open_ones:
            open_ones[-1].text += characters

    def entity(*_: object) -> None:
        to_do = "Give the file as its program wrote it."
        raise InputError("XML without entities", "an entity declaration", to_do, name)

    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = begin, end, text
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        what = expat.errors.messages[error.code] if error.code in expat.errors.messages else str(error)
        to_do = message("Copy the file again: it is cut or damaged, or no XML.")
        need = "whole XML"
        raise InputError(need, "{word} in line {number}", to_do, name, word=what, number=error.lineno) from None
    return found
