"""Paths with backslashes, drives and devices at every route that takes one: nothing is there, none leads out."""

import re

import httpx
import pytest

from tests.server.conftest import shared_client  # noqa: F401 (fixture)
from tests.server.live_server import make_session, upload

ODD = [
    "..%5C..%5Cscancell.db",
    "C:%5Cscancell.db",
    "%5C%5Cserver%5Cshare%5Cfile",
    "..%2F..%5Cscancell.db",
    "nul",
    "a.csv:x",
]
ROUTES = [
    "/web/{name}",
    "/web/~0123456789abcdef/{name}",
    "/api/v1/sessions/{session}/captures/p1/files/{name}",
    "/scenes/{name}/",
]
"""Beside those that the server's own description has."""


@pytest.fixture(scope="module")
def session(shared_client: httpx.Client) -> str:  # noqa: F811
    made = make_session(shared_client)
    record = {"id": "p1", "step": "tcp", "kind": "profile", "pose": [0, 0, 0, 0, 0, 0], "files": ["p1.csv"]}
    points = b"x_mm,z_mm\n" + b"".join(b"%d,%d\n" % (x, 200 + x * x // 40) for x in range(-15, 16))
    assert upload(shared_client, made, record, points).status_code == 201
    return made


def test_nothing_is_found_by_a_path_of_windows(
    shared_client: httpx.Client,  # noqa: F811
    session: str,
) -> None:
    site = str(shared_client.base_url).removesuffix("/api/v1/")
    paths = shared_client.get(f"{site}/openapi.json").json()["paths"]
    with_name = [path for path, ways in paths.items() if "get" in ways and path.endswith("}")]
    routes = [re.sub(r"\{\w+\}$", "{name}", path).replace("{session_id}", "{session}") for path in with_name]
    routes = [route.replace("{stage}", "tcp").replace("{capture_id}", "p1") for route in routes]
    assert {"/api/v1/sessions/{session}/kept/{name}", "/api/v1/sessions/{session}/exports/{name}"} <= {*routes}
    for route in [*routes, *ROUTES]:
        for name in ODD:
            answer = shared_client.get(f"{site}{route.format(name=name, session=session)}")
            assert answer.status_code in (400, 404, 405, 409, 422), (route, name, answer.status_code)
            assert b"SQLite format" not in answer.content


@pytest.mark.parametrize(
    "name", ["..\\..\\p2.csv", "C:\\p2.csv", "captures\\p2.csv", "\\\\server\\share\\p2.csv", "a:b"]
)
def test_a_record_names_no_file_by_a_path_of_windows(
    shared_client: httpx.Client,  # noqa: F811
    session: str,
    name: str,
) -> None:
    record = {"id": "p2", "step": "tcp", "kind": "profile", "pose": [0, 0, 0, 0, 0, 0], "files": [name]}
    answer = upload(shared_client, session, record, b"0,200\n1,200\n2,201\n")
    assert answer.status_code in (400, 422), answer.text
    assert "inside the session folder" in answer.json()["detail"]
