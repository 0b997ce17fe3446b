"""E57 (ASTM E2807): one cloud of x, y, z in metres, as the standard counts, in pages with CRC-32C checksums."""

import struct
import uuid
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.errors import InputError

_PAGE, _PAYLOAD = 1024, 1020
_HEADER_BYTES = 48
_SECTION_BYTES = 32
_RECORDS = 5400  # a data packet: three streams of float32 in less than 64 KiB
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
    points = np.asarray(points_mm, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InputError("at least one point to write", f"an array of shape {points.shape}", "Merge scans first.")
    metres = (points / 1000).astype("<f4")
    section, offset = _section(metres)
    guids = [uuid.uuid5(uuid.NAMESPACE_OID, metres[:1000].tobytes().hex() + name) for name in ("file", "scan")]
    xml = _XML.format(file=guids[0], scan=guids[1], offset=offset, count=len(metres)).encode()
    body = section + xml
    xml_at = _HEADER_BYTES + len(section)
    pages = -(-(_HEADER_BYTES + len(body)) // _PAYLOAD)
    sizes = (pages * _PAGE, _physical(xml_at), len(xml), _PAGE)
    header = struct.pack("<8sIIQQQQ", b"ASTM-E57", 1, 0, *sizes)
    yield _paged(header + body)


def _physical(logical: int) -> int:
    """Return where a byte lies in the file, checksums counted."""
    return logical // _PAYLOAD * _PAGE + logical % _PAYLOAD


def _section(metres: NDArray[np.float32]) -> tuple[bytes, int]:
    """Return the binary section of the points, which begins right behind the header, and its place in the file."""
    at = _HEADER_BYTES + _SECTION_BYTES
    packets: list[bytes] = []
    entries: list[tuple[int, int]] = []
    for start in range(0, len(metres), _RECORDS):
        block = metres[start : start + _RECORDS]
        packet = _data_packet(block)
        entries.append((start, _physical(at)))
        packets.append(packet)
        at += len(packet)
    level = 0
    while True:
        above: list[tuple[int, int]] = []
        for first in range(0, len(entries), _ENTRIES):
            group = entries[first : first + _ENTRIES]
            above.append((group[0][0], _physical(at)))
            packets.append(_index_packet(group, level))
            at += len(packets[-1])
        entries, level = above, level + 1
        if len(entries) == 1:
            break
    body = b"".join(packets)
    data_at = _physical(_HEADER_BYTES + _SECTION_BYTES)
    head = struct.pack("<B7xQQQ", 1, _SECTION_BYTES + len(body), data_at, entries[0][1])
    return head + body, _physical(_HEADER_BYTES)


def _data_packet(block: NDArray[np.float32]) -> bytes:
    streams = [np.ascontiguousarray(block[:, axis]).tobytes() for axis in range(3)]
    size = 6 + 6 + 3 * len(streams[0])
    head = struct.pack("<BBHHHHH", 1, 0, size - 1, 3, *(len(stream) for stream in streams))
    return head + b"".join(streams)


def _index_packet(entries: list[tuple[int, int]], level: int) -> bytes:
    head = struct.pack("<BBHHB9x", 0, 0, 16 + 16 * len(entries) - 1, len(entries), level)
    return head + b"".join(struct.pack("<QQ", *entry) for entry in entries)


def _paged(data: bytes) -> bytes:
    """Return the bytes in pages, each followed by its checksum, the last filled up with zeros."""
    from calib_core.kernels.checksum import crc32c_rows

    payload = np.zeros((-(-len(data) // _PAYLOAD), _PAYLOAD), dtype=np.uint8)
    payload.reshape(-1)[: len(data)] = np.frombuffer(data, dtype=np.uint8)
    pages = np.empty((len(payload), _PAGE), dtype=np.uint8)
    pages[:, :_PAYLOAD] = payload
    pages[:, _PAYLOAD:] = crc32c_rows(payload).astype(">u4").view(np.uint8).reshape(-1, 4)
    return pages.tobytes()
