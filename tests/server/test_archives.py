"""Archives over REST: out and in again, and refused with nothing left behind."""

import io
import json
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import httpx
import pytest

from calib_core.archive.archive import verify
from server.render.pdf import browser
from tests.core.archives import changed, entries_of, resealed, with_entry, without, zipped
from tests.server.live_server import assert_problem, make_session, simulated_session, upload, wait_for

ZIP = {"Content-Type": "application/zip"}


@pytest.fixture(scope="module")
def solved(shared_client: httpx.Client) -> str:
    session = simulated_session(shared_client, captures=14)
    shared_client.patch(f"/sessions/{session}", json={"name": "Zelle 4 – früh"})
    job = shared_client.post(f"/sessions/{session}/solve/tcp").json()
    assert wait_for(shared_client, job["id"])["status"] == "done"
    return session


@pytest.fixture(scope="module")
def archive(shared_client: httpx.Client, solved: str) -> bytes:
    return shared_client.get(f"/sessions/{solved}/archive", params={"scene": False}).content


def payload_of(archive: bytes) -> dict[str, bytes]:
    """Return the files of a session's archive by their names in the session folder."""
    entries = [(info.filename.partition("/data/")[2], content) for info, content in entries_of(archive)]
    return {name: content for name, content in entries if name}


def session_ids(client: httpx.Client) -> list[str]:
    return [item["id"] for item in client.get("/sessions", params={"limit": 1000}).json()["items"]]


@pytest.mark.thorough
def test_an_archive_holds_all_that_the_contract_names(client: httpx.Client, solved: str) -> None:
    answer = client.get(f"/sessions/{solved}/archive")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "application/zip"
    assert answer.headers["content-disposition"] == 'attachment; filename="zelle-4-fr-h.zip"'
    assert int(answer.headers["content-length"]) == len(answer.content)
    facts = verify(io.BytesIO(answer.content), "answer")
    assert (facts.session, facts.captures) == ("Zelle 4 – früh", 14)
    assert facts.results["tcp"] in ("pass", "warn")
    assert facts.scene
    assert facts.report
    again = client.get(f"/sessions/{solved}/archive")
    assert again.content == answer.content


def test_import_brings_everything_back(client: httpx.Client, solved: str, archive: bytes) -> None:
    made = client.post("/archives", content=archive, headers=ZIP)
    assert made.status_code == 201, made.text
    new = made.json()["id"]
    assert new != solved
    ours, theirs = (client.get(f"/sessions/{s}").json() for s in (new, solved))
    for name in ("name", "cell", "captures", "format"):
        assert ours.get(name) == theirs.get(name)
    for path in ("captures", "results"):
        assert client.get(f"/sessions/{new}/{path}").json() == client.get(f"/sessions/{solved}/{path}").json()
    assert client.get(f"/sessions/{new}/results/tcp").json()["stale"] is False
    file = client.get(f"/sessions/{new}/captures/p01/files/p01.csv")
    assert file.content == client.get(f"/sessions/{solved}/captures/p01/files/p01.csv").content
    again = client.get(f"/sessions/{new}/archive", params={"scene": False})
    assert again.content == archive


def test_import_keeps_all_that_the_archive_held(client: httpx.Client, solved: str) -> None:
    whole = client.get(f"/sessions/{solved}/archive").content
    base = entries_of(whole)[0][0].filename.split("/")[0]
    for name, content in (("truth.json", b'{"tool0_from_laser": 1}'), ("notes/día 1.txt", b"windy")):
        whole = with_entry(whole, f"{base}/data/{name}", content)
    made = client.post("/archives", content=whole, headers=ZIP)
    assert made.status_code == 201, made.text
    new = f"/sessions/{made.json()['id']}"
    held = payload_of(whole)
    listed = client.get(f"{new}/kept").json()["items"]
    names = ["answer.json", "notes/día 1.txt", "report.html", "scene.html", "truth.json"]
    assert [item["name"] for item in listed] == names
    for item in listed:
        answer = client.get(f"{new}/kept/{item['name']}")
        assert answer.content == held[item["name"]]
        assert len(answer.content) == item["bytes"]
        # Whatever stands in it has neither this server's login nor its addresses.
        assert answer.headers["content-security-policy"].startswith("sandbox")
        assert "allow-same-origin" not in answer.headers["content-security-policy"]
        assert answer.headers["content-disposition"].startswith("attachment")
    assert_problem(client.get(f"{new}/kept/other.txt"), 404, "truth.json")
    assert_problem(client.get(f"{new}/kept/scene.html", params={"show": True}), 422, "report.html")
    shown = client.get(f"{new}/kept/report.html", params={"show": True})
    assert "<iframe sandbox " in shown.text
    assert "script-src" not in shown.headers["content-security-policy"]
    assert client.get(f"/sessions/{solved}/kept").json() == {"items": []}
    assert client.get(f"{new}/clouds").json() == {"items": []}  # none of them is a stage's
    assert payload_of(client.get(f"{new}/archive").content) == held
    assert client.delete(new).status_code == 204


def test_import_as_a_form_and_only_once_for_a_key(client: httpx.Client, archive: bytes) -> None:
    key = {"Idempotency-Key": "import-1"}
    first = client.post("/archives", files={"file": ("a.zip", archive)}, headers=key)
    assert first.status_code == 201, first.text
    second = client.post("/archives", content=archive, headers={**ZIP, **key})
    assert second.headers["Idempotency-Replayed"] == "true"
    assert second.json() == first.json()
    assert_problem(client.post("/archives", content=archive + b"x", headers={**ZIP, **key}), 409)


def test_verify_says_what_is_in_it_and_stores_nothing(client: httpx.Client, archive: bytes) -> None:
    before = session_ids(client)
    answer = client.post("/archives/verify", content=archive, headers=ZIP)
    assert answer.status_code == 200, answer.text
    assert answer.json()["captures"] == 14
    assert client.post("/archives/verify", files={"file": ("a.zip", archive)}).json() == answer.json()
    assert session_ids(client) == before


@cache
def hostile(archive: bytes) -> dict[str, tuple[bytes, list[str]]]:
    """Return archives that must be refused, each with words of the reason."""
    entries = entries_of(archive)
    base = entries[0][0].filename.split("/")[0]
    return {
        "nothing": (b"", ["an empty file"]),
        "no zip": (b"hello" * 9, ["something else"]),
        "truncated": (archive[:-100], ["cut off"]),
        "half": (archive[: len(archive) // 2], ["cut off"]),
        "not a bag": (zipped([(zipfile.ZipInfo("a.txt"), b"x")]), ["a bag"]),
        "altered": (changed(archive, "p01.csv", lambda c: c + b"\n", seal=False), ["p01.csv", "altered"]),
        "missing": (without(archive, "p01.csv"), ["p01.csv", "missing"]),
        "missing and sealed": (without(archive, "p01.csv", seal=True), ["p01.csv", "none"]),
        "extra": (zipped([*entries, (zipfile.ZipInfo(f"{base}/data/x"), b"")]), ["data/x", "beside"]),
        "slip": (with_entry(archive, f"{base}/data/../../../evil"), ["another folder"]),
        "absolute": (with_entry(archive, "/etc/evil"), ["absolute"]),
        "link": (with_entry(archive, f"{base}/data/l", b"/etc/passwd", 0o120777 << 16), ["a link"]),
        "twice": (with_entry(archive, f"{base}/data/session.json"), ["twice"]),
        "case": (with_entry(archive, f"{base}/data/Session.json"), ["Session.json"]),
        "folder case": (with_entry(archive, f"{base}/data/CAPTURES/x"), ["the folders"]),
        "unicode": (
            with_entry(with_entry(archive, f"{base}/data/caf\u00e9"), f"{base}/data/cafe\u0301"),
            ["Unicode form"],
        ),
        "file and folder": (with_entry(archive, f"{base}/data/captures"), ["as both"]),
        "backslash": (with_entry(archive, f"{base}/data/x\\..\\evil"), ["backslash"]),
        "drive": (with_entry(archive, f"{base}/data/C:/evil"), ["colon"]),
        "device": (with_entry(archive, f"{base}/data/d", b"", 0o020666 << 16), ["a device"]),
        "pipe": (with_entry(archive, f"{base}/data/d", b"", 0o010666 << 16), ["a pipe"]),
        "wrong hash": (changed(archive, "/manifest-sha256.txt", wrong_digest, seal=False), ["the manifest gives"]),
        "wrong hash, sealed": (wrongly_sealed(archive), ["altered"]),
        "must be fetched": (with_entry(archive, f"{base}/fetch.txt", b"http://a/ 1 data/x\n"), ["fetch.txt"]),
        "bomb": (with_entry(archive, f"{base}/data/bomb", b"\0" * 30_000_000), ["a bomb"]),
        "pose": (changed(archive, "session.json", lambda c: c.replace(b'"abb"', b'"ur"')), ["pose"]),
        "result": (changed(archive, "tcp.json", lambda c: c.replace(b'"verdict"', b'"verdikt"')), ["verdict"]),
        "result of nothing": (
            with_entry(archive, f"{base}/data/results/walk.json", result_of("walk")),
            ["stages", "walk"],
        ),
        "not finite": (changed(archive, "tcp.json", first_number_beyond), ["finite"]),
        "long name": (changed(archive, "session.json", lambda c: c.replace(b"Zelle", b"Z" * 600)), ["500"]),
    }


def wrong_digest(manifest: bytes) -> bytes:
    return b"0" * 64 + manifest[64:]


def wrongly_sealed(archive: bytes) -> bytes:
    """Return an archive whose manifest has a wrong digest, and whose manifest of manifests agrees with that."""
    entries = [(i, c) for i, c in entries_of(archive) if "tagmanifest" not in i.filename]
    return zipped([(i, wrong_digest(c) if "/manifest-sha256" in i.filename else c) for i, c in entries])


def result_of(stage: str) -> bytes:
    record: dict[str, Any] = {"stage": stage, "method": "m", "software": "s", "inputs_sha256": "0"}
    return json.dumps({**record, "verdict": "pass", "residuals": []}).encode()


def first_number_beyond(content: bytes) -> bytes:
    data = json.loads(content)
    data["beyond"] = 1e308 * 10
    return json.dumps(data).encode()


@pytest.mark.thorough
@pytest.mark.parametrize("kind", sorted(hostile(resealed([(zipfile.ZipInfo("b/bagit.txt"), b"")]))))
def test_what_must_be_refused_is_refused_with_its_reason_and_leaves_nothing(
    client: httpx.Client, archive: bytes, kind: str
) -> None:
    content, words = hostile(archive)[kind]
    before = session_ids(client)
    for path in ("/archives", "/archives/verify"):
        answer = client.post(path, content=content, headers=ZIP)
        if path == "/archives/verify" and kind in ("pose", "result of nothing", "long name"):
            assert answer.status_code == 200, answer.text  # whole as an archive, of no use to this server
            continue
        assert_problem(answer, 413 if kind == "bomb" else 422, *words)
    assert session_ids(client) == before


@pytest.mark.thorough
def test_a_refused_archive_leaves_no_file_in_the_data_folder(start: Any, tmp_path: Path, archive: bytes) -> None:
    with start() as client:
        before = sorted(p.name for p in (tmp_path / "data").rglob("*"))
        for content, _ in hostile(archive).values():
            assert client.post("/archives", content=content, headers=ZIP).status_code in (413, 422)
        assert sorted(p.name for p in (tmp_path / "data").rglob("*")) == before
        assert client.post("/archives", content=archive, headers=ZIP).status_code == 201
    with start() as client:
        (session,) = session_ids(client)
        assert client.get(f"/sessions/{session}/archive", params={"scene": False}).content == archive


def test_a_form_without_a_file_and_too_large_an_archive(start: Any, client: httpx.Client, archive: bytes) -> None:
    form = client.post("/archives", files={"other": (None, "text")})
    assert_problem(form, 422, "without a file")
    with start(max_archive_bytes=10_000, max_upload_bytes=1000) as small:
        assert small.post("/archives/verify", content=archive, headers=ZIP).status_code == 413
        chunked = small.post("/archives/verify", content=iter([archive[:9000], archive[9000:]]), headers=ZIP)
        assert chunked.status_code == 413
        assert small.post("/archives/verify", content=b"x" * 5000, headers=ZIP).status_code == 422


def test_an_unsolved_session_has_an_archive_and_a_report(client: httpx.Client) -> None:
    session = make_session(client)
    facts = verify(io.BytesIO(client.get(f"/sessions/{session}/archive").content), "answer")
    assert (facts.captures, facts.results) == (0, {})
    assert "Nothing is solved yet" in client.get(f"/sessions/{session}/report").text
    assert_problem(client.get("/sessions/none/archive"), 404)
    assert_problem(client.get("/sessions/none/report"), 404)


@pytest.mark.thorough
def test_a_report_is_printed_as_pdf_or_says_why_not(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    address = f"/sessions/{make_session(client)}/report"
    both = client.get(address, headers={"Accept": "text/html,application/pdf"})
    assert both.headers["content-type"].startswith("text/html")
    assert "accept" in both.headers["vary"].lower()
    asked = [({}, {"Accept": "application/pdf"}), ({"format": "pdf"}, {})]
    for query, headers in asked[: 1 if browser() else 0]:
        printed = client.get(address, params=query, headers=headers)
        assert printed.headers["content-type"] == "application/pdf"
        assert printed.content.startswith(b"%PDF-")
    monkeypatch.setattr("server.render.pdf.browser", lambda: None)
    for query, headers in asked:
        told = assert_problem(client.get(address, params=query, headers=headers), 422)
        assert "Get the report as HTML" in told["to_do"]
    assert_problem(client.get(address, params={"format": "doc"}), 422)


def test_two_files_that_would_be_one_in_a_folder_are_told(client: httpx.Client) -> None:
    session = make_session(client)
    for number, name in enumerate(["captures/p.csv", "./captures/p.csv"]):
        record = {
            "id": f"p{number}",
            "step": "tcp",
            "kind": "profile",
            "files": [name],
            "pose": [0, 0, 0, 0, 0, 0],
        }
        rows = "".join(f"{x},{200 + number}\n" for x in range(50))
        made = upload(client, session, record, rows.encode())
        assert made.status_code == 201, made.text
    assert_problem(client.get(f"/sessions/{session}/archive"), 409, "captures/p.csv")


@pytest.mark.thorough
def test_the_report_is_a_page_that_runs_nothing(client: httpx.Client, solved: str) -> None:
    answer = client.get(f"/sessions/{solved}/report")
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert "Zelle 4 – früh" in answer.text
    assert "<script" not in answer.text
    client.patch(f"/sessions/{solved}/captures/p01", json={"excluded": True})
    assert "Out of date" in client.get(f"/sessions/{solved}/report").text
    client.patch(f"/sessions/{solved}/captures/p01", json={"excluded": False})
    assert "Out of date" not in client.get(f"/sessions/{solved}/report").text
