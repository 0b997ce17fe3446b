"""The published description of the API: tidy names, and errors as what they are."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

from fastapi import FastAPI
from fastapi.routing import APIRoute

RoleOf = Callable[[str, str], str | None]
"""From a method and a path to the name of the least role that a request takes, None where it takes none."""

TAGS = (
    "sessions", "captures", "live", "solves", "answers", "machines", "cells", "history", "clouds", "archives",
    "access", "registries", "results", "guidance", "webhooks", "server", "scenes",
)  # fmt: skip
"""What operations are about, in the order in which `/docs` shows them."""

ERRORS: dict[int | str, dict[str, Any]] = {
    "default": {
        "description": "What was needed, what was there instead, and what to do.",
        "content": {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}},
    }
}
BYTES: dict[str, Any] = {"type": "string", "format": "binary"}
# What generators of clients take for a file, whatever its own media type is: it stands beside that one.
_FILE: dict[str, Any] = {"application/octet-stream": {"schema": BYTES}}
_ARCHIVE_UPLOAD: dict[str, Any] = {
    "title": "ArchiveUpload",
    "type": "object",
    "properties": {"file": BYTES},
    "required": ["file"],
}
_ETAG = {"description": "Of this revision; for `If-Match` and `If-None-Match`.", "schema": {"type": "string"}}
_LOCATION = {"description": "Where it is found.", "schema": {"type": "string"}}
_UNCHANGED = {
    "description": "Nothing has changed since the `ETag` in `If-None-Match`.",
    "headers": {"ETag": _ETAG},
}
_TAGGED = (
    "sessions_create", "sessions_get", "sessions_change", "captures_add", "captures_take_simulated",
    "captures_get", "captures_change", "captures_get_file", "clouds_get_cloud", "cells_get_released",
    "archives_import_archive", "archives_get_kept", "cells_release", "cells_rollback"
)  # fmt: skip
_LOCATED = (
    "sessions_create", "captures_add", "captures_take_simulated", "archives_import_archive", "solves_solve",
    "history_recompute", "cells_release", "cells_rollback", "live_take_shot", "live_take_sweep", "access_make",
    "webhooks_make", "equipment_add"
)  # fmt: skip
_EXAMPLES = Path(__file__).with_name("api_examples.json")
_UPLOADS = {
    "Body_captures_add": "CaptureUpload",
    "Body_equipment_set_certificate": "CertificateUpload",
    "Body_clouds_put_reference": "ReferenceUpload",
    "Body_machines_export_into_backup": "BackupUpload",
    "Body_machines_read_back_tool": "ToolUpload",
    "Body_machines_read_controller": "ControllerUpload",
    "Body_machines_read_scanner_file": "ScannerFileUpload",
    "Body_machines_recognise_files": "FilesUpload",
}


_SCHEMES: dict[str, Any] = {
    "token": {
        "type": "http",
        "scheme": "bearer",
        "description": "A token that an admin made; on the server's own machine none is needed by default.",
    },
    "login": {
        "type": "apiKey",
        "in": "cookie",
        "name": "scancell-8000",
        "description": "Set by `POST /api/v1/login`, named for the server's port; `__Host-…` under https. "
        "What changes something must come from this server's own pages.",
    },
}


def operation_id(route: APIRoute) -> str:
    """Return a name for generated clients: what it is about, then the function."""
    return f"{route.tags[0]}_{route.name}" if route.tags else route.name


def install(app: FastAPI, role_of: RoleOf) -> None:
    """Name the bodies that FastAPI makes up from form fields, and say who may do what."""
    describe = app.openapi

    def openapi() -> dict[str, Any]:
        schema = describe()
        schemas = schema["components"]["schemas"]
        schemas["ArchiveUpload"] = _ARCHIVE_UPLOAD
        for made_up, name in _UPLOADS.items():
            if made_up in schemas:  # the schema is made once, this is asked for more often
                schemas[name] = {**schemas.pop(made_up), "title": name}
                _refer_to(name, made_up, schema["paths"])
        _declare_access(schema, role_of)
        _declare_files(schema)
        _declare_headers(schema)
        _add_examples(schema)
        return schema

    app.openapi = openapi


def _add_examples(schema: dict[str, Any]) -> None:
    """Add what was sent and answered when somebody went through the whole chain; see tests/web/api_examples.py."""
    examples: dict[str, dict[str, Any]] = json.loads(_EXAMPLES.read_text(encoding="utf-8"))
    for operations in schema["paths"].values():
        for operation in operations.values():
            example = examples.get(operation["operationId"], {})
            sent = operation.get("requestBody", {}).get("content", {}).get("application/json")
            if sent is not None and "request" in example:
                sent.setdefault("example", example["request"])
            for status, answer in operation["responses"].items():
                answered = answer.get("content", {}).get("application/json")
                if answered is not None and "answer" in example and status.startswith("2"):
                    answered["example"] = example["answer"]


def _refer_to(name: str, made_up: str, part: Any) -> None:
    """Change the references to a schema within a part of the description."""
    if isinstance(part, dict):
        for value in cast("dict[str, Any]", part).values():
            _refer_to(name, made_up, value)
        if part.get("$ref") == f"#/components/schemas/{made_up}":
            part["$ref"] = f"#/components/schemas/{name}"


def _declare_files(schema: dict[str, Any]) -> None:
    """Say what is bytes or a stream, in forms and answers, in the way that generators of clients know."""
    for upload in _UPLOADS.values():
        for part in schema["components"]["schemas"].get(upload, {}).get("properties", {}).values():
            for piece in (part, part.get("items", {}), *part.get("anyOf", ())):
                if piece.pop("contentMediaType", None) is not None:
                    piece["format"] = "binary"
    for operation in _operations(schema):
        for status, answer in operation["responses"].items():
            content = answer.get("content", {})
            for stream in content.values():
                if stream.pop("itemSchema", None) is not None:  # of OpenAPI 3.2; this is 3.1
                    stream["schema"] = {"type": "string"}
            if status.startswith("2") and content and not any(_is_text(name) for name in content):
                answer["content"] = {**_FILE, **{name: {"schema": BYTES} for name in content}}


def _is_text(media_type: str) -> bool:
    return media_type in ("text/plain", "text/event-stream") or media_type.endswith("json")


def _declare_headers(schema: dict[str, Any]) -> None:
    """Declare tags and places, and that a GET may be answered by 304."""
    for operation in _operations(schema):
        name = operation["operationId"]
        for status, answer in list(operation["responses"].items()):
            if not status.startswith("2"):
                continue
            headers = answer.setdefault("headers", {})
            if name in _TAGGED:
                headers["ETag"] = _ETAG
                if operation.get("x-role") == "read" and "304" not in operation["responses"]:
                    operation["responses"]["304"] = _UNCHANGED
            if name in _LOCATED:
                headers["Location"] = _LOCATION


def _operations(schema: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for operations in schema["paths"].values():
        yield from operations.values()


def _declare_access(schema: dict[str, Any], role_of: RoleOf) -> None:
    """Add how one logs in, and to each operation the least role that it takes."""
    schema["components"]["securitySchemes"] = _SCHEMES
    for template, operations in schema["paths"].items():
        path = re.sub(r"\{[^}]*\}", "x", template)
        for method, operation in operations.items():
            role = role_of(method.upper(), path)
            operation["x-role"] = role or "nobody"
            operation["security"] = [{"token": []}, {"login": []}] if role else []
