"""3MF: meshes in millimetres, said in the file; a zip with one model in XML."""

import io
import zipfile
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.formats.format import Format, Match, Pieces, by_ending
from calib_core.formats.shared.writing import BLOCK, faces_of

_MODEL = "3D/3dmodel.model"
_ALWAYS = (2026, 1, 1, 0, 0, 0)  # the same mesh is the same file
_TYPES = """<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"><Default Extension="rels" \
ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="model" \
ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>
"""
_RELATIONS = """<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Target="/3D/3dmodel.model" \
Id="rel0" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>
"""  # noqa: E501 - as the standard has it
_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xml:lang="en" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<metadata name="Application">scancell</metadata>
<resources><object id="1" type="model"><mesh><vertices>
"""
_BETWEEN = "</vertices><triangles>\n"
_TAIL = '</triangles></mesh></object></resources><build><item objectid="1"/></build></model>\n'
_VERTEX = '<vertex x="%.6f" y="%.6f" z="%.6f"/>\n'
_TRIANGLE = '<triangle v1="%d" v2="%d" v3="%d"/>\n'


class _Sink(io.RawIOBase):
    """What was written since it was last taken: a zip that goes out while it is made."""

    def __init__(self) -> None:
        self._waiting = bytearray()

    def writable(self) -> bool:
        return True

    def write(self, data: "bytes | bytearray | memoryview") -> int:  # type: ignore[override]
        self._waiting += data
        return len(data)

    def taken(self) -> bytes:
        waiting = bytes(self._waiting)
        self._waiting.clear()
        return waiting


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is 3MF: by its ending."""
    del data
    return by_ending(name, FORMAT.endings)


def threemf_pieces(points_mm: NDArray[np.floating], blocks: Iterable[ArrayLike], count: int) -> Pieces:
    """Give a 3MF file of points (N, 3) in mm and triangles that come in blocks (M, 3).

    Raises
    ------
    InputError
        If there are no triangles, or one names a point that is not there.
    """
    del count
    sink = _Sink()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, text in (("[Content_Types].xml", _TYPES), ("_rels/.rels", _RELATIONS)):
            archive.writestr(zipfile.ZipInfo(name, _ALWAYS), text)
        model = zipfile.ZipInfo(_MODEL, _ALWAYS)
        model.compress_type = zipfile.ZIP_DEFLATED
        with archive.open(model, "w", force_zip64=True) as file:
            file.write(_HEAD.encode())
            for start in range(0, len(points_mm), BLOCK):
                rows = points_mm[start : start + BLOCK].astype(np.float64)
                file.write((_VERTEX * len(rows) % tuple(rows.ravel().tolist())).encode())
                yield sink.taken()
            file.write(_BETWEEN.encode())
            for triangles in blocks:
                faces = faces_of(triangles, len(points_mm))
                file.write((_TRIANGLE * len(faces) % tuple(faces.ravel().tolist())).encode())
                yield sink.taken()
            file.write(_TAIL.encode())
    yield sink.taken()


FORMAT = Format(
    name="3mf",
    title="3MF",
    endings=(".3mf",),
    kinds=("mesh",),
    recognise=recognise,
    media_type="model/3mf",
    write_mesh=threemf_pieces,
)
