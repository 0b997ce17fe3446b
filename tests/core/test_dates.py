"""When an answer was solved: by the archive's own word where it is one, else by the results' files."""

import json
import os
from pathlib import Path
from typing import Any

import pytest

from calib_core.archive.dates import solved_when

RESULTS = {"tcp": {"inputs_sha256": "0f"}}
TOLD = {"inputs_sha256": {"tcp": "0f"}, "solved": "2026-10-01T12:00:00.000+02:00"}


@pytest.mark.parametrize(
    ("answer", "solved"),
    [
        (TOLD, "2026-10-01T10:00:00.000Z"),
        ({**TOLD, "inputs_sha256": {"tcp": "1e"}}, ""),
        ({**TOLD, "inputs_sha256": {"chain": "0f"}}, ""),
        ({**TOLD, "inputs_sha256": "0f"}, ""),
        ({**TOLD, "solved": "\nHALT"}, ""),
        ({**TOLD, "solved": 3}, ""),
        ({**TOLD, "solved": None}, ""),
        ([], ""),
    ],
)
def test_an_archive_tells_when_and_nothing_else(tmp_path: Path, answer: Any, solved: str) -> None:
    (tmp_path / "answer.json").write_text(json.dumps(answer))
    assert solved_when(tmp_path, RESULTS, unpacked=True) == solved


def test_a_folder_without_an_answer_file_tells_by_its_newest_result(tmp_path: Path) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "tcp.json").write_text("{}")
    os.utime(tmp_path / "results" / "tcp.json", (1_700_000_000, 1_700_000_000))
    assert solved_when(tmp_path, RESULTS, unpacked=False) == "2023-11-14T22:13:20.000Z"
    assert solved_when(tmp_path, RESULTS, unpacked=True) == ""
