"""When a session folder's answer was solved: solvers know no clock, and an archive's files no time."""

from datetime import datetime
from pathlib import Path
from typing import Final

from calib_core.errors import InputError
from calib_core.moment import text_of, text_of_seconds
from calib_core.records import ResultsData
from calib_core.steps import table_stages, tool_stages

ANSWER_FILE: Final = "answer.json"
"""The name of a session's answer in an archive."""


def solved_when(folder: Path, results: ResultsData, *, unpacked: bool) -> str:
    """Return when the results in a folder were solved, as ISO 8601 text in UTC; "" where nobody knows.

    Parameters
    ----------
    folder : Path
    results : mapping
        Its results by stage, as JSON data.
    unpacked : bool
        Whether it was unpacked for this moment alone: then its files are as old as the unpacking.

    Notes
    -----
    The results tell it.  For those of earlier releases the archive's `answer.json` does, as long as it is of the
    same results; of another folder, the time when the newest of them was written.
    """
    solved = [results.get(stage, {}).get("solved") for stage in (*tool_stages(), *table_stages())]
    own = [str(date) for date in solved if date]
    if own:
        return own[0]
    told = _told(folder / ANSWER_FILE, results)
    if told or unpacked:
        return told
    files = [folder / "results" / f"{stage}.json" for stage in results]
    times_s = [file.stat().st_mtime for file in files if file.is_file()]
    if not times_s:
        return ""
    return text_of_seconds(max(times_s))


def _told(file: Path, results: ResultsData) -> str:
    """Return what an answer file says; "" where it is of others or tells no time. It may come from anywhere."""
    from calib_core.archive.folder import parse_json

    try:
        answer = parse_json(file.read_bytes(), str(file))
        of_these = all(results[stage]["inputs_sha256"] == own for stage, own in answer["inputs_sha256"].items())
        return text_of(datetime.fromisoformat(answer["solved"])) if of_these else ""
    except (OSError, InputError, KeyError, TypeError, AttributeError, ValueError, OverflowError):
        return ""
