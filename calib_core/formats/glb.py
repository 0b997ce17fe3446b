"""GLB, the binary form of glTF 2.0: meshes in metres, as that standard counts; browsers and Windows open it."""

import json
import struct
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.formats.format import Format, Match, Pieces, by_ending
from calib_core.formats.shared.writing import BLOCK, faces_of, number_type

_MAGIC, _JSON, _BINARY = 0x46546C67, 0x4E4F534A, 0x004E4942
_FLOAT, _UNSIGNED = 5126, 5125
_CORNERS, _INDICES = 34962, 34963


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is GLB."""
    return Match(1.0, "begins with glTF") if data[:4] == b"glTF" else by_ending(name, FORMAT.endings)


def glb_pieces(points_mm: NDArray[np.floating], blocks: Iterable[ArrayLike], count: int) -> Pieces:
    """Give a GLB file of points (N, 3) in mm and triangles that come in blocks (M, 3), `count` in all.

    Raises
    ------
    InputError
        If there are no triangles, or one names a point that is not there.
    """
    size, indices = 12 * len(points_mm), 12 * count
    low, high = (end(points_mm, axis=0).astype(np.float64) / 1000 for end in (np.min, np.max))
    origin = np.round((low + high) / 2) if number_type(points_mm) == "<f8" else np.zeros(3)
    scene = {
        "asset": {"version": "2.0", "generator": "scancell"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "merged", **({"translation": origin.tolist()} if origin.any() else {})}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [
            {"pbrMetallicRoughness": {"metallicFactor": 0.1, "roughnessFactor": 0.7}, "doubleSided": True}
        ],
        "buffers": [{"byteLength": size + indices}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": size, "target": _CORNERS},
            {"buffer": 0, "byteOffset": size, "byteLength": indices, "target": _INDICES},
        ],
        "accessors": [
            {
                "bufferView": 0, "componentType": _FLOAT, "count": len(points_mm), "type": "VEC3",
                "min": (low - origin).astype(np.float32).tolist(),
                "max": (high - origin).astype(np.float32).tolist(),
            },
            {"bufferView": 1, "componentType": _UNSIGNED, "count": 3 * count, "type": "SCALAR"},
        ],
    }  # fmt: skip
    text = json.dumps(scene, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    yield struct.pack("<III", _MAGIC, 2, 28 + len(text) + size + indices)
    yield struct.pack("<II", len(text), _JSON) + text
    yield struct.pack("<II", size + indices, _BINARY)
    for start in range(0, len(points_mm), BLOCK):
        yield (points_mm[start : start + BLOCK].astype(np.float64) / 1000 - origin).astype("<f4").tobytes()
    for triangles in blocks:
        yield faces_of(triangles, len(points_mm)).astype("<u4").tobytes()


FORMAT = Format(
    name="glb",
    title="GLB (glTF 2.0)",
    endings=(".glb",),
    kinds=("mesh",),
    recognise=recognise,
    media_type="model/gltf-binary",
    write_mesh=glb_pieces,
)
