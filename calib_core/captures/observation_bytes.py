"""What was seen in a capture as bytes and back: a line of JSON, then the numbers of its arrays as they are.

Who reads it trusts nobody: it may lie in a folder that came from elsewhere.
"""

import json
import zlib
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import MeasurementError
from calib_core.messages import Message, data_of, message_of

_NUMBERS = "fiub"


@cache
def _kinds() -> dict[str, Any]:
    from calib_core.captures.capture_observation import Doubts, Seen
    from calib_core.optics.board import BoardView
    from calib_core.optics.stripe import StripeCenters
    from calib_core.optics.stripe_looks import StripeLooks
    from calib_core.sphere.arc import ArcFit
    from calib_core.sphere.cloud import SphereFit

    kinds = (Seen, Doubts, ArcFit, SphereFit, BoardView, StripeCenters, StripeLooks)
    return {kind.__name__: kind for kind in kinds}


def to_bytes(seen: object) -> bytes:
    """Return one of the kinds above, or the error that nothing is seen, as bytes."""
    arrays: list[NDArray[Any]] = []
    if isinstance(seen, MeasurementError):
        parts = (seen.need, seen.got, seen.to_do, seen.where)
        data: Any = {"error": [data_of(part) if isinstance(part, Message) else part for part in parts]}
    else:
        data = _to_data(seen, arrays)
    body = b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)
    head = {"seen": data, "arrays": [[array.dtype.str, list(array.shape)] for array in arrays]}
    content = json.dumps(head).encode() + b"\n" + body
    return zlib.crc32(content).to_bytes(4, "big") + content


def from_bytes(value: bytes) -> object:
    """Return what `to_bytes` got, None where the bytes are damaged."""
    if zlib.crc32(value[4:]).to_bytes(4, "big") != value[:4]:
        return None
    line, _, body = value[4:].partition(b"\n")
    try:
        head = json.loads(line)
        return _whole(head, body)
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError):
        return None


def _whole(head: Any, body: bytes) -> object:
    arrays: list[NDArray[Any]] = []
    start = 0
    for name, shape in head["arrays"]:
        kind = np.dtype(str(name))
        if kind.kind not in _NUMBERS:
            raise ValueError(name)
        count = int(np.prod(shape, dtype=np.int64))
        arrays.append(np.frombuffer(body, kind, count, start).reshape(shape).copy())
        start += count * kind.itemsize
    if "error" in head["seen"]:
        return MeasurementError(
            *(message_of(part) if isinstance(part, dict) else part for part in head["seen"]["error"])
        )
    return _from_data(head["seen"], arrays)


def _to_data(value: Any, arrays: list[NDArray[Any]]) -> Any:
    if isinstance(value, np.ndarray):
        arrays.append(cast("NDArray[Any]", value))
        return {"array": len(arrays) - 1}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, tuple):
        return {"tuple": [_to_data(part, arrays) for part in cast("tuple[Any, ...]", value)]}
    if isinstance(value, dict):
        return {"mapping": value}
    if is_dataclass(value):
        inside = {field.name: _to_data(getattr(value, field.name), arrays) for field in fields(value)}
        return {"kind": type(value).__name__, "fields": inside}
    return value


def _from_data(data: Any, arrays: list[NDArray[Any]]) -> Any:
    if not isinstance(data, dict):
        return data
    told = cast("dict[str, Any]", data)
    if "array" in told:
        return arrays[told["array"]]
    if "tuple" in told:
        return tuple(_from_data(part, arrays) for part in told["tuple"])
    if "mapping" in told:
        return told["mapping"]
    return _kinds()[told["kind"]](**{name: _from_data(part, arrays) for name, part in told["fields"].items()})
