"""Dates of captures and results wherever a session goes, where the day is another one: how many are unchanged."""

from pathlib import Path
from tempfile import TemporaryDirectory

from harness import Row

from tests.server.dated_session import SOLVED, TAKEN, elsewhere, journey


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` changes nothing."""
    with TemporaryDirectory() as folder, elsewhere():
        found = journey(Path(folder))
    found.pop("report")
    goals = right = 0
    for dates in found.values():
        taken = [one == (TAKEN.format(minute=k), "device") for k, one in enumerate(dates["taken"].values())]
        solved = [one == SOLVED for one in (dates["solved"], *dates["results"].values())]
        goals += len(taken) + len(solved)
        right += sum(taken) + sum(solved)
    places = len(found)
    what = f"dates of captures, results in {places} places (folders, archives, imports, restored), time zone moved"
    return [Row(what, "unchanged", f"{right} of {goals}", right == goals and places >= 8)]
