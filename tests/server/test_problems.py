"""The catalogue of problems is whole: what the code can answer stands in it, and in the documentation."""

import re
import shutil
from pathlib import Path

import pytest
from kill_server import ServerProcess

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


@pytest.mark.thorough
def test_a_server_whose_files_were_updated_beneath_it_says_so(tmp_path: Path) -> None:
    for part in ("calib_core", "server", "web"):
        shutil.copytree(ROOT / part, tmp_path / part)
    program = {"PYTHONPATH": str(tmp_path), "PYTHONSAFEPATH": "1"}
    process = ServerProcess(tmp_path / "data", program).wait()
    try:
        with process.client() as client:
            (tmp_path / "calib_core" / "optics" / "board_print.py").write_text("", encoding="utf-8")
            for _ in range(2):
                answer = client.get("/board?kind=chessboard&columns=9&rows=6&pitch_mm=20")
                assert (answer.status_code, answer.json()["type"]) == (503, "urn:scancell:problem:unavailable")
                assert "was updated beneath this server. Restart the server" in answer.json()["detail"]
    finally:
        process.kill()
