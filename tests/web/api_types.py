"""TypeScript types of the API, from its OpenAPI document and the records that its free-form answers hold.

`make web-types` writes them to web/api-types.d.ts, which git ignores, before it checks the page.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic.json_schema import models_json_schema

from calib_core.records import Guide
from calib_core.records.camera_result import CameraResult
from calib_core.records.laser_plane_result import LaserPlaneResult
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.turntable.record import TurntableResult
from server.app import create_app

TARGET = Path(__file__).resolve().parents[2] / "web" / "api-types.d.ts"
_HEAD = "// Generated from the API's OpenAPI document by tests/web/api_types.py; do not edit.\n"
_RECORDS = (Guide, TcpResult, TurntableResult, ChainResult, CameraResult, LaserPlaneResult)
_PLAIN = {"string": "string", "integer": "number", "number": "number", "boolean": "boolean", "null": "null"}


def schemas() -> dict[str, Any]:
    """Return every schema by its name: of the OpenAPI document, and of the results and the guide."""
    records = models_json_schema(
        [(record, "serialization") for record in _RECORDS],
        ref_template="#/components/schemas/{model}",
    )[1]["$defs"]
    document = create_app().openapi()["components"]["schemas"]
    return {**records, **{name: schema for name, schema in document.items() if not name.startswith("Body_")}}


def type_of(schema: Mapping[str, Any]) -> str:
    """Return a schema as a TypeScript type."""
    if "$ref" in schema:
        return schema["$ref"].rsplit("/", 1)[1]
    if "const" in schema:
        return _literal(schema["const"])
    if "enum" in schema:
        return " | ".join(map(_literal, schema["enum"]))
    for key in ("anyOf", "oneOf"):
        if key in schema:
            return " | ".join(dict.fromkeys(type_of(part) for part in schema[key]))
    kind = schema.get("type")
    if kind == "array":
        item = type_of(schema.get("items", {}))
        return f"({item})[]" if " | " in item else f"{item}[]"
    if kind == "object":
        return _object(schema)
    return _PLAIN.get(str(kind), "unknown")


def _object(schema: Mapping[str, Any]) -> str:
    if "properties" in schema:
        return "{ " + " ".join(_fields(schema)) + " }"
    values = schema.get("additionalProperties", True)
    return f"Record<string, {'unknown' if values in (True, False) else type_of(values)}>"


def _fields(schema: Mapping[str, Any]) -> list[str]:
    """Return the fields of an object; what may be left out when it is sent may be absent when it is read."""
    required = set(schema.get("required", ()))
    return [
        f"{name if name.isidentifier() else _literal(name)}{'' if name in required else '?'}: {type_of(field)};"
        for name, field in schema["properties"].items()
    ]


def _literal(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)


def render() -> str:
    """Return the text of web/api-types.d.ts."""
    parts = [_HEAD]
    for name, schema in sorted(schemas().items()):
        if "properties" in schema:
            fields = "".join(f"  {field}\n" for field in _fields(schema))
            parts.append(f"export interface {name} {{\n{fields}}}\n")
        else:
            parts.append(f"export type {name} = {type_of(schema)};\n")
    return "\n".join(parts)


def write() -> None:
    """Write web/api-types.d.ts."""
    TARGET.write_text(render(), encoding="utf-8")
