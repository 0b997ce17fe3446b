"""`scancell schema`: the published JSON Schemas, made from the records."""

import json
from typing import Any

from calib_core.records import Record, Session, TcpResult

_RECORDS: dict[str, tuple[type[Record], str]] = {
    "session": (Session, "scancell session record, format scancell-session/1"),
    "result-tcp": (TcpResult, "scancell result of the stage tcp"),
}


def schema_text(name: str) -> str:
    """Return the JSON Schema (draft 2020-12) of a record, as text."""
    record, title = _RECORDS[name]
    schema: dict[str, Any] = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    schema |= record.model_json_schema() | {"title": title}
    if name == "session":
        schema["required"] = sorted({"format", *schema["required"]})  # a file always says what it is
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"
