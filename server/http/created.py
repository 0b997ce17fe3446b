"""Where what a request made is found (201, 202), and the tag of its first revision."""

import json
from typing import Any

from fastapi import Response


def created(answer: Response, location: str, etag: str | None = None) -> Response:
    """Return an answer with its Location and, where it has a revision, its ETag.

    Parameters
    ----------
    answer : Response
        JSON.
    location : str
        A path, in which `{id}` stands for the answer's.
    etag : str, optional
        Left out, that of the answer's `revision`, where it has one.
    """
    if etag is None or "{id}" in location:
        data: Any = json.loads(bytes(answer.body))
        location = location.format(id=data["id"])
        etag = etag or (f'"{data["revision"]}"' if "revision" in data else None)
    answer.headers["Location"] = location
    if etag is not None:
        answer.headers["ETag"] = etag
    return answer
