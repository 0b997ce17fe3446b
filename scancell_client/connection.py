"""A connection to a workbench: requests that are repeated safely, and answers that need not come twice."""

import json
import time
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final
from uuid import uuid4

import httpx

_ATTEMPTS: Final = 5
_FIRST_WAIT_S: Final = 0.2
_LONGEST_WAIT_S: Final = 30.0
_PASSING: Final = (429, 502, 503, 504)
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


@dataclass(frozen=True)
class Event:
    """What happened in a session: `capture`, `result`, `job` or `session`, with its number."""

    id: int
    kind: str
    data: Mapping[str, Any]


class Connection:
    """A connection to a workbench.

    A request that got no answer, or was told to come again (429, 502, 503, 504), is sent again after a while, a
    POST with the same Idempotency-Key: it does nothing twice.  What was read before is asked for with its ETag and
    comes only where it has changed.

    Parameters
    ----------
    address : str
        Such as ``http://127.0.0.1:8000``.
    token : str, optional
        An API token, where the workbench asks for one.
    attempts : int, optional
        How often a request is sent at most.
    **more
        Further arguments of `httpx.Client`, such as `timeout` (seconds) or `verify` (a certificate).
    """

    def __init__(self, address: str, token: str | None = None, attempts: int = _ATTEMPTS, **more: Any) -> None:
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        options: dict[str, Any] = {"timeout": 60.0, **more}
        self._client = httpx.Client(base_url=address, headers=headers, **options)
        self._attempts = max(1, attempts)
        self._seen: OrderedDict[str, tuple[str, Any]] = OrderedDict()

    def close(self) -> None:
        """Hang up."""
        self._client.close()

    def request(self, method: str, path: str, **more: Any) -> Any:
        """Send a request and return the answer's data: JSON, bytes where it is a file, None where there is none.

        Raises
        ------
        ProblemError
            If it is refused.
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
            raise ProblemError(_details(answer))
        if answer.status_code == 204:
            return None
        is_json = "json" in answer.headers.get("content-type", "")
        if method == "GET" and "etag" in answer.headers and len(answer.content) <= _REMEMBERED_BYTES:
            self._seen[key] = answer.headers["etag"], answer.text if is_json else answer.content
            while len(self._seen) > _REMEMBERED:
                self._seen.popitem(last=False)
        return answer.json() if is_json else answer.content

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
                    raise ProblemError(_details(answer))
                for event in _parsed(answer.iter_lines()) if answer.is_success else ():
                    failures, after = 0, event.id
                    yield event
                    if event.kind == "session" and event.data.get("action") == "removed":
                        return
            failures += 1
            time.sleep(min(_FIRST_WAIT_S * 2**failures, _LONGEST_WAIT_S))

    def _answer(
        self, method: str, path: str, headers: Mapping[str, str], more: Mapping[str, Any]
    ) -> tuple[httpx.Response, bool]:
        """Return the answer, and whether it took more than one attempt."""
        # A PATCH against a revision may have succeeded; a stream cannot be sent twice.
        may_repeat = "If-Match" not in headers and isinstance(more.get("content", b""), str | bytes)
        for attempt in range(1, self._attempts + 1):
            last = attempt == self._attempts or not may_repeat
            try:
                answer = self._client.request(method, path, headers=headers, **more)
            except httpx.TransportError:
                if last:
                    raise
                wait_s = None
            else:
                if answer.status_code not in _PASSING or last:
                    return answer, attempt > 1
                wait_s = _seconds(answer.headers.get("retry-after"))
            time.sleep(min(wait_s or _FIRST_WAIT_S * 2 ** (attempt - 1), _LONGEST_WAIT_S))
        raise AssertionError("unreachable")


def _details(answer: httpx.Response) -> dict[str, Any]:
    with suppress(ValueError):
        data = answer.json()
        if isinstance(data, dict):
            return {"status": answer.status_code, **data}
    return {"status": answer.status_code, "detail": answer.text[:500] or answer.reason_phrase}


def _seconds(text: str | None) -> float | None:
    return float(text) if text is not None and text.isdecimal() else None


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
