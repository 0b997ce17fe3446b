"""No name from outside reaches the file system: what requests say is watched for in all that is opened."""

import json
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx
import pytest

from tests.core.archives import tree
from tests.server.access import every_route, site_of
from tests.server.live_server import simulated_session, upload

MARK = "zz-hostile-name"
NAMES = (
    MARK,
    f"../../../../tmp/{MARK}",
    f"/tmp/{MARK}",
    f"..\\..\\{MARK}",
    f"C:\\{MARK}",
    f"file:///{MARK}",
    f"{MARK}\x00.csv",
    f"{MARK}/../../{MARK}",
    f"\\\\server\\share\\{MARK}",
    f"~/{MARK}",
    f"$HOME/{MARK}`id`",
    f"{MARK}:stream",
    f"{MARK}" * 100,
)
TOUCHING = ("open", "os.", "shutil.", "tempfile.", "sqlite3.connect", "subprocess.", "glob.", "pathlib.", "import")

_seen: list[tuple[str, str]] | None = None


def _watch(event: str, arguments: tuple[Any, ...]) -> None:
    if _seen is not None and event.startswith(TOUCHING):
        text = repr(arguments)
        if MARK in text:
            _seen.append((event, text))


sys.addaudithook(_watch)  # there is no way to take a hook off again; outside of `watching` it does nothing


@contextmanager
def watching() -> Iterator[list[tuple[str, str]]]:
    """Gather what this process, in which the server runs, opens or changes under a name of `NAMES`."""
    global _seen
    _seen = []
    try:
        yield _seen
    finally:
        _seen = None


def test_the_watch_sees_what_is_opened(tmp_path: Path) -> None:
    with watching() as seen:
        (tmp_path / MARK).write_bytes(b"")
        (tmp_path / MARK).unlink()
    assert [event for event, _ in seen] == ["open", "os.remove"]


@pytest.fixture
def session(client: httpx.Client) -> str:
    return simulated_session(client, captures=1)


@pytest.mark.thorough
def test_names_in_addresses(client: httpx.Client, session: str) -> None:
    asked = 0
    known = {"session_id": session, "session": session, "capture_id": "p01", "stage": "tcp"}
    with watching() as seen:
        for method, template in every_route():
            places = re.findall(r"\{(\w+)(?::path)?\}", template)
            if method == "WS" or template.endswith("/events"):
                continue
            for place in places:
                for name in NAMES:
                    values = {**known, place: name}
                    path = re.sub(
                        r"\{(\w+)(:path)?\}", lambda m, v=values: quote(v.get(m[1], "x"), safe=""), template
                    )
                    answer = client.request(method, httpx.URL(site_of(client), raw_path=path.encode()))
                    assert answer.status_code < 500, (method, path, answer.text)
                    assert "root:" not in answer.text[:2000]
                    asked += 1
    assert seen == []
    assert asked > 300


@pytest.mark.parametrize(
    "path",
    [
        "/web/../server/app.py",
        "/web/%2e%2e/server/app.py",
        "/web/..%2fserver%2fapp.py",
        "/web//etc/passwd",
        "/web/%2fetc%2fpasswd",
        "/web/..%5cserver%5capp.py",
        "/web/vendor/../../server/app.py",
        "/web/app.js%00",
        "/web/",
        "/web/vendor",
    ],
)
def test_the_pages_files_are_those_of_their_folder(client: httpx.Client, path: str) -> None:
    answer = client.get(httpx.URL(site_of(client), raw_path=path.encode()))
    assert answer.status_code == 404
    assert "import" not in answer.text


def test_names_in_headers_records_and_forms(client: httpx.Client, session: str) -> None:
    rows = b"x_mm,z_mm\n" + b"".join(b"%d,%d\n" % (x, 200 + x * x % 7) for x in range(40))
    pose = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    with watching() as seen:
        for number, name in enumerate(NAMES):
            printable = name.replace("\x00", "?")
            headers = dict.fromkeys(
                (
                    "Idempotency-Key",
                    "If-Match",
                    "Last-Event-ID",
                    "User-Agent",
                    "X-Forwarded-For",
                    "Referer",
                    "Range",
                ),
                printable[:200],
            )
            statuses = [client.get(f"/sessions/{session}/captures/p01", headers=headers).status_code]
            bodies: list[dict[str, Any]] = [
                {"name": name, "cell": {"pose_convention": "abb"}},
                {"name": "x", "simulated": {"scenario": name, "seed": 1}},
                {"name": "x", "cell": {"pose_convention": name}},
            ]
            statuses += [client.post("/sessions", json=body, headers=headers).status_code for body in bodies]
            capture = {"step": "tcp", "kind": "profile", "pose": pose}
            records: list[dict[str, Any]] = [
                {**capture, "id": f"h{number}", "files": [name]},
                {**capture, "id": name},
                {**capture, "id": f"g{number}", "step": name, "kind": name},
            ]
            statuses += [upload(client, session, record, rows).status_code for record in records]
            part = {"files": (printable, rows), "record": (None, json.dumps({**capture, "id": f"f{number}"}))}
            statuses.append(client.post(f"/sessions/{session}/captures", files=part).status_code)
            form = {"file": (printable, b"PK")}
            statuses.append(client.post("/archives", files=form).status_code)
            assert max(statuses) < 500
            assert 422 in statuses
        assert client.get(f"/sessions/{session}/archive").status_code in (200, 422)
        assert client.get(f"/sessions/{session}/report").status_code == 200
    assert seen == []


def test_beside_the_data_folder_nothing_changes(start: Any, tmp_path: Path) -> None:
    (tmp_path / "beside").write_text("untouched")
    with start() as client:
        session = simulated_session(client)
        record = {"step": "tcp", "kind": "profile", "pose": [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]}
        for number, name in enumerate(
            ("../beside", "../../beside", "captures/../../../beside", "blobs/../../beside")
        ):
            upload(client, session, {**record, "id": f"p{number}", "files": [name]}, b"x_mm,z_mm\n1,2\n")
        client.get(f"/sessions/{session}/archive")
        client.delete(f"/sessions/{session}")
    assert {name for name in tree(tmp_path) if not name.startswith("data/")} == {"beside"}
    assert (tmp_path / "beside").read_text() == "untouched"
