"""A connection to a workbench: requests that are repeated safely, and answers that need not come twice."""

import json
import random
import time
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from typing import Any, Final
from uuid import uuid4

import httpx

_PATIENCE_S: Final = 120.0
_FIRST_WAIT_S: Final = 0.2
_LONGEST_WAIT_S: Final = 5.0
_PASSING: Final = (429, 502, 503, 504)
_NOTHING_DONE: Final = (429, 503)
_DAMAGED: Final = "urn:scancell:problem:damaged"
_REMEMBERED: Final = 200
_REMEMBERED_BYTES: Final = 1_000_000


class ProblemError(Exception):
    """A request that was refused, or a job that failed: problem details (RFC 9457).

    Attributes
    ----------
    status : int
        The HTTP status.
    details : dict
        With `detail` (a sentence that says what to do), `need`, `got`, `to_do`, `where` and `type`.
    """

    def __init__(self, details: Mapping[str, Any]) -> None:
        super().__init__(details.get("detail", "no details"))
        self.details = dict(details)
        self.status: int = details.get("status", 0)


class UnavailableError(ProblemError):
    """A workbench, or what it rests on, that was still away when the patience ended: ask again later."""


@dataclass(frozen=True)
class Event:
    """What happened in a session: `capture`, `result`, `job` or `session`, with its number."""

    id: int
    kind: str
    data: Mapping[str, Any]


class Connection:
    """A connection to a workbench.

    A request that got no answer, or was told to come again (429, 502, 503, 504), is sent again until it is
    answered or the patience ends, so that a restart of the server fails nothing; a POST has the same
    Idempotency-Key each time: it does nothing twice.  It waits as long as `Retry-After` says and by chance up
    to a quarter longer, else for a random part of a time that doubles: many do not come back at once.  What was
    read before is asked for with its ETag and comes only where it has changed.

    Parameters
    ----------
    address : str
        Such as ``http://127.0.0.1:8000``.
    token : str, optional
        An API token, where the workbench asks for one.
    patience_s : float, optional
        For how long a request is sent again; 0 sends it once.
    **more
        Further arguments of `httpx.Client`, such as `timeout` (seconds) or `verify` (a certificate).
    """

    def __init__(
        self, address: str, token: str | None = None, patience_s: float = _PATIENCE_S, **more: Any
    ) -> None:
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        options: dict[str, Any] = {"timeout": 60.0, **more}
        self._client = httpx.Client(base_url=address, headers=headers, **options)
        self._patience_s = patience_s
        self._seen: OrderedDict[str, tuple[str, Any]] = OrderedDict()

    def close(self) -> None:
        """Hang up."""
        self._client.close()

    def request(self, method: str, path: str, **more: Any) -> Any:
        """Send a request and return the answer's data: JSON, bytes where it is a file, None where there is none.

        Raises
        ------
        ProblemError
            If it is refused; `UnavailableError` where the same may be answered later.
        httpx.TransportError
            If the workbench does not answer.
        """
        headers = {name: value for name, value in more.pop("headers", {}).items() if value is not None}
        if method == "POST":
            headers.setdefault("Idempotency-Key", str(uuid4()))
        key = self._key(path, more.get("params"))
        tag, known = self._seen.get(key, (None, None)) if method == "GET" else (None, None)
        if tag is not None:
            headers.setdefault("If-None-Match", tag)
        answer, repeated = self._answer(method, path, headers, more)
        if answer.status_code == 304:
            self._seen.move_to_end(key)
            return json.loads(known) if isinstance(known, str) else known
        if answer.status_code == 404 and method == "DELETE" and repeated:
            return None  # the attempt whose answer got lost has removed it
        if answer.is_error:
            raise problem_of(_details(answer))
        if answer.status_code == 204:
            return None
        is_json = "json" in answer.headers.get("content-type", "")
        if method == "GET" and "etag" in answer.headers and len(answer.content) <= _REMEMBERED_BYTES:
            self._seen[key] = answer.headers["etag"], answer.text if is_json else answer.content
            while len(self._seen) > _REMEMBERED:
                self._seen.popitem(last=False)
        return answer.json() if is_json else answer.content

    def whole(self, method: str, path: str, params: Mapping[str, Any]) -> Any:
        """Return a list, or the page of it that `limit` or `cursor` asks for; raises ProblemError."""
        page = self.request(method, path, params=params)
        if {"limit", "cursor"} & set(params):
            return page
        items = list(page["items"])
        while page["next"] is not None:
            page = self.request(method, path, params={**params, "cursor": page["next"]})
            items += page["items"]
        return {**page, "items": items}

    def read(self, path: str) -> tuple[Any, str | None]:
        """Return what stands at an address, and its ETag where it has one; raises ProblemError."""
        data = self.request("GET", path)
        return data, self._seen.get(self._key(path), (None, None))[0]

    def _key(self, path: str, params: Mapping[str, Any] | None = None) -> str:
        return str(self._client.build_request("GET", path, params=params).url)

    def events(self, session_id: str, after: int | None = None) -> Iterator[Event]:
        """Give a session's events as they happen, after a number or from now on; a broken stream goes on there.

        It begins with the newest event and ends with the session.  Raises ProblemError.
        """
        path = f"/api/v1/sessions/{session_id}/events"
        failures = 0
        while True:
            headers = {"Accept": "text/event-stream"} | ({} if after is None else {"Last-Event-ID": str(after)})
            with (
                suppress(httpx.TransportError),
                self._client.stream("GET", path, headers=headers, timeout=None) as answer,
            ):
                if answer.is_error and answer.status_code not in _PASSING:
                    answer.read()
                    raise problem_of(_details(answer))
                for event in _parsed(answer.iter_lines()) if answer.is_success else ():
                    failures, after = 0, event.id
                    yield event
                    if event.kind == "session" and event.data.get("action") == "removed":
                        return
            failures += 1
            time.sleep(_wait_s(failures))

    def _answer(
        self, method: str, path: str, headers: Mapping[str, str], more: Mapping[str, Any]
    ) -> tuple[httpx.Response, bool]:
        """Return the answer, and whether it took more than one attempt."""
        # A PATCH against a revision may have succeeded; a stream cannot be sent twice.
        is_bytes = isinstance(more.get("content", b""), str | bytes)
        may_repeat = is_bytes and "If-Match" not in headers
        ends_s = time.monotonic() + self._patience_s
        attempt = 0
        while True:
            attempt += 1
            try:
                answer = self._client.request(method, path, headers=headers, **more)
            except httpx.TransportError as error:
                wait_s = _wait_s(attempt)
                unsent = isinstance(error, httpx.ConnectError | httpx.ConnectTimeout)
                if not (may_repeat or unsent) or time.monotonic() + wait_s > ends_s:
                    raise
            else:
                told_s = _told_to_wait_s(answer.headers.get("retry-after"))
                wait_s = told_s * random.uniform(1.0, 1.25) if told_s else _wait_s(attempt)
                again = may_repeat or (is_bytes and answer.status_code in _NOTHING_DONE)
                passes = answer.status_code in _PASSING and _details(answer).get("type") != _DAMAGED
                if not passes or not again or time.monotonic() + wait_s > ends_s:
                    return answer, attempt > 1
            time.sleep(wait_s)


def problem_of(details: Mapping[str, Any]) -> ProblemError:
    """Return the error that problem details stand for."""
    passes = details.get("status") in _PASSING and details.get("type") != _DAMAGED
    return UnavailableError(details) if passes else ProblemError(details)


def _details(answer: httpx.Response) -> dict[str, Any]:
    with suppress(ValueError):
        data = answer.json()
        if isinstance(data, dict):
            return {"status": answer.status_code, **data}
    return {"status": answer.status_code, "detail": answer.text[:500] or answer.reason_phrase}


def _wait_s(attempt: int) -> float:
    """Return a random part of a time that doubles, so that many do not come back at once."""
    longest_s = min(_FIRST_WAIT_S * 2 ** min(attempt, 10), _LONGEST_WAIT_S)
    return random.uniform(longest_s / 4, longest_s)


def _told_to_wait_s(text: str | None) -> float | None:
    """Return what `Retry-After` says, seconds or a date, in seconds from now."""
    if text is None or text.isdecimal():
        return None if text is None else float(text)
    with suppress(ValueError):
        until = parsedate_to_datetime(text)
        return max((until.replace(tzinfo=until.tzinfo or UTC) - datetime.now(UTC)).total_seconds(), 0.0)
    return None


def _parsed(lines: Iterator[str]) -> Iterator[Event]:
    """Give the events of a stream of server-sent events."""
    fields: dict[str, str] = {}
    for line in lines:
        if line:
            name, _, value = line.partition(":")
            fields[name] = value.removeprefix(" ")
        elif "data" in fields and fields.get("id", "").isdecimal():
            yield Event(int(fields["id"]), fields.get("event", "message"), json.loads(fields["data"]))
            fields = {}
        else:
            fields = {}
