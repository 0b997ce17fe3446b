"""Forged results: every field of a stored record changed in turn is named, in a file and in a database's row."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from calib_core.archive.folder import load_results, to_json_bytes
from calib_core.archive.seals import with_provenance
from server.store.models import ResultRow

OF_READING = ("provenance", "stale")
"""Said of a result where it is read: nobody goes by what stands in the file."""


def leaves(data: Any) -> Iterator[tuple[Any, Any]]:
    """Give each place that holds a value: its container, and its name or index; of long lists, first and last."""
    names = (
        list(data) if isinstance(data, dict) else sorted({0, len(data) - 1}) if len(data) > 4 else range(len(data))
    )
    for name in names:
        value = data[name]
        if isinstance(value, dict | list) and value:
            yield from leaves(value)
        elif value is not None:
            yield data, name


def other(value: Any) -> Any:
    """A value that looks like another one: what a forger would write."""
    if isinstance(value, bool):
        return not value
    return value * 1.00001 + 1e-4 if isinstance(value, int | float) else f"{value}0"


def unnamed(record: dict[str, Any], proved: Any) -> list[str]:
    """The fields whose change is still taken for what was solved here; the record is as before afterwards."""
    found: list[str] = []
    for container, name in leaves({k: v for k, v in record.items() if k not in OF_READING}):
        place = record if name in record and container[name] is record.get(name) else container
        before = place[name]
        place[name] = other(before)
        if proved()["provenance"] != "imported":
            found.append(str(name))
        place[name] = before
    return found


@pytest.fixture
def result(solved_folder: Path) -> dict[str, Any]:
    return json.loads((solved_folder / "results" / "tcp.json").read_text())


def test_every_field_of_a_result_changed_in_turn_is_named(result: dict[str, Any]) -> None:
    assert with_provenance(result)["provenance"] == "solved"
    assert unnamed(result, lambda: with_provenance(result)) == []
    assert with_provenance(result)["provenance"] == "solved"
    assert sum(1 for _ in leaves(result)) > 250


def test_a_row_of_the_database_is_named_as_a_file_is(result: dict[str, Any]) -> None:
    row = ResultRow(session_id="s", stage="tcp", created=result["solved"], verdict="warn", record=result)
    assert row.proved()["provenance"] == "solved"
    for name, value in result.items():
        if name in OF_READING or not isinstance(value, str | int | float):
            continue
        forged = ResultRow(
            session_id="s", stage="tcp", created="", verdict="", record={**result, name: other(value)}
        )
        assert forged.proved()["provenance"] == "imported", name


def test_a_field_that_is_added_or_taken_away_is_named(result: dict[str, Any]) -> None:
    for name in [one for one in result if one not in OF_READING]:
        without = {key: value for key, value in result.items() if key != name}
        emptied = result[name] in (None, [], {}) or (name, result[name]) == ("method_revision", 1)
        assert (with_provenance(without)["provenance"] == "imported") is not emptied, name
    assert with_provenance({**result, "surface_rms_mm_2": 0.1})["provenance"] == "imported"


def test_a_result_of_another_stage_or_session_is_named(result: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "chain.json").write_bytes(to_json_bytes({**result, "stage": "chain"}))
    assert load_results(tmp_path)["chain"]["provenance"] == "imported"
    moved = {**result, "seal": {**result["seal"], "session": "0" * 64}}
    assert with_provenance(moved)["provenance"] == "imported"
