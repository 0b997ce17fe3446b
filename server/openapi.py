"""The published description of the API: tidy names, and errors as what they are."""

import re
from typing import Any

from fastapi import FastAPI
from fastapi.routing import APIRoute

from server.auth.roles import needed_role

ERRORS: dict[int | str, dict[str, Any]] = {
    "default": {
        "description": "What was needed, what was there instead, and what to do.",
        "content": {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}},
    }
}
_UPLOAD = "CaptureUpload"


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


def install(app: FastAPI) -> None:
    """Name the one body that FastAPI makes up from form fields, and say who may do what."""
    describe = app.openapi

    def openapi() -> dict[str, Any]:
        schema = describe()
        schemas = schema["components"]["schemas"]
        made_up = next((name for name in schemas if name.startswith("Body_")), None)
        if made_up is not None:
            schemas[_UPLOAD] = {**schemas.pop(made_up), "title": _UPLOAD}
            upload = schema["paths"]["/api/v1/sessions/{session_id}/captures"]["post"]["requestBody"]
            upload["content"]["multipart/form-data"]["schema"] = {"$ref": f"#/components/schemas/{_UPLOAD}"}
        _declare_access(schema)
        return schema

    app.openapi = openapi


def _declare_access(schema: dict[str, Any]) -> None:
    """Add how one logs in, and to each operation the least role that it takes."""
    schema["components"]["securitySchemes"] = _SCHEMES
    for template, operations in schema["paths"].items():
        path = re.sub(r"\{[^}]*\}", "x", template)
        for method, operation in operations.items():
            role = needed_role(method.upper(), path)
            operation["x-role"] = role.word
            operation["security"] = [{"token": []}, {"login": []}] if role else []
