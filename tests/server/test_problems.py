"""The catalogue of problems is whole: what the code can answer stands in it, and in the documentation."""

import re
from pathlib import Path

import server.app  # noqa: F401 (brings every error with it)
from server.http.errors import catalogue

ROOT = Path(__file__).resolve().parents[2]


def test_every_type_is_documented() -> None:
    text = (ROOT / "docs" / "rest.md").read_text(encoding="utf-8")
    documented = text.split("## Problems")[1].split("## Following")[0]
    assert [name for name in catalogue() if f"`{name}`" not in documented] == []
    assert len(catalogue()) >= 20


def test_every_status_in_the_code_is_in_the_catalogue() -> None:
    code = "\n".join(file.read_text(encoding="utf-8") for file in (ROOT / "server").rglob("*.py"))
    statuses = {int(number) for number in re.findall(r"(?:problem_of_status|HTTPException)\(\s*(\d{3})", code)}
    assert {400, 408, 413, 500, 503, 504, 507} <= statuses
    assert [status for status in statuses if f"http-{status}" not in catalogue()] == []
