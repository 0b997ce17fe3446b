"""JSON from outside: finite numbers, bounded depth, text that can be stored anywhere."""

import json
from collections.abc import Callable, Coroutine
from typing import Any, NoReturn

from fastapi.routing import APIRoute
from pydantic_core import to_json
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from calib_core.archive.plain_json import require_plain, too_deep
from calib_core.errors import CalibrationError, InputError, TooLargeError


def parse_json(text: str | bytes, where: str) -> Any:
    """Return the data that JSON text describes.

    Raises
    ------
    InputError
        If it is not JSON, is nested too deeply, or holds NaN, infinities or text that is not Unicode.
    """
    try:
        data = json.loads(text, parse_constant=_refuse_constant)
    except RecursionError:
        raise too_deep(where) from None
    except InputError as error:
        raise error.at(where) from None
    except ValueError as error:  # includes UnicodeDecodeError and integers of thousands of digits
        raise InputError("JSON (UTF-8)", f"something else: {error}", "Correct the text.", where) from None
    require_plain(data, where)
    return data


def plain_json(data: Any) -> Any:
    """Return data as plain JSON data, in which NaN and infinities have become null."""
    return json.loads(to_json(data, inf_nan_mode="null"))


def _refuse_constant(name: str) -> NoReturn:
    raise InputError("finite numbers", name, "Leave the field out where there is no value.")


class StrictRequest(Request):
    """A request whose JSON body is read by `parse_json` and has its own, smaller limit."""

    async def json(self) -> Any:
        """Return the body's data; raises InputError and TooLargeError."""
        limit: int = self.app.state.settings.max_json_bytes
        body = await self.body()
        if len(body) > limit:
            raise TooLargeError(f"at most {limit} bytes of JSON", f"{len(body)}", "Send less at once.", "request")
        return parse_json(body, "request")


class StrictRoute(APIRoute):
    """A route whose requests are `StrictRequest`s."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the route's handler, reading JSON strictly."""
        handle = super().get_route_handler()

        async def strict(request: Request) -> Response:
            try:
                return await handle(StrictRequest(request.scope, request.receive))
            except HTTPException as error:
                # FastAPI turns errors of reading a body into 400s without their words.
                if isinstance(error.__cause__, CalibrationError):
                    raise error.__cause__ from None
                raise

        return strict
