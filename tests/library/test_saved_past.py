"""A session that was loaded and is saved elsewhere keeps what was decided before, and what lies beside it."""

import json
from pathlib import Path
from typing import Any

import pytest

import calib_core as cc
from calib_core.archive.folder import past_of
from calib_core.records import Session
from server.cli import main
from tests.verified import verified_session, written


def decided_before(folder: Path, capsys: pytest.CaptureFixture[str]) -> list[str]:
    capsys.readouterr()
    main(["answer", str(folder), "--json"])
    said = capsys.readouterr().out
    return [one["decision"] for one in json.loads(said[said.index("{") :])["decided_before"]]


def solved_verification(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "results" / "verify.json").read_bytes())


def test_a_limit_widened_by_the_library_is_told_in_every_folder_and_archive_it_goes_to(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = written(verified_session(3, 1.0), tmp_path / "first")
    (folder / "certificates").mkdir()
    (folder / "certificates" / "ball.pdf").write_bytes(b"%PDF-1.7")
    (folder / "report.html").write_text("of the results before")
    loaded = cc.load(folder)
    record = loaded.record.to_json()
    record["cell"]["verification"]["tool_mm"] = 5.0
    loaded.record = Session.model_validate(record)
    assert loaded.run("verify")["verify"].decision == "pass"
    second = loaded.save(tmp_path / "second")
    assert decided_before(second, capsys) == ["fail"]
    assert (second / "certificates" / "ball.pdf").read_bytes() == b"%PDF-1.7"
    assert not (second / "report.html").exists()
    assert cc.load(folder).save(tmp_path / "same") == tmp_path / "same"
    assert solved_verification(tmp_path / "same") == solved_verification(folder)  # its seal, too
    # As often as it goes on: nothing is lost, nothing told twice.
    cc.load(second).pack(tmp_path / "second.zip")
    third = cc.load(tmp_path / "second.zip").save(tmp_path / "third")
    assert decided_before(third, capsys) == ["fail"]
    loaded.save(second)
    assert past_of(second) == past_of(third)
    assert len(past_of(third)["results"]) == 1
