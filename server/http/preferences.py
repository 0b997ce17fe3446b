"""What a program may prefer: a small answer to what it sends (RFC 7240), and none to what it has already (304)."""

import json
import re
from typing import Any, Final

from starlette.requests import Request
from starlette.responses import Response

from calib_core.findings.catalogues import LANGUAGES
from server.http.downloads import Download
from server.http.language import spoken

_KEPT: Final = ("id", "name", "revision", "session", "stage", "status", "verdict", "error", "measured", "stored")
_KEPT_OF_MEASURED: Final = ("verdict", "reason", "to_do")


def applied(request: Request, response: Response) -> Response:
    """Return a response as its request prefers it."""
    if request.method in ("POST", "PATCH", "PUT") and _wants_little(request):
        return _minimal(response)
    _tag_with_language(response)
    if request.method in ("GET", "HEAD") and _has_it(request, response):
        if isinstance(response, Download):
            response.discard()
        kept = ("etag", "cache-control", "scancell-stale", "scancell-verdict")
        return Response(status_code=304, headers={n: response.headers[n] for n in kept if n in response.headers})
    return response


def _tag_with_language(response: Response) -> None:
    """Put the language into the tag of what is said in another than English: else it is taken for the same."""
    tag, language = response.headers.get("etag"), spoken().language
    if tag is not None and language != "en" and response.headers.get("content-type", "") == "application/json":
        response.headers["ETag"] = f'{tag[:-1]};{language}"'


def tags_without_language(tags: str | None) -> str | None:
    """Return an If-Match header as changes are made against it: what is stored has one tag in all languages."""
    return tags and re.sub(rf';(?:{"|".join(LANGUAGES)})"', '"', tags)


def _wants_little(request: Request) -> bool:
    preferred = ",".join(request.headers.getlist("prefer")).replace(" ", "").lower()
    return "return=minimal" in preferred.split(",")


def _minimal(response: Response) -> Response:
    """Return a JSON answer without what its receiver sent or can ask for."""
    is_json = response.headers.get("content-type", "") == "application/json"
    if not (200 <= response.status_code < 300 and is_json and isinstance(response.body, bytes)):
        return response
    data: Any = json.loads(response.body)
    if not isinstance(data, dict) or "id" not in data:
        return response
    little = {name: data[name] for name in _KEPT if name in data}
    if isinstance(little.get("measured"), dict):
        little["measured"] = {name: little["measured"].get(name) for name in _KEPT_OF_MEASURED}
    kept = {n: v for n, v in response.headers.items() if n not in ("content-length", "content-type")}
    body = json.dumps(little, ensure_ascii=False)
    headers = {**kept, "Preference-Applied": "return=minimal"}
    return Response(body, response.status_code, headers, media_type="application/json")


def _has_it(request: Request, response: Response) -> bool:
    given, own = request.headers.get("if-none-match"), response.headers.get("etag")
    if given is None or own is None or response.status_code != 200:
        return False
    tags = {tag.strip().removeprefix("W/") for tag in given.split(",")}
    return "*" in tags or own in tags
