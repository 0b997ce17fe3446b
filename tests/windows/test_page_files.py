"""The page's files where paths have backslashes and a registry says what a script is."""

import asyncio
import mimetypes
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from starlette.exceptions import HTTPException
from starlette.responses import Response

from calib_core import __version__
from server.http.page_files import PageFiles


@pytest.fixture
def files(tmp_path: Path) -> PageFiles:
    folder = tmp_path / "web"
    (folder / "elements" / "vendor").mkdir(parents=True)
    (folder / "index.html").write_text('<title>t</title><script src="/web/app.js"></script>', encoding="utf-8")
    (folder / "app.js").write_text("// a comment\nlet a = 1\n", encoding="utf-8")
    (folder / "elements" / "part.css").write_text("a { }\n", encoding="utf-8")
    (tmp_path / "secret.txt").write_text("mine", encoding="utf-8")
    return PageFiles(folder)


def answer(files: PageFiles, path: str) -> Response:
    scope: dict[str, Any] = {"type": "http", "method": "GET", "path": path, "headers": []}
    with ThreadPoolExecutor(1) as thread:  # the browser's tests leave a loop in this one
        return thread.submit(asyncio.run, files.get_response(path, scope)).result()


def mark(files: PageFiles) -> str:
    return bytes(files.document("index.html").body).decode().split("/web/")[1].split("/")[0]


def test_the_page_says_which_version_runs(files: PageFiles) -> None:
    assert f'<meta name="version" content="{__version__}">' in bytes(files.document("index.html").body).decode()


def test_the_page_says_when_the_data_folder_was_updated(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("<title></title>", encoding="utf-8")
    for when, told in ((None, ""), (datetime(2026, 11, 24, 8, 15, tzinfo=UTC), "2026-11-24T08:15:00+00:00")):
        body = bytes(PageFiles(tmp_path, lambda when=when: when).document("index.html").body).decode()
        assert f'<meta name="data-updated" content="{told}">' in body


@pytest.mark.parametrize("name", ["app.js", "elements\\part.css"])
def test_a_file_below_the_mark_is_found_by_a_path_of_windows(files: PageFiles, name: str) -> None:
    found = answer(files, f"{mark(files)}\\{name}")
    assert found.status_code == 200
    assert "immutable" in found.headers["cache-control"]
    assert b"comment" not in found.body


def test_a_plain_name_and_an_older_mark_are_found(files: PageFiles) -> None:
    for name in ("elements\\part.css", "~0123456789abcdef\\elements\\part.css"):
        assert "immutable" not in answer(files, name).headers.get("cache-control", "")


@pytest.mark.parametrize("name", ["..\\secret.txt", "~0\\..\\..\\secret.txt", "elements\\..\\..\\secret.txt"])
def test_no_path_of_windows_leads_out(files: PageFiles, name: str) -> None:
    with pytest.raises(HTTPException) as refused:
        answer(files, name)
    assert refused.value.status_code == 404


def test_the_registry_does_not_say_what_a_script_is(files: PageFiles, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mimetypes, "guess_type", lambda *_, **__: ("text/plain", None))
    for before in ("", mark(files) + "\\"):
        assert answer(files, f"{before}app.js").headers["content-type"].startswith("text/javascript")
        assert answer(files, f"{before}elements\\part.css").headers["content-type"].startswith("text/css")
