"""The published description of the API: tidy names, and errors as what they are."""

from typing import Any

from fastapi import FastAPI
from fastapi.routing import APIRoute

ERRORS: dict[int | str, dict[str, Any]] = {
    "default": {
        "description": "What was needed, what was there instead, and what to do.",
        "content": {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}},
    }
}
_UPLOAD = "CaptureUpload"


def operation_id(route: APIRoute) -> str:
    """Return a name for generated clients: what it is about, then the function."""
    return f"{route.tags[0]}_{route.name}" if route.tags else route.name


def install(app: FastAPI) -> None:
    """Give the one body that FastAPI makes up from form fields a name that people can read."""
    describe = app.openapi

    def openapi() -> dict[str, Any]:
        schema = describe()
        schemas = schema["components"]["schemas"]
        made_up = next((name for name in schemas if name.startswith("Body_")), None)
        if made_up is not None:
            schemas[_UPLOAD] = {**schemas.pop(made_up), "title": _UPLOAD}
            upload = schema["paths"]["/api/v1/sessions/{session_id}/captures"]["post"]["requestBody"]
            upload["content"]["multipart/form-data"]["schema"] = {"$ref": f"#/components/schemas/{_UPLOAD}"}
        return schema

    app.openapi = openapi
