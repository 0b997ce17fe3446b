"""Roles, and the table of what each may do: every route with the least role that it takes.

`middleware.py` compares it with who asks.  What stands in no row is the admin's alone, and a test fails for a
route that nobody has put into one.
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

# Templates as in the routes.  WS stands for a WebSocket; HEAD goes with GET.
RULES: dict[Role, tuple[str, ...]] = {
    Role.NOBODY: (
        # The login page's own files hold nothing of anybody; the same files make up the rest of the page.
        "GET /login",
        "GET /web/{path:path}",
        "POST /said/{language}",
        f"GET {_API}/health",
        "GET /health",
        "GET /health/alive",
        f"GET {_API}/me",
        f"POST {_API}/login",
        f"POST {_API}/logout",
    ),
    Role.READ: (
        "GET /",
        "GET /sessions/{session_id}",
        "GET /sessions/{session_id}/review",
        "GET /compare",
        # The page alone; what it shows to an admin is not answered to others.
        "GET /access",
        "GET /equipment",
        "GET /docs",
        "GET /metrics",
        "GET /openapi.json",
        *(
            f"GET {_API}/{what}"
            for what in (
                "formats",
                "conventions",
                "exports",
                "sources",
                "stages",
                "brands",
                "arms",
                "jobs",
                "findings",
                "equipment",
            )
        ),
        f"GET {_API}/findings/{{code}}",
        f"GET {_API}/equipment/{{piece}}",
        f"GET {_API}/equipment/{{piece}}/certificate",
        f"GET {_API}/robot-programs",
        f"GET {_API}/board",
        f"GET {_API}/movers",
        f"GET {_SESSION}/table-mover",
        f"GET {_API}/sessions",
        f"GET {_SESSION}",
        f"GET {_SESSION}/guide",
        f"GET {_SESSION}/budget",
        f"GET {_SESSION}/planned",
        f"GET {_SESSION}/planned/program",
        f"GET {_SESSION}/recheck",
        f"GET {_API}/retention",
        f"GET {_API}/cells/{{cell_id}}/drift",
        f"GET {_SESSION}/check",
        f"GET {_SESSION}/causes",
        f"GET {_SESSION}/events",
        f"GET {_SESSION}/captures",
        f"GET {_SESSION}/sources/folder",
        f"GET {_SESSION}/devices",
        f"GET {_SESSION}/robot-port",
        f"GET {_SESSION}/live/events",
        f"GET {_SESSION}/live/picture",
        f"WS {_SESSION}/live/preview",
        f"GET {_CAPTURE}",
        f"GET {_CAPTURE}/files/{{name:path}}",
        f"GET {_SESSION}/results",
        f"GET {_SESSION}/results/{{stage}}",
        f"GET {_SESSION}/results/{{stage}}/history",
        f"GET {_SESSION}/results/{{stage}}/history/{{number}}",
        f"GET {_SESSION}/timeline",
        f"GET {_SESSION}/timeline/{{place}}",
        f"GET {_SESSION}/kept",
        f"GET {_SESSION}/kept/{{name:path}}",
        f"GET {_SESSION}/clouds",
        f"GET {_SESSION}/clouds/{{name}}",
        f"GET {_SESSION}/merged/section",
        f"GET {_SESSION}/merged/deviation",
        f"GET {_API}/compare/{{stage}}",
        f"GET {_API}/jobs/{{job_id}}/answer",
        f"GET {_SESSION}/exports/{{name}}",
        f"GET {_SESSION}/answer",
        f"GET {_SESSION}/frames",
        f"GET {_SESSION}/truth/{{stage}}",
        f"GET {_API}/cells",
        f"GET {_API}/cells/{{cell_id}}/history",
        f"GET {_API}/cells/{{cell_id}}/answer",
        f"GET {_API}/cells/{{cell_id}}/policy",
        f"GET {_SESSION}/report",
        f"GET {_SESSION}/archive",
        f"GET {_API}/jobs/{{job_id}}",
        f"GET {_API}/jobs/{{job_id}}/events",
        "GET /scenes/{session}",
        "GET /scenes/{session}/",
        "GET /scenes/{session}/legend",
        "GET /scenes/{session}/picture",
        "WS /scenes/{session}",
        "WS /scenes/{session}/",
        "GET /scenes/{session}/controls",
        "GET /scenes/{session}/page",
        "GET /scenes/{session}/viewers/{viewer}/",
        "GET /scenes/{session}/viewers/{viewer}/picture",
        "GET /scenes/{session}/viewers/{viewer}/legend",
        "POST /scenes/{session}/viewers/{viewer}/story",
        "WS /scenes/{session}/viewers/{viewer}",
        "WS /scenes/{session}/viewers/{viewer}/",
        # What is shown, and from where; nothing of it is stored.
        "POST /scenes/{session}/viewers/{viewer}/view",
        "POST /scenes/{session}/layers",
        "POST /scenes/{session}/turn",
        "POST /scenes/{session}/cloud",
        "POST /scenes/{session}/moment",
        # Compares what is stored with what its captures give; of a reader's nothing is noted.
        f"POST {_SESSION}/replay",
        # Reads numbers; nothing is stored.
        f"POST {_SESSION}/pose-lines",
        f"POST {_API}/controller-files",
        f"POST {_API}/recognised-files",
        f"POST {_API}/readings",
        f"POST {_SESSION}/exports/{{name}}",
        f"POST {_SESSION}/read-back",
        "POST /scenes/{session}/trial",
        # Lights a capture up in the scene; nothing of it is stored.
        "POST /scenes/{session}/compared",
        "POST /scenes/{session}/highlight",
    ),
    Role.CAPTURE: (
        f"POST {_API}/plan",
        f"POST {_API}/certificates",
        f"POST {_API}/arms",
        f"POST {_API}/sessions",
        f"PATCH {_SESSION}",
        f"POST {_SESSION}/captures/batch",
        f"POST {_SESSION}/captures",
        f"PATCH {_CAPTURE}",
        f"DELETE {_CAPTURE}",
        f"POST {_SESSION}/sources/simulated/capture",
        f"PUT {_SESSION}/sources/folder",
        f"PUT {_SESSION}/live",
        f"POST {_SESSION}/live/capture",
        f"POST {_SESSION}/live/sweep",
        f"POST {_SESSION}/live/clock-offset",
        f"POST {_SESSION}/table-mover/go",
        f"POST {_SESSION}/table-mover/stop",
        f"DELETE {_SESSION}/table-mover",
        f"POST {_SESSION}/robot",
        f"POST {_SESSION}/robot-programs/{{name}}",
        f"DELETE {_SESSION}/sources/folder",
        f"POST {_SESSION}/solve/{{stage}}",
        f"POST {_SESSION}/causes/{{cause_id}}/apply",
        f"POST {_SESSION}/changes",
        f"PUT {_SESSION}/merged/reference",
        f"DELETE {_SESSION}/merged/reference",
        f"POST {_API}/jobs/{{job_id}}/cancel",
        f"POST {_API}/archives",
        f"POST {_API}/archives/verify",
    ),
    Role.RELEASE: (
        f"POST {_SESSION}/release",
        f"POST {_API}/cells/{{cell_id}}/rollback",
        f"POST {_API}/cells/{{cell_id}}/acknowledge",
    ),
    Role.ADMIN: (
        f"DELETE {_SESSION}",
        f"PUT {_API}/cells/{{cell_id}}/policy",
        # Its certificates and serial numbers decide what may be released.
        f"POST {_API}/equipment",
        f"PUT {_API}/equipment/{{piece}}",
        f"DELETE {_API}/equipment/{{piece}}",
        f"PUT {_API}/equipment/{{piece}}/certificate",
        # Devices are addresses in the cell's network that this server is made to speak to.
        f"PUT {_SESSION}/devices/{{device}}",
        f"DELETE {_SESSION}/devices/{{device}}",
        f"PUT {_SESSION}/robot-port",
        f"PUT {_SESSION}/table-mover",
        f"DELETE {_SESSION}/robot-port",
        f"GET {_API}/tokens",
        f"GET {_API}/tokens/{{token_id}}",
        f"POST {_API}/tokens",
        f"DELETE {_API}/tokens/{{token_id}}",
        f"GET {_API}/audit",
        f"GET {_API}/webhooks",
        f"POST {_API}/webhooks",
        f"GET {_API}/webhooks/{{webhook_id}}",
        f"DELETE {_API}/webhooks/{{webhook_id}}",
        f"GET {_API}/webhooks/{{webhook_id}}/deliveries",
        f"POST {_API}/webhooks/{{webhook_id}}/ping",
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
