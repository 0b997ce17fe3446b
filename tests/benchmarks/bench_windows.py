"""Wheel, server, page and portable zip on a Windows Python: what `make test-windows` measures; under Wine no proof
of a real Windows.  WINDOWS_PYTHON names that Python's folder, WINDOWS_TESTS some of the tests (`-k` of pytest)."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from harness import Row

ROOT = Path(__file__).resolve().parents[2]


def run(full: bool) -> Iterator[Row]:
    """Run the tests and give what they measured; without `full` not the portable zip, which fetches its wheels."""
    yield _ways()
    if "WINDOWS_PYTHON" not in os.environ:
        yield Row("wheel, server and page on a Windows Python", "all work", "not tried: name WINDOWS_PYTHON")
        return
    files = sorted((ROOT / "tests" / "windows").glob("on_windows*.py"))
    files = [file for file in files if full or "portable" not in file.name]
    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder) / "told.xml"
        some = os.environ.get("WINDOWS_TESTS")
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-n",
            "0",
            "-o",
            "junit_family=xunit1",
            f"--junitxml={told}",
        ]
        command += [*map(str, files), *(("-k", some) if some else ())]
        subprocess.run(command, cwd=ROOT, stdout=sys.stderr, check=False)
        for case in ElementTree.parse(told).iter("testcase"):
            yield from _rows_of(case)


def _rows_of(case: ElementTree.Element) -> Iterator[Row]:
    if any(case.find(kind) is not None for kind in ("failure", "error")):
        yield Row(str(case.get("name")), "works", "does not", False)
        return
    for one in case.iter("property"):
        if one.get("name") == "figure":
            yield Row(*json.loads(str(one.get("value"))), True)


def _ways() -> Row:
    """Return how many ways of Windows' own have a test on Linux."""
    from tests.windows.ways import WAYS

    tests = {way[1:] for way in WAYS}
    measured = f"{len(WAYS)} ways in {len(tests)} tests"
    return Row("what is Windows' own, each a test on Linux", "≥ 40", measured, len(WAYS) >= 40)
