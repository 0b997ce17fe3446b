"""Findings and refusals in the language that a request asks for, and with a cell's own severities."""

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


def test_results_have_findings_of_which_the_judgement_is_made(client: httpx.Client, solved: str) -> None:
    result = client.get(f"/sessions/{solved}/results/tcp").json()
    said = [f"{one['text']} {one['to_do']}".strip() for one in result["findings"]]
    assert said == result["warnings"] + result["notes"]
    assert said
