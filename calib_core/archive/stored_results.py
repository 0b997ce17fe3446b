"""Results that were stored: read as they are, and held against the records that they should be."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from calib_core.archive.folder import load_results
from calib_core.errors import InputError
from calib_core.graph.registry import STAGES
from calib_core.records import Result, input_error
from calib_core.records.plain_json import require_plain

TRUTH_FILE = "truth.json"


def result_record(stage: str) -> type[Result]:
    """Return the record of a stage's result; of a stage that is unknown here what all results share."""
    return STAGES.get(stage).result if stage in STAGES.names() else Result


def output_names(result: Mapping[str, Any]) -> list[str]:
    """Return the names of the files that a stage made beside a result, given as JSON data."""
    return [name for name in (result.get("cloud"), result.get("mesh")) if isinstance(name, str)]


def require_result(stage: str, data: Mapping[str, Any], where: str) -> None:
    """Refuse data that is not the result of a stage.

    Raises
    ------
    InputError
        With the field that is at fault.
    """
    require_plain(dict(data), where)
    if data.get("stage") != stage:
        got = repr(data.get("stage"))[:80]
        raise InputError("the result of the stage '{stage}'", got, "Solve the session again.", where, stage=stage)
    try:
        result_record(stage).model_validate(data)
    except ValidationError as error:
        raise input_error(error, data, where) from None


def stored_results(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the results in a session folder by stage, as JSON data; raises InputError where one is none."""
    results = load_results(folder)
    for stage, data in results.items():
        require_result(stage, data, str(folder / "results" / f"{stage}.json"))
    return results


def truth_of(folder: Path) -> dict[str, Any] | None:
    """Return the truth that lies beside a simulated session, None where there is none.

    Raises
    ------
    InputError
        If the file is no JSON object.
    """
    path = folder / TRUTH_FILE
    if not path.is_file():
        return None
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        to_do = "Remove the file, or simulate again."
        raise InputError("a truth as JSON", str(error), to_do, TRUTH_FILE) from None
    if not isinstance(data, dict):
        raise InputError("a JSON object", type(data).__name__, "Remove the file, or simulate again.", TRUTH_FILE)
    return data
