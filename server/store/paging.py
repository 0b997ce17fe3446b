"""Pages of a list, each with the cursor that the next one begins after."""

import json
from base64 import urlsafe_b64decode, urlsafe_b64encode
from collections.abc import Callable
from typing import Any

from calib_core.errors import InputError

Page = dict[str, Any]


def page_of(items: list[Any], limit: int, key: Callable[[Any], list[Any]]) -> Page:
    """Return `{"items", "next"}` from one item more than the page holds, if there are so many."""
    more = len(items) > limit
    items = items[:limit]
    following = urlsafe_b64encode(json.dumps(key(items[-1])).encode()).decode() if more else None
    return {"items": items, "next": following}


def after_cursor(cursor: str, *kinds: type) -> list[Any]:
    """Return what a cursor holds; raises InputError if this server did not make it."""
    try:
        values = json.loads(urlsafe_b64decode(cursor.encode("ascii")))
        if [type(value) for value in values] != list(kinds):
            raise ValueError
    except (ValueError, TypeError, RecursionError):
        to_do = "Leave it out to start over."
        raise InputError("a cursor from the `next` of a page", repr(cursor[:80]), to_do, "cursor") from None
    return values
