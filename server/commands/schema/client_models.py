"""The records of `scancell_client`: pydantic models of results and answers, from the API's OpenAPI document."""

import keyword
from collections.abc import Iterator, Mapping
from typing import Any

_HEAD = '''"""Results and answers as records, made by `scancell schema python-models`, not to be edited."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict{field}


class Record(BaseModel):
    """Part of an answer; what a newer server adds is kept, too."""

    model_config = ConfigDict(extra="allow", frozen=True, populate_by_name=True, protected_namespaces=())
'''
_ROOTS = ("/api/v1/sessions/{session_id}/results", "/api/v1/sessions/{session_id}/answer")
_TYPES = {"string": "str", "integer": "int", "number": "float", "boolean": "bool", "null": "None"}


def models_source() -> str:
    """Return the source of the models."""
    from server.app import create_app

    document = create_app().openapi()
    schemas = document["components"]["schemas"]
    answers = [document["paths"][path]["get"]["responses"]["200"] for path in _ROOTS]
    found: dict[str, None] = {}
    for answer in answers:
        _add_named(answer, schemas, found)
    results = {schemas[name]["properties"]["stage"]["const"]: name for name in found if name.startswith("Stored")}
    rows = "".join(f'    "{stage}": {_class(name)},\n' for stage, name in results.items())
    table = f"\n\nRESULTS: dict[str, type[Record]] = {{\n{rows}}}\n"
    models = "".join(_model(name, schemas[name]) for name in sorted(found))
    return _HEAD.replace("{field}", ", Field" if models.count(" = Field(") else "") + models + table


def _add_named(part: Any, schemas: Mapping[str, Any], found: dict[str, None]) -> None:
    """Add the names of all schemas that a part of the document refers to."""
    if isinstance(part, dict):
        reference: Any = part.get("$ref")
        if isinstance(reference, str) and (name := reference.rsplit("/", 1)[1]) not in found:
            found[name] = None
            _add_named(schemas[name], schemas, found)
        for value in part.values():
            _add_named(value, schemas, found)
    elif isinstance(part, list):
        for value in part:
            _add_named(value, schemas, found)


def _model(name: str, schema: Mapping[str, Any]) -> str:
    said = " ".join(schema.get("description", f"{name}.").split("\n\n")[0].split()).replace('"', "'")
    head = f'\n\nclass {_class(name)}(Record):\n    """{said}"""\n'
    required: list[str] = schema.get("required", [])
    return head + "".join(_fields(schema.get("properties", {}), required))


def _fields(properties: Mapping[str, Any], required: list[str]) -> Iterator[str]:
    for name, schema in properties.items():
        kind = _type(schema)
        own = f"{name}_" if keyword.iskeyword(name) or not name.isidentifier() else name
        optional = name not in required
        if optional and "None" not in kind.split(" | ") and kind != "Any":
            kind += " | None"
        given = (["default=None"] if optional else []) + ([f'alias="{name}"'] if own != name else [])
        default = f" = Field({', '.join(given)})" if own != name else " = None" if optional else ""
        yield f"    {own}: {kind}{default}\n"


def _type(schema: Mapping[str, Any]) -> str:
    if "$ref" in schema:
        return _class(schema["$ref"].rsplit("/", 1)[1])
    parts = schema.get("anyOf") or schema.get("oneOf")
    if parts:
        kinds = list(dict.fromkeys(_type(part) for part in parts))
        return "Any" if "Any" in kinds else " | ".join(kinds)
    if "const" in schema or "enum" in schema:
        return f"Literal[{', '.join(map(repr, schema.get('enum', [schema.get('const')])))}]"
    kind = schema.get("type")
    if kind == "array":
        return f"list[{_type(schema.get('items', {}))}]"
    if kind == "object":
        values = schema.get("additionalProperties")
        return f"dict[str, {_type(values) if isinstance(values, dict) else 'Any'}]"
    return _TYPES.get(str(kind), "Any")


def _class(name: str) -> str:
    return name.removeprefix("Stored")
