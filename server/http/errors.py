"""Every error leaves the server as a problem detail (RFC 9457) that says what to do."""

import logging
from collections.abc import Iterator, Mapping
from errno import ENOSPC
from http import HTTPStatus
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, JSONResponse, Response
from sqlalchemy.exc import DBAPIError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.routing import Match, Mount
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocket

from calib_core.errors import CalibrationError
from calib_core.messages import message, templates
from calib_core.records import input_error_from_details
from server.http.program_files import RESTART, UPDATED, is_updated, remember
from server.store.unavailable import OUTAGES, RETRY_AFTER_S, UnavailableError

log = logging.getLogger("scancell")

PROBLEM_JSON = "application/problem+json"

_TITLES = templates(
    {
        "input": "Input that cannot be used",
        "measurement": "Nothing measurable",
        "motion": "Motions that do not determine the answer",
        "not-found": "Not found",
        "damaged": "Stored, and damaged since",
        "conflict": "Conflict with what is stored",
        "too-large": "Too large",
        "outdated": "Changed meanwhile",
        "forbidden": "Refused",
        "login": "Login needed",
        "too-many": "Too many requests",
        "media-type": "Body of another type",
        "unavailable": "Not available now",
    }
)
_TO_DO = templates(
    {
        400: "Correct the request.",
        404: "Check the address; /docs lists them all.",
        405: "Use one of the methods that the Allow header names; /docs lists them all.",
        408: "Send it again; the same Idempotency-Key keeps it from counting twice.",
        413: "Send less at once: thin the points, crop the frame, or split the capture.",
        500: "Check the server's log and report it.",
        503: "Try again in a moment.",
        504: "Send less at once.",
        507: "Free space on the server's disk, then send it again.",
    }
)


class ForbiddenError(CalibrationError):
    """A request from a page or under a name that this server does not answer, or by somebody who may not."""

    code = "forbidden"
    status = 403


class MediaTypeError(CalibrationError):
    """A body of a type that the route does not read."""

    code = "media-type"
    status = 415


class LoginError(CalibrationError):
    """A request by nobody who is known."""

    code = "login"
    status = 401


class TooManyError(CalibrationError):
    """More requests than a token or address may send; `retry_after_s` says when there is room again."""

    code = "too-many"
    status = 429
    retry_after_s = 1


def catalogue() -> dict[str, str]:
    """Return every type of problem that an answer or a failed job may bear, without its prefix, with its title."""
    titles = {code: _TITLES[code] for code in (*_codes(CalibrationError), "unavailable")}
    return titles | {f"http-{status}": HTTPStatus(status).phrase for status in _TO_DO}


def _codes(error: type[CalibrationError]) -> Iterator[str]:
    for kind in error.__subclasses__():
        yield kind.code
        yield from _codes(kind)


def problem(error: CalibrationError) -> dict[str, Any]:
    """Return an error as problem details."""
    return {
        "type": f"urn:scancell:problem:{error.code}",
        "title": _TITLES.get(error.code, "Calibration is not possible"),
        "status": error.status,
        "detail": str(error.message),
        "need": error.need,
        "got": error.got,
        "to_do": error.to_do,
        "where": error.where,
        **({"findings": [one.to_json() for one in error.findings]} if error.findings else {}),
    }


def problem_of_status(status: int, got: str, to_do: str = "") -> dict[str, Any]:
    """Return problem details for an HTTP status that no calibration error stands behind."""
    title = HTTPStatus(status).phrase
    to_do = to_do or _TO_DO.get(status, "Try again.")
    return {
        "type": f"urn:scancell:problem:http-{status}",
        "title": title,
        "status": status,
        "detail": message("{got}. {to_do}", got=got, to_do=to_do),
        "need": "a request that this server knows",
        "got": got,
        "to_do": to_do,
        "where": "",
    }


def unavailable(got: str, to_do: str) -> dict[str, Any]:
    """Return problem details for what may be there again when the same is asked for later."""
    is_told = {"type": "urn:scancell:problem:unavailable", "title": _TITLES["unavailable"]}
    return problem_of_status(503, got, to_do) | is_told


def storage_problem(error: BaseException) -> dict[str, Any]:
    """Return problem details for a disk or a database that cannot be used."""
    if isinstance(error, UnavailableError):
        return unavailable(error.got, error.to_do)
    said = " ".join(str(error.orig if isinstance(error, DBAPIError) else error).split())
    if "full" in said or (isinstance(error, OSError) and error.errno == ENOSPC):
        return problem_of_status(
            507,
            "the disk with the data folder is full",
            message("Free space there, then send the request again; what was stored before is untouched."),
        )
    if "locked" in said:
        to_do = message("End that program, or wait until it is done, then send the request again.")
        return unavailable(message("another program holds the database ({said})", said=said), to_do)
    to_do = message(
        "Check the folder, its disk and its rights, or the database's server, then send the request again."
    )
    if isinstance(error, OSError):
        return unavailable(message("the data folder cannot be used ({said})", said=said), to_do)
    return unavailable(message("the database does not answer ({said})", said=said), to_do)


def storage_answer(error: BaseException) -> JSONResponse:
    """Return what a disk, a database or a store that cannot be used says, as the response that says it."""
    body = storage_problem(error)
    return problem_response(body, {"Retry-After": str(RETRY_AFTER_S)} if body["status"] == 503 else None)


def problem_response(body: Mapping[str, Any], headers: Mapping[str, str] | None = None) -> JSONResponse:
    """Return problem details as a response."""
    return JSONResponse(dict(body), status_code=body["status"], headers=headers, media_type=PROBLEM_JSON)


def answer_to(error: CalibrationError) -> JSONResponse:
    """Return an error as the response that says it."""
    headers: dict[str, str] = {}
    if isinstance(error, LoginError):
        headers["WWW-Authenticate"] = "Bearer"
    elif isinstance(error, TooManyError):
        headers["Retry-After"] = str(error.retry_after_s)
    return problem_response(problem(error), headers)


async def refuse(error: CalibrationError, scope: Scope, receive: Receive, send: Send) -> None:
    """Answer a request, or the handshake of a WebSocket, with an error before any route sees it."""
    await deny(answer_to(error), scope, receive, send)


async def deny(answer: Response, scope: Scope, receive: Receive, send: Send) -> None:
    """The same with an answer that is made already."""
    if scope["type"] == "websocket":
        await WebSocket(scope, receive, send).send_denial_response(answer)
    else:
        await answer(scope, receive, send)


def _is_persons(request: Request) -> bool:
    """Return whether somebody opened an address in a browser: the page then says that nothing is there."""
    programs = ("/api/", "/web/", "/scenes/")
    return (
        request.method == "GET"
        and "text/html" in request.headers.get("accept", "")
        and not request.url.path.startswith(programs)
    )


def _methods(request: Request) -> list[str]:
    """Return the methods that an address takes, whichever route takes each."""
    found = {
        method
        for method in ("GET", "POST", "PUT", "PATCH", "DELETE")
        for route in request.app.routes
        if route.matches({**request.scope, "method": method})[0] == Match.FULL
        and (method == "GET" or not isinstance(route, Mount))  # a folder of files
    }
    return sorted(found | ({"HEAD"} if "GET" in found else set()))


def install(app: FastAPI) -> None:
    """Make an application answer every error with problem details."""
    remember()

    async def calibration(_: Request, error: Exception) -> JSONResponse:
        assert isinstance(error, CalibrationError)
        return answer_to(error)

    async def validation(_: Request, error: Exception) -> JSONResponse:
        assert isinstance(error, RequestValidationError)
        return problem_response(problem(input_error_from_details(error.errors(), error.body, "request")))

    async def http(request: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)
        if error.status_code == 404 and _is_persons(request):
            web: Path = request.app.state.settings.web
            return FileResponse(web / "index.html", 404)
        got = {
            404: f"there is nothing at {request.url.path}",
            405: f"{request.url.path} does not take {request.method}",
        }.get(error.status_code, str(error.detail).rstrip("."))
        headers = dict(error.headers or {})
        if error.status_code == 405:
            headers["Allow"] = ", ".join(_methods(request))
        return problem_response(problem_of_status(error.status_code, got), headers)

    async def storage(request: Request, error: Exception) -> JSONResponse:
        method = request.scope.get("method", "WebSocket")  # of a stream, too: its browser may be cut off
        log.error("storage failed in %s %s", method, request.url.path, exc_info=error)
        return storage_answer(error)

    async def cut_off(_: Request, __: Exception) -> JSONResponse:
        return problem_response(problem_of_status(400, "a request whose connection ended before it was whole"))

    async def unexpected(_: Request, error: Exception) -> JSONResponse:
        # The server logs it, and hangs up: it is raised again after this answer.
        if is_updated(error):
            return problem_response(unavailable(UPDATED, RESTART), {"Connection": "close"})
        got = message("an error of the program itself ({name})", name=type(error).__name__)
        to_do = "Nothing that was stored is touched; look into the server's log and report it."
        return problem_response(problem_of_status(500, got, to_do), {"Connection": "close"})

    app.add_exception_handler(CalibrationError, calibration)
    app.add_exception_handler(RequestValidationError, validation)
    app.add_exception_handler(HTTPException, http)
    app.add_exception_handler(OSError, storage)
    for unusable in OUTAGES:
        app.add_exception_handler(unusable, storage)
    app.add_exception_handler(ClientDisconnect, cut_off)
    app.add_exception_handler(Exception, unexpected)
