"""An auditor's hand in a session folder: what was done to it is told by its answer."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.server.wrong_releases import command
from tests.verified import verified_session, written


@pytest.fixture(scope="module")
def widened(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder whose verification failed, and passed once its limit was widened."""
    folder = written(verified_session(3, 1.0), tmp_path_factory.mktemp("audit") / "widened")
    record = json.loads((folder / "session.json").read_bytes())
    for limit_mm in (3.0, 5.0):
        record["cell"]["verification"]["tool_mm"] = limit_mm
        (folder / "session.json").write_text(json.dumps(record))
        assert command("run", str(folder), "--quiet")[0] == 0
    return folder


@pytest.fixture
def copied(widened: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(widened, tmp_path / "copied"))


def answered(folder: Path) -> dict[str, Any]:
    _, said = command("answer", str(folder), "--json")
    return json.loads(said[said.index("{") :])


def of(answer: dict[str, Any]) -> list[tuple[str, bool]]:
    return [(one["decision"], one.get("removed", False)) for one in answer["decided_before"]]


def test_decisions_that_were_removed_are_told_by_the_seal_of_the_last(copied: Path) -> None:
    assert of(answered(copied)) == [("fail", False), ("pass", False)]
    history = copied / "history.json"
    past = json.loads(history.read_bytes())
    history.write_text(
        json.dumps({**past, "results": past["results"][1:]})
    )  # an older one put back, or one cut out
    answer = answered(copied)
    assert of(answer) == [("fail", True), ("pass", False)]
    assert answer["decided_before"][0]["text"].endswith("was: failed. It was removed or changed since.")
    history.unlink()
    assert of(answered(copied)) == [("fail", True), ("pass", True)]
    for words in (("report", str(copied), "--out", "-"), ("export", str(copied), "--format", "json")):
        assert "It was removed or changed since." in command(*words)[1]
    # Nor are they forgotten by who goes on with what is left.
    record = json.loads((copied / "session.json").read_bytes())
    record["cell"]["verification"]["tool_mm"] = 6.0
    (copied / "session.json").write_text(json.dumps(record))
    command("run", str(copied), "--quiet")
    assert of(answered(copied)) == [("fail", True), ("pass", True), ("pass", False)]


def test_a_verification_of_another_session_decides_nothing(copied: Path, tmp_path: Path) -> None:
    other = written(verified_session(4), tmp_path / "other")
    shutil.copy(other / "results" / "verify.json", copied / "results" / "verify.json")
    answer = answered(copied)
    assert answer["decision"] == "undecided"


def test_a_date_that_was_set_back_is_told(copied: Path) -> None:
    file = copied / "results" / "tcp.json"
    file.write_text(json.dumps({**json.loads(file.read_bytes()), "solved": "2020-01-01T00:00:00.000Z"}))
    said = [one["text"] for one in answered(copied)["findings"]]
    assert "results/tcp.json is not what was signed." in said


@pytest.mark.parametrize("what", ["pose", "file"])
def test_a_pose_or_a_file_that_was_changed_after_the_decision_is_told(copied: Path, what: str) -> None:
    record = json.loads((copied / "session.json").read_bytes())
    last = record["captures"][-1]
    if what == "pose":
        last["pose"][0] += 0.1
        (copied / "session.json").write_text(json.dumps(record))
    else:
        with (copied / last["files"][0]).open("a") as file:
            file.write("\n")
    assert command("run", str(copied), "--quiet")[0] == 0
    *_, told = answered(copied)["decided_before"]
    assert (told["decision"], told["otherwise"]) == ("pass", True)
    assert "Then poses, files or the cell were changed" in told["text"]
