"""Roles, and the table of what each may do: every route with the least role that it takes.

What stands in no row is the admin's alone, and a test fails for a route that nobody has put into one.
"""

import re
from collections.abc import Iterator
from enum import IntEnum
from functools import cache


class Role(IntEnum):
    """What a token is good for; each role may do all that the ones before it may."""

    NOBODY = 0
    READ = 1
    CAPTURE = 2
    RELEASE = 3
    ADMIN = 4

    @property
    def word(self) -> str:
        """The role's name outside of this program."""
        return self.name.lower()


ROLES = ("read", "capture", "release", "admin")
"""The names of the roles that a token may have."""


def to_role(word: str) -> Role:
    """Return the role of a name in `ROLES`."""
    return Role[word.upper()]


_API = "/api/v1"
_SESSION = f"{_API}/sessions/{{session_id}}"
_CAPTURE = f"{_SESSION}/captures/{{capture_id}}"
_SCENE = "/scenes/{session}"


def _below(place: str, **paths: str) -> tuple[str, ...]:
    """Return the routes below a place, as their templates are: paths by method; a dash is the place itself."""
    return tuple(
        f"{method} {place}{'' if path == '-' else path}" for method, each in paths.items() for path in each.split()
    )


# WS stands for a WebSocket; HEAD goes with GET.
RULES: dict[Role, tuple[str, ...]] = {
    Role.NOBODY: (
        # The login page's own files hold nothing of anybody; the same files make up the rest of the page.
        *_below("", GET="/login /web/{path:path} /health /health/alive", POST="/said/{language}"),
        *_below(_API, GET="/health /me", POST="/login /logout"),
    ),
    Role.READ: (
        *_below(
            "", GET="/ /sessions/{session_id} /sessions/{session_id}/review /compare /docs /metrics /openapi.json"
        ),
        # The page alone; what it shows to an admin is not answered to others.
        *_below("", GET="/access /equipment"),
        *_below(
            _API, GET="/formats /conventions /exports /sources /stages /brands /arms /findings /findings/{code}"
        ),
        *_below(_API, GET="/equipment /equipment/{piece} /equipment/{piece}/certificate"),
        *_below(_API, GET="/robot-programs /board /movers /sessions /retention /compare/{stage}"),
        *_below(_API, GET="/jobs /jobs/{job_id} /jobs/{job_id}/events /jobs/{job_id}/answer"),
        *_below(f"{_API}/cells", GET="-"),
        *_below(f"{_API}/cells/{{cell_id}}", GET="/drift /history /answer /policy"),
        *_below(
            _SESSION, GET="- /guide /budget /planned /planned/program /recheck /check /causes /events /captures"
        ),
        *_below(_SESSION, GET="/sources/folder /devices /robot-port /table-mover"),
        *_below(_SESSION, GET="/live/events /live/picture", WS="/live/preview"),
        *_below(_CAPTURE, GET="- /files/{name:path}"),
        *_below(f"{_SESSION}/results", GET="- /{stage} /{stage}/history /{stage}/history/{number}"),
        *_below(_SESSION, GET="/timeline /timeline/{place} /kept /kept/{name:path} /clouds /clouds/{name}"),
        *_below(_SESSION, GET="/merged/section /merged/deviation /exports/{name} /answer /frames /truth/{stage}"),
        *_below(_SESSION, GET="/report /archive"),
        *_below(_SCENE, GET="- / /legend /picture /controls /page", WS="- /"),
        *_below(f"{_SCENE}/viewers/{{viewer}}", GET="/ /picture /legend", POST="/story", WS="- /"),
        # What is shown, from where, and lit up; nothing of it is stored.
        *_below(_SCENE, POST="/viewers/{viewer}/view /layers /turn /cloud /moment /compared /highlight"),
        # Reads numbers; nothing is stored.
        *_below(_SESSION, POST="/pose-lines /exports/{name} /read-back"),
        *_below(_API, POST="/controller-files /recognised-files /readings"),
        *_below(_SCENE, POST="/trial"),
    ),
    Role.CAPTURE: (
        *_below(_API, POST="/plan /certificates /arms /sessions /jobs/{job_id}/cancel /archives /archives/verify"),
        *_below(_SESSION, PATCH="-", POST="/captures /captures/batch /sources/simulated/capture /robot"),
        *_below(_CAPTURE, PATCH="-", DELETE="-"),
        *_below(f"{_SESSION}/sources/folder", PUT="-", DELETE="-"),
        *_below(f"{_SESSION}/live", PUT="-", POST="/capture /sweep /clock-offset"),
        *_below(f"{_SESSION}/table-mover", POST="/go /stop", DELETE="-"),
        *_below(_SESSION, POST="/robot-programs/{name} /solve/{stage} /replay /causes/{cause_id}/apply /changes"),
        *_below(f"{_SESSION}/merged/reference", PUT="-", DELETE="-"),
    ),
    Role.RELEASE: (
        *_below(_SESSION, POST="/release"),
        *_below(f"{_API}/cells/{{cell_id}}", POST="/rollback /acknowledge"),
    ),
    Role.ADMIN: (
        *_below(_SESSION, DELETE="-"),
        *_below(f"{_API}/cells/{{cell_id}}", PUT="/policy"),
        # Its certificates and serial numbers decide what may be released.
        *_below(f"{_API}/equipment", POST="-", PUT="/{piece} /{piece}/certificate", DELETE="/{piece}"),
        # Devices are addresses in the cell's network that this server is made to speak to.
        *_below(f"{_SESSION}/devices/{{device}}", PUT="-", DELETE="-"),
        *_below(f"{_SESSION}/robot-port", PUT="-", DELETE="-"),
        *_below(f"{_SESSION}/table-mover", PUT="-"),
        *_below(f"{_API}/tokens", GET="- /{token_id}", POST="-", DELETE="/{token_id}"),
        *_below(_API, GET="/audit"),
        *_below(f"{_API}/webhooks", GET="- /{webhook_id} /{webhook_id}/deliveries", POST="- /{webhook_id}/ping"),
        *_below(f"{_API}/webhooks", DELETE="/{webhook_id}"),
    ),
}


def needed_role(method: str, path: str) -> Role:
    """Return the least role that a request takes.

    Parameters
    ----------
    method : str
        The HTTP method, or ``WS`` for a WebSocket.
    path : str
        Decoded, as the routes match it.

    Returns
    -------
    Role
        The highest of all rows that match; ``ADMIN`` where none does.
    """
    method = "GET" if method == "HEAD" else method
    found = [role for pattern, role in _patterns().get(method, ()) if pattern.fullmatch(path)]
    return max(found, default=Role.ADMIN)


@cache
def _patterns() -> dict[str, list[tuple[re.Pattern[str], Role]]]:
    found: dict[str, list[tuple[re.Pattern[str], Role]]] = {}
    for method, pattern, role in _compiled():
        found.setdefault(method, []).append((pattern, role))
    return found


def _compiled() -> Iterator[tuple[str, re.Pattern[str], Role]]:
    for role, rows in RULES.items():
        for row in rows:
            method, template = row.split(" ", 1)
            parts = re.split(r"(\{[^}]*\})", template)
            pattern = "".join(_pattern(part) if part.startswith("{") else re.escape(part) for part in parts)
            yield method, re.compile(pattern, re.DOTALL), role


def _pattern(place: str) -> str:
    return ".*" if place.endswith(":path}") else "[^/]+"


def role_of(method: str, path: str) -> str | None:
    """Return the name of the least role that a request takes, None where it takes none."""
    role = needed_role(method, path)
    return role.word if role else None
