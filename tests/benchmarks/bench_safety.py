"""Every way in, for everybody who has no right to it: how many requests are refused as they should be."""

import re
import socket
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import msgspec
import viser
from harness import Row
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from tests.server.access import ROLES, bearer, every_route, guarded, log_in, site_of
from tests.server.live_server import simulated_session

PROTOCOL = Subprotocol(f"viser-v{viser.__version__}")
FOREIGN = ("https://evil.example", "null", "http://127.0.0.1:1")
WRONG = "scancell_000000000000_" + "A" * 43


@dataclass(frozen=True)
class Trial:
    """A request, and whether it was refused; `should` says whether it must be."""

    group: str
    what: str
    should: bool
    refused: bool
    answer: str


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` changes nothing: every route is asked anyway."""
    found = list(trials())
    rows: list[Row] = []
    for group in dict.fromkeys(trial.group for trial in found):
        own = [trial for trial in found if trial.group == group]
        right = Counter(trial.should for trial in own if trial.refused == trial.should)
        all_of = Counter(trial.should for trial in own)
        measured = f"{right[True]} of {all_of[True]} refused"
        if all_of[False]:
            measured += f", {right[False]} of {all_of[False]} let in"
        rows.append(Row(group, "100 % as they should be", measured, right == all_of))
    return rows


def trials(every: bool = True) -> Iterator[Trial]:
    """Serve a session with a login, and try everything; not `every`: one way of each kind a route, in turn."""
    with tempfile.TemporaryDirectory() as folder, guarded(Path(folder)) as (client, tokens):
        client.headers.update(bearer(tokens["admin"]))
        session = simulated_session(client, captures=1)
        before = client.get(f"/sessions/{session}").json()
        cookies = {role: log_in(client, tokens[role]) for role in ROLES}
        del client.headers["Authorization"]
        yield from _every_route_and_role(client, session, tokens, cookies, every)
        yield from _foreign_pages(client, session, cookies["admin"], every)
        yield from _foreign_names(client)
        yield from _sockets(client, session, tokens, cookies)
        yield from _share_requests(client, session, cookies["admin"])
        after = client.get(f"/sessions/{session}", headers=bearer(tokens["read"])).json()
        yield Trial("changes by what was refused", "the session", True, after == before, "changed")


def role_that_should_do(method: str, path: str) -> str:
    """Return the least role of a route by the rule that people know, not by the server's own table.

    Who looks needs `read`, who changes something `capture`, who decides which answer of a cell is in force, and
    what is known of it, `release`. Tokens, the log, webhooks, a cell's policy, the register of equipment (its
    certificates and serial numbers decide what may be released) and removing a session are the admin's, and so is
    what this server connects to or listens on in the cell's network, and arming what moves; the login page, its
    files and the signs of life are anybody's.
    """
    page = ("/login", "/web/{path:path}", "/said/{language}")
    if path in page or re.fullmatch(r"(/api/v1)?/(me|log(in|out)|health\S*)", path):
        return "nobody"
    if (
        "/tokens" in path
        or "/webhooks" in path
        or path.endswith("/audit")
        or (method != "GET" and (path.endswith("/policy") or path.startswith("/api/v1/equipment")))
        or (method, path) == ("DELETE", "/api/v1/sessions/{session_id}")
        or (method != "GET" and path.endswith(("/devices/{device}", "/robot-port")))
        or (method == "PUT" and path.endswith("/table-mover"))  # who may stop it need not be who may arm it
    ):
        return "admin"
    if path.endswith(("/release", "/rollback", "/acknowledge")):
        return "release"
    # What comes with these is looked at and answered, nothing of it stored; auditors see whether results replay.
    answers = (
        "/pose-lines",
        "/controller-files",
        "/recognised-files",
        "/readings",
        "/read-back",
        "/replay",
        "/exports/{name}",
    )
    looks = method in ("GET", "WS") or path.startswith("/scenes/") or path.endswith(answers)
    return "read" if looks else "capture"


def _every_route_and_role(
    client: httpx.Client, session: str, tokens: dict[str, str], cookies: dict[str, dict[str, str]], every: bool
) -> Iterator[Trial]:
    nobody = {
        "no login": {},
        "an old cookie": {"Cookie": re.sub("=.*", "=" + "A" * 43, cookies["admin"]["Cookie"])},
        "another scheme": {"Authorization": "Basic YWRtaW46YWRtaW4="},
    }
    bad = {
        "a token made up": bearer(WRONG),
        "an empty token": {"Authorization": "Bearer"},
        "an expired token": bearer(tokens["expired"]),
        "a revoked token": bearer(tokens["revoked"]),
        "a token cut short": bearer(tokens["admin"][:-1]),
        "a token and more": bearer(tokens["admin"] + "A"),
        "another's secret": bearer(tokens["read"][:22] + tokens["admin"][22:]),
    }
    by_token = {f"role {role}, token": bearer(tokens[role]) for role in ROLES}
    by_cookie = {f"role {role}, cookie": cookies[role] for role in ROLES}
    for number, (method, template) in enumerate(every_route()):
        if method == "WS":
            continue
        least = role_that_should_do(method, template)
        for who, headers in _in_turn(nobody, number, every).items():
            yield _trial(
                client, "nobody × every route", who, method, template, session, headers, least != "nobody"
            )
        for who, headers in _in_turn(bad, number, every).items():
            yield _trial(client, "bad tokens × every route", who, method, template, session, headers, True)
        for who, headers in {**by_token, **_in_turn(by_cookie, number, every)}.items():
            role = who.split(",")[0].removeprefix("role ")
            ranks = ["nobody", *ROLES]
            may = ranks.index(role) >= ranks.index(least)
            if may and template.endswith("/logout"):
                continue  # it would end the login of the next
            yield _trial(client, "roles × every route", who, method, template, session, headers, not may)


def _in_turn(ways: dict[str, dict[str, str]], number: int, every: bool) -> dict[str, dict[str, str]]:
    """Return all ways, or the one whose turn it is."""
    return ways if every else dict([list(ways.items())[number % len(ways)]])


def _trial(
    client: httpx.Client,
    group: str,
    who: str,
    method: str,
    template: str,
    session: str,
    headers: dict[str, str],
    should: bool,
) -> Trial:
    # A request that will be let in must not change what the next one finds.
    there = should or method == "GET"
    values = {
        "session_id": session if there else "none",
        "session": session,
        "capture_id": "p01",
        "name": "p01.csv",
    }
    path = re.sub(r"\{(\w+)(:path)?\}", lambda m: values.get(m[1], "none"), template)
    with client.stream(method, site_of(client) + path, headers=headers) as answer:
        status = answer.status_code
        if not template.endswith("/events"):  # they never end
            answer.read()
    to_login = status == 303 and answer.headers.get("location", "").startswith("/login")
    return Trial(group, f"{who}: {method} {template}", should, status in (401, 403, 429) or to_login, str(status))


def _foreign_pages(client: httpx.Client, session: str, admin: dict[str, str], every: bool) -> Iterator[Trial]:
    """Another site's page in the browser of an admin who is logged in."""
    cookie = {"Cookie": admin["Cookie"]}
    ways = [
        *({"Origin": origin} for origin in FOREIGN),
        *({"Sec-Fetch-Site": f"{s}-site"} for s in ("cross", "same")),
        {},
    ]
    forged = {str(way): way for way in ways}
    for number, (method, template) in enumerate(every_route()):
        if method in ("GET", "WS"):
            continue
        for extra in _in_turn(forged, number, every).values():
            if not extra and role_that_should_do(method, template) == "nobody":
                continue  # logging in or out is nothing that a missing Origin could forge
            yield _trial(client, "forged Origin", str(extra), method, template, session, {**cookie, **extra}, True)


def _foreign_names(client: httpx.Client) -> Iterator[Trial]:
    """Names of others that were pointed at this machine."""
    for name in ("evil.example", "127.0.0.1.evil.example", "evil.example:80", "", "10.0.0.1"):
        for path in ("/", "/login", "/api/v1/health", "/web/app.js", "/scenes/x/"):
            status = client.get(site_of(client) + path, headers={"Host": name}).status_code
            yield Trial("foreign Host", f"{name} {path}", True, status == 403, str(status))


def _sockets(
    client: httpx.Client, session: str, tokens: dict[str, str], cookies: dict[str, dict[str, str]]
) -> Iterator[Trial]:
    own = site_of(client)
    old = re.sub("=.*", "=" + "A" * 43, cookies["read"]["Cookie"])
    stolen: dict[str, tuple[str | None, dict[str, str], bool]] = {
        "the address alone": (None, {}, True),
        "the address and an own page": (own, {}, True),
        "an old cookie": (own, {"Cookie": old}, True),
        "a token made up": (own, bearer(WRONG), True),
        "a revoked token": (own, bearer(tokens["revoked"]), True),
        "a cookie without a page": (None, {"Cookie": cookies["read"]["Cookie"]}, True),
        "a login": (own, {"Cookie": cookies["read"]["Cookie"]}, False),
        "a token": (own, bearer(tokens["read"]), False),
    }
    for origin in FOREIGN:
        stolen[f"a login, on a page of {origin}"] = (origin, {"Cookie": cookies["admin"]["Cookie"]}, True)
    for what, (origin, headers, should) in stolen.items():
        for path in (
            address.format(session=session, session_id=session, viewer="abcdefgh")
            for m, address in every_route()
            if m == "WS"
        ):
            try:
                with _open(client, path, origin, headers) as live:
                    if path.endswith("/preview"):
                        live.send("next")
                    refused, answer = len(live.recv(timeout=10)) == 0, "let in"
            except (InvalidHandshake, ConnectionClosed) as error:
                refused, answer = True, str(error)
            yield Trial("stolen scene address", f"{what}: {path}", should, refused, answer)


def _open(client: httpx.Client, path: str, origin: str | None, headers: dict[str, str]) -> ClientConnection:
    port = client.base_url.port or 80
    return connect(
        f"ws://127.0.0.1:{port}{path}",
        sock=socket.create_connection(("127.0.0.1", port)),
        origin=None if origin is None else Origin(origin),
        additional_headers={name: value for name, value in headers.items() if name != "Origin"},
        subprotocols=[PROTOCOL],
        max_size=None,
        proxy=None,
    )


def _share_requests(client: httpx.Client, session: str, admin: dict[str, str]) -> Iterator[Trial]:
    """What even an admin's page may not say to viser."""
    for kind in ("ShareUrlRequest", "ShareUrlDisconnect", "FileTransferStartUpload", "RunJavascriptMessage"):
        with _open(client, f"/scenes/{session}/", site_of(client), admin) as live:
            live.send(msgspec.msgpack.encode({"type": kind}))
            try:
                while True:
                    live.recv(timeout=10)
            except ConnectionClosed as closed:
                code = closed.rcvd.code if closed.rcvd else 0
            except TimeoutError:
                code = 0
        yield Trial("share request to viser", kind, True, code == 1008, str(code))
