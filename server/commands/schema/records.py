"""`scancell schema`: the published JSON Schemas, made from the records."""

import json
from typing import Any

from calib_core.errors import InputError
from calib_core.graph.registry import stages
from calib_core.records import Record, Session

_RECORDS: dict[str, tuple[type[Record], str]] = {
    "session": (Session, "scancell session record, format scancell-session/1"),
    **{f"result-{stage.name}": (stage.result, f"scancell result of the stage {stage.name}") for stage in stages()},
}
PYTHON_CLIENT, PYTHON_MODELS = "python-client", "python-models"
SCHEMAS = (*_RECORDS, PYTHON_CLIENT, PYTHON_MODELS)


def schema_text(name: str) -> str:
    """Return the JSON Schema (draft 2020-12) of a record as text, or the API's client in Python, or its models.

    Raises
    ------
    InputError
        If there is none of this name.
    """
    if name == PYTHON_CLIENT:
        from server.commands.schema.client import client_source

        return client_source()
    if name == PYTHON_MODELS:
        from server.commands.schema.client_models import models_source

        return models_source()
    if name not in _RECORDS:
        raise InputError.unknown(name, SCHEMAS, "schema")
    record, title = _RECORDS[name]
    schema: dict[str, Any] = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    schema |= record.model_json_schema() | {"title": title}
    if name == "session":
        schema["required"] = sorted({"format", *schema["required"]})  # a file always says what it is
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"
