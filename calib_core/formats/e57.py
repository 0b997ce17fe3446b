"""E57 (ASTM E2807): one cloud of x, y, z in metres, as the standard counts, in pages with CRC-32C checksums."""

import struct
import uuid
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.errors import InputError
from calib_core.formats.format import NO_MATCH, Format, Match

_PAGE, _PAYLOAD = 1024, 1020
_HEADER_BYTES = 48
_SECTION_BYTES = 32
_RECORDS = 5400  # a data packet: three streams of float32 in less than 64 KiB
_PACKET_BYTES, _RECORD_BYTES = 12, 12
_PAGES_AT_ONCE = 1024
_ENTRIES = 2048  # the most that an index packet may have

_XML = """<?xml version="1.0" encoding="UTF-8"?>
<e57Root type="Structure" xmlns="http://www.astm.org/COMMIT/E57/2010-e57-v1.0">
<formatName type="String"><![CDATA[ASTM E57 3D Imaging Data File]]></formatName>
<guid type="String"><![CDATA[{{{file}}}]]></guid>
<versionMajor type="Integer">1</versionMajor>
<versionMinor type="Integer">0</versionMinor>
<e57LibraryVersion type="String"><![CDATA[scancell]]></e57LibraryVersion>
<coordinateMetadata type="String"/>
<data3D type="Vector" allowHeterogeneousChildren="1">
<vectorChild type="Structure">
<guid type="String"><![CDATA[{{{scan}}}]]></guid>
<name type="String"><![CDATA[merged]]></name>
<points type="CompressedVector" fileOffset="{offset}" recordCount="{count}">
<prototype type="Structure">
<cartesianX type="Float" precision="single"/>
<cartesianY type="Float" precision="single"/>
<cartesianZ type="Float" precision="single"/>
</prototype>
<codecs type="Vector" allowHeterogeneousChildren="1"/>
</points>
</vectorChild>
</data3D>
<images2D type="Vector" allowHeterogeneousChildren="1"/>
</e57Root>
"""


def e57_pieces(points_mm: ArrayLike) -> Iterator[bytes | memoryview]:
    """Give an E57 file of points (N, 3) in mm; in the file they are metres.

    Raises
    ------
    InputError
        If there are no points.
    """
    points = np.asarray(points_mm)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InputError("at least one point to write", f"an array of shape {points.shape}", "Merge scans first.")
    yield from e57_pieces_of([points], len(points))


def e57_pieces_of(blocks_mm: Iterable[NDArray[np.floating]], count: int) -> Iterator[bytes | memoryview]:
    """Give the same file of points that come in blocks (N, 3), `count` in all, never in memory together."""
    layout = _layout(count)
    records = _records(blocks_mm)
    first = next(records)
    guids = [uuid.uuid5(uuid.NAMESPACE_OID, first[:1000].tobytes().hex() + name) for name in ("file", "scan")]
    offset = _physical(_HEADER_BYTES)
    xml = _XML.format(file=guids[0], scan=guids[1], offset=offset, count=count).encode()
    xml_at = _HEADER_BYTES + layout.size
    pages = -(-(xml_at + len(xml)) // _PAYLOAD)
    sizes = (pages * _PAGE, _physical(xml_at), len(xml), _PAGE)
    data_at = _physical(_HEADER_BYTES + _SECTION_BYTES)

    def logical() -> Iterator[bytes]:
        yield struct.pack("<8sIIQQQQ", b"ASTM-E57", 1, 0, *sizes)
        yield struct.pack("<B7xQQQ", 1, layout.size, data_at, layout.root)
        yield _data_packet(first)
        yield from map(_data_packet, records)
        yield from layout.index
        yield xml

    yield from _paged(logical())


@dataclass(frozen=True)
class _Layout:
    """What follows from the number of points: the section's size, its index, and where the index's root stands."""

    size: int
    index: list[bytes]
    root: int


def _physical(logical: int) -> int:
    """Return where a byte lies in the file, checksums counted."""
    return logical // _PAYLOAD * _PAGE + logical % _PAYLOAD


def _layout(count: int) -> _Layout:
    """Return the layout of the binary section of so many points, which begins right behind the header."""
    at = _HEADER_BYTES + _SECTION_BYTES
    entries: list[tuple[int, int]] = []
    for start in range(0, count, _RECORDS):
        entries.append((start, _physical(at)))
        at += _PACKET_BYTES + _RECORD_BYTES * min(_RECORDS, count - start)
    index: list[bytes] = []
    level = 0
    while True:
        above: list[tuple[int, int]] = []
        for first in range(0, len(entries), _ENTRIES):
            group = entries[first : first + _ENTRIES]
            above.append((group[0][0], _physical(at)))
            index.append(_index_packet(group, level))
            at += len(index[-1])
        entries, level = above, level + 1
        if len(entries) == 1:
            return _Layout(at - _HEADER_BYTES, index, entries[0][1])


def _records(blocks_mm: Iterable[NDArray[np.floating]]) -> Iterator[NDArray[np.float32]]:
    """Give the points in metres, as many at a time as a packet holds; the last ones may be fewer."""
    left = np.zeros((0, 3), dtype="<f4")
    for block in blocks_mm:
        metres = np.concatenate([left, (block.astype(np.float64) / 1000).astype("<f4")])
        whole = len(metres) // _RECORDS * _RECORDS
        for start in range(0, whole, _RECORDS):
            yield metres[start : start + _RECORDS]
        left = metres[whole:]
    if len(left):
        yield left


def _data_packet(block: NDArray[np.float32]) -> bytes:
    streams = [np.ascontiguousarray(block[:, axis]).tobytes() for axis in range(3)]
    size = 6 + 6 + 3 * len(streams[0])
    head = struct.pack("<BBHHHHH", 1, 0, size - 1, 3, *(len(stream) for stream in streams))
    return head + b"".join(streams)


def _index_packet(entries: list[tuple[int, int]], level: int) -> bytes:
    head = struct.pack("<BBHHB9x", 0, 0, 16 + 16 * len(entries) - 1, len(entries), level)
    return head + b"".join(struct.pack("<QQ", *entry) for entry in entries)


def _paged(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """Give the bytes in pages, each followed by its checksum, the last filled up with zeros."""
    waiting = bytearray()
    for piece in pieces:
        waiting += piece
        if len(waiting) >= _PAGES_AT_ONCE * _PAYLOAD:
            whole = len(waiting) // _PAYLOAD * _PAYLOAD
            yield _pages(bytes(waiting[:whole]))
            del waiting[:whole]
    if waiting:
        yield _pages(bytes(waiting))


def _pages(data: bytes) -> bytes:
    from calib_core.kernels.checksum import crc32c_rows

    payload = np.zeros((-(-len(data) // _PAYLOAD), _PAYLOAD), dtype=np.uint8)
    payload.reshape(-1)[: len(data)] = np.frombuffer(data, dtype=np.uint8)
    pages = np.empty((len(payload), _PAGE), dtype=np.uint8)
    pages[:, :_PAYLOAD] = payload
    pages[:, _PAYLOAD:] = crc32c_rows(payload).astype(">u4").view(np.uint8).reshape(-1, 4)
    return pages.tobytes()


FORMAT = Format(
    name="e57",
    title="E57 (ASTM E2807)",
    endings=(".e57",),
    kinds=("cloud",),
    recognise=lambda data, name: Match(1.0, "begins with ASTM-E57") if data[:8] == b"ASTM-E57" else NO_MATCH,
    media_type="model/e57",
    write_cloud=lambda tables, count, names: e57_pieces_of((table[:, :3] for table in tables), count),
)
