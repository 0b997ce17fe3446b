"""JSON from outside: finite numbers, bounded depth, text that can be stored anywhere."""

import json
from collections.abc import Callable, Coroutine
from typing import Any, NoReturn, cast

from fastapi.routing import APIRoute
from pydantic_core import to_json
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from calib_core.errors import CalibrationError, InputError, TooLargeError
from calib_core.messages import message
from calib_core.records.plain_json import require_plain, told_once, too_deep
from server.http.errors import MediaTypeError
from server.http.preferences import applied


def parse_json(text: str | bytes, where: str) -> Any:
    """Return the data that JSON text describes.

    Raises
    ------
    InputError
        If it is not JSON, is nested too deeply, or holds NaN, infinities or text that is not Unicode.
    """
    try:
        data = json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=told_once)
    except RecursionError:
        raise too_deep(where) from None
    except InputError as error:
        raise error.at(where) from None
    except ValueError as error:  # includes UnicodeDecodeError and integers of thousands of digits
        raise InputError("JSON (UTF-8)", "something else ({error})", "Correct it.", where, error=error) from None
    require_plain(data, where)
    return data


def parse_object(text: str | bytes, where: str) -> dict[str, Any]:
    """Return names and values that JSON text describes; raises InputError where it is none, or another value."""
    data = parse_json(text, where)
    if not isinstance(data, dict):
        raise InputError("a JSON object", json.dumps(data)[:80], "Send names and values.", where)
    return cast("dict[str, Any]", data)


def plain_json(data: Any) -> Any:
    """Return data as plain JSON data, in which NaN and infinities have become null."""
    return json.loads(to_json(data, inf_nan_mode="null"))


def _refuse_constant(name: str) -> NoReturn:
    raise InputError("finite numbers", name, "Leave it out.")


class StrictRequest(Request):
    """A request whose JSON body is read by `parse_json` and has its own, smaller limit."""

    async def json(self) -> Any:
        """Return the body's data; raises InputError and TooLargeError."""
        limit: int = self.app.state.settings.max_json_bytes
        body = await self.body()
        if len(body) > limit:
            to_do = "Send less at once."
            raise TooLargeError("at most {limit} bytes of JSON", f"{len(body)}", to_do, "request", limit=limit)
        return parse_json(body, "request")


def require_media_type(route: APIRoute, request: Request) -> None:
    """Refuse a body of another type than a route reads; raises MediaTypeError, which names the types."""
    has_body = request.headers.get("content-length", "0") != "0" or "transfer-encoding" in request.headers
    body = route.body_field
    if not has_body or body is None:
        return
    needed: str = getattr(body.field_info, "media_type", "application/json")
    given = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    is_json = given == "application/json" or (given.startswith("application/") and given.endswith("+json"))
    if given != needed and not (needed == "application/json" and is_json):
        to_do = message("Send it with `Content-Type: {needed}`.", needed=needed)
        need = "a body of the type {needed}"
        raise MediaTypeError(need, given or "one without a Content-Type", to_do, "request", needed=needed)


class StrictRoute(APIRoute):
    """A route whose requests are `StrictRequest`s."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the route's handler, reading JSON strictly."""
        handle = super().get_route_handler()

        async def strict(request: Request) -> Response:
            try:
                require_media_type(self, request)
                strict_request = StrictRequest(request.scope, request.receive)
                return applied(request, await handle(strict_request))
            except HTTPException as error:
                # FastAPI turns errors of reading a body into 400s without their words.
                if isinstance(error.__cause__, CalibrationError):
                    raise error.__cause__ from None
                raise

        return strict
