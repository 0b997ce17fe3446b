"""Findings and refusals in the language that a request asks for, and with a cell's own severities."""

import re

import httpx
import pytest

from calib_core.findings import CODES
from server.http.language import preferred


@pytest.mark.parametrize(
    ("accepted", "language"),
    [
        ("", "en"),
        ("de-DE,de;q=0.9,en;q=0.8", "de"),
        ("fr,zh;q=0.4,de;q=0.3", "zh"),
        ("fr", "en"),
        ("de;q=0,*", "en"),
        ("de;q=x,zh;q=0.1", "zh"),
        (";;q=,,", "en"),
    ],
)
def test_the_language_that_a_request_prefers(accepted: str, language: str) -> None:
    assert preferred(accepted) == language


def test_every_code_has_its_page_and_an_unknown_one_is_refused_in_the_language(client: httpx.Client) -> None:
    listed = client.get("/findings")
    assert [one["code"] for one in listed.json()["items"]] == list(CODES)
    assert "Accept-Language" in listed.headers["vary"]
    assert client.get("/findings/stored-note").json()["severity"] == "note"
    refused = client.get("/findings/no-such", headers={"Accept-Language": "de"})
    assert refused.status_code == 404
    assert refused.json()["detail"].startswith("Benötigt: ein Code eines Befunds; vorhanden: 'no-such'.")


@pytest.mark.thorough
def test_results_have_findings_of_which_the_judgement_is_made(client: httpx.Client, solved: str) -> None:
    result = client.get(f"/sessions/{solved}/results/tcp").json()
    said = [f"{one['text']} {one['to_do']}".strip() for one in result["findings"]]
    assert said == result["warnings"] + result["notes"]
    assert said


def test_refusal_guide_check_result_and_answer_speak_german(client: httpx.Client, solved: str) -> None:
    german = {"Accept-Language": "de"}
    refused = client.post("/sessions", json={"name": 5}, headers=german).json()
    assert refused["need"] == "ein Text"
    assert "Benötigt: ein Text; vorhanden: 5. " in refused["detail"]
    english = re.compile(r"\b(the|of|and|is|are|with|its|not|from)\b")
    guide = client.get(f"/sessions/{solved}/guide", headers=german).json()
    for text in (guide["current"]["instruction"], guide["current"]["why"], guide["current"]["exit"]):
        assert not english.search(text), text
    found = client.get(f"/sessions/{solved}/check", headers=german).json()
    assert not [one["sentence"] for one in found["items"] if english.search(one["sentence"])]
    result = client.get(f"/sessions/{solved}/results/tcp", headers=german).json()
    labels = [block.get("label") or block.get("title") or "" for block in result["evidence"]]
    assert not [label for label in labels if english.search(label)]
    assert "said" not in result
    assert client.get(f"/sessions/{solved}/answer", headers=german).status_code == 200


def test_what_is_kept_in_one_language_is_not_taken_for_the_same_in_another(
    client: httpx.Client, solved: str
) -> None:
    """A release's number and a revision are the same in all languages; what is said of them is not."""
    client.post(f"/sessions/{solved}/release", json={"why": "set up"}).raise_for_status()
    cell = client.get(f"/sessions/{solved}/answer").json()["cell"]
    for path in (f"/cells/{cell}/answer", f"/sessions/{solved}/answer", f"/sessions/{solved}/captures/p03"):
        kept = client.get(path)
        headers = {"If-None-Match": kept.headers["ETag"]}
        assert client.get(path, headers=headers).status_code == 304
        german = client.get(path, headers={**headers, "Accept-Language": "de"})
        assert german.status_code == 200, path
        again = {"If-None-Match": german.headers["ETag"], "Accept-Language": "de"}
        assert client.get(path, headers=again).status_code == 304
        assert "Accept-Language" in german.headers["Vary"]
    changed = client.patch(path, json={"mount": "low"}, headers={"If-Match": german.headers["ETag"]})
    client.patch(path, json={"mount": None}).raise_for_status()  # others ask this session, too
    assert changed.status_code == 200, changed.text
