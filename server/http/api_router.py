"""Where routes are declared: each knows its whole address and what it answers, and is built once.

Routers that are included in others would have all their routes built again for every application.
"""

from typing import Any

from fastapi import APIRouter, Depends
from fastapi.requests import HTTPConnection
from fastapi.routing import APIRoute

from server.http.openapi import ERRORS, operation_id
from server.http.strict_json import StrictRoute

API = "/api/v1"


def api_router(tag: str, prefix: str = API, route_class: type[APIRoute] = StrictRoute) -> APIRouter:
    """Return a router whose operations bear a tag, and whose errors are problem details."""
    return APIRouter(
        prefix=prefix,
        tags=[tag],
        route_class=route_class,
        responses=ERRORS,
        generate_unique_id_function=operation_id,
    )


def of_app(name: str) -> Any:
    """Return what gives a route something that stands in the application's state."""

    async def given(connection: HTTPConnection) -> Any:  # FastAPI hands plain functions to another thread first
        return getattr(connection.app.state, name)

    return Depends(given)
