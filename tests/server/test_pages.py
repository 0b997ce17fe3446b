"""The page, its files, and the documentation, which needs no internet."""

import re
from pathlib import Path

import httpx
import pytest

from server.http.page_files import PageFiles, without_comments
from tests.server.live_server import make_session


@pytest.fixture
def site(client: httpx.Client) -> str:
    return str(client.base_url).removesuffix("/api/v1/")


def test_the_page_is_served_for_the_start_and_for_a_session(client: httpx.Client, site: str) -> None:
    start = client.get(f"{site}/")
    assert start.status_code == 200
    assert start.headers["content-type"].startswith("text/html")
    assert client.get(f"{site}/sessions/{make_session(client)}").content == start.content


def test_files_are_checked_for_changes_at_each_use(client: httpx.Client, site: str) -> None:
    style = client.get(f"{site}/web/vendor/swagger-ui/swagger-ui.css")
    assert style.status_code == 200
    assert style.headers["cache-control"] == "no-cache"
    again = client.get(str(style.url), headers={"If-None-Match": style.headers["etag"]})
    assert again.status_code == 304


def test_files_by_the_mark_of_their_state_are_kept_for_good(client: httpx.Client, site: str) -> None:
    script = re.findall(r'src="(/web/~[^"]+\.js)"', client.get(f"{site}/").text)[0]
    by_mark = client.get(site + script)
    assert by_mark.headers["cache-control"] == "public, max-age=31536000, immutable"
    source = client.get(f"{site}/web/app.js")
    assert by_mark.headers["content-type"] == source.headers["content-type"]
    # The mark of another state, as a page has that stayed open over an update, gives the file as it is now.
    old = client.get(f"{site}/web/~0000000000000000/app.js")
    assert old.content == source.content
    assert old.headers["cache-control"] == "no-cache"
    for path in ("none.js", "../../server/app.py", "..%2f..%2fserver/app.py", ""):
        assert client.get(site + script.replace("app.js", path)).status_code == 404


def test_files_by_the_mark_have_no_comments_and_the_same_lines(client: httpx.Client, site: str) -> None:
    script = re.findall(r'src="(/web/~[^"]+/)app\.js"', client.get(f"{site}/").text)[0]
    source, kept = (client.get(f"{site}{folder}texts.js").text for folder in ("/web/", script))
    assert "@typedef" in source
    assert "@typedef" not in kept
    assert len(kept) < 0.75 * len(source)
    for line, as_kept in zip(source.split("\n"), kept.split("\n"), strict=True):
        assert as_kept in ("", re.sub(r"/\*\* @.*?\*/ ?", "", line).lstrip(" "))
    text = "a; // b\n  /** @type {X} */ #c = 1;\n  /**\n   * d\n   */\n  // e\nf('/* g */'); /* h */\n"
    assert without_comments(text) == "a; // b\n#c = 1;\n\n\n\n\nf('/* g */'); /* h */\n"


def test_a_page_asks_for_the_words_of_what_a_scene_shows(client: httpx.Client, site: str) -> None:
    asked = {"texts": ["next pose", "p03", "Too many for a page" * 10_000]}
    assert client.post(f"{site}/said/de", json=asked).status_code == 422
    asked["texts"].pop()
    assert client.post(f"{site}/said/de", json=asked).json() == {"next pose": "nächste Pose", "p03": "p03"}
    assert client.post(f"{site}/said/fr", json=asked).status_code == 422


def test_the_mark_changes_with_every_file(tmp_path: Path) -> None:
    for name in ("index.html", "a.js"):
        (tmp_path / name).write_text('<script src="/web/a.js">', encoding="utf-8")
    files = PageFiles(tmp_path)
    before = files.document("index.html").body
    assert files.document("index.html").body == before
    (tmp_path / "a.js").write_text("1", encoding="utf-8")
    changed = files.document("index.html").body
    (tmp_path / "b.js").write_text("1", encoding="utf-8")
    assert len({before, changed, files.document("index.html").body}) == 3


def test_the_documentation_loads_from_this_server_alone(client: httpx.Client, site: str) -> None:
    page = client.get(f"{site}/docs")
    assert page.status_code == 200
    assert "script-src 'self' 'unsafe-inline'" in page.headers["content-security-policy"]
    addresses = re.findall(r'(?:src|href)="([^"]+)"', page.text)
    assert addresses
    for address in addresses:
        assert address.startswith(("/", "data:")), address
        if address.startswith("/"):
            assert client.get(site + address).status_code == 200


@pytest.mark.thorough
def test_the_schema_has_tidy_names_and_examples(client: httpx.Client, site: str) -> None:
    schema = client.get(f"{site}/openapi.json").json()
    names = set(schema["components"]["schemas"])
    assert {"Capture", "CaptureUpload", "Measured", "Job", "Problem", "StoredSession", "StoredCapture"} <= names
    assert not [name for name in names if "__" in name or "-" in name or name.startswith("Body_")]
    assert any(path.startswith("/api/v1/") for path in schema["paths"])
    for path, operations in schema["paths"].items():
        if not path.startswith("/api/v1/"):
            continue
        for method, operation in operations.items():
            assert operation["summary"], (method, path)
            assert "application/problem+json" in operation["responses"]["default"]["content"]
            for content in operation.get("requestBody", {}).get("content", {}).values():
                text = str(_resolved(content["schema"], schema)) + str(content)
                assert "example" in text, f"{method} {path} has a body without an example"
            if method == "post" and not path.endswith(("/robot", "/plan", "/stop")):
                # A controller's line is its own key, a plan is only computed, and what stands is stopped again.
                assert any(p["name"] == "idempotency-key" for p in operation["parameters"]), path


def _resolved(part: dict[str, object], schema: dict[str, object]) -> object:
    name = str(part.get("$ref", "")).rsplit("/", 1)[-1]
    return schema["components"]["schemas"][name] if name else part  # type: ignore[index]
