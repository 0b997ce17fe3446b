"""Rows of merged scans: mistakes beside right sessions, and an overlap's figures at either side of a limit."""

import re
from collections.abc import Iterable
from copy import deepcopy
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from calib_core.errors import MeasurementError
from calib_core.findings import Finding
from calib_core.formats.ply import ply_pieces
from calib_core.fusion.outward import Outward
from calib_core.fusion.overlap import Overlap
from calib_core.fusion.solve import Looked, MergeSolution
from calib_core.records import Session
from calib_core.stages.merge.calibration import calibration_of
from calib_core.stages.merge.doubts import merge_doubts
from calib_core.stages.merge.nominal import nominal_findings
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult
from tests.core.test_merge_mistakes import (
    Mistake,
    elsewhere,
    given,
    inverted,
    longer_steps,
    one_in_metres,
    reverse,
    rubble,
    swap,
)
from tests.every_code.made import CELL, Case, made, solved
from tests.shapes import bracket

OUTWARD = Outward(1, "visibility", True, 0.0, 9.0, 1.0, 0.0)


def as_it_is(record: dict[str, Any], files: dict[str, bytes]) -> None:
    """Change nothing."""


@cache
def _merged(mistake: Mistake, table: bool) -> list[Finding]:
    record, files = deepcopy(given(table))
    mistake(record, files)
    return list(solve_stage(Session.model_validate(record), "merge", files.__getitem__).findings)


def merged(mistake: Mistake = as_it_is, *, table: bool = False) -> Case:
    """Return what a merge says after a mistake."""
    return lambda: _merged(mistake, table)


def beside(mistake: Mistake, *, table: bool = False) -> tuple[Case, Case]:
    """Return what a merge says after a mistake, and without it."""
    return merged(mistake, table=table), merged(table=table)


def one_angle(record: dict[str, Any], files: dict[str, bytes]) -> None:
    """Tell one angle of all scans."""
    for capture in record["captures"]:
        capture["table_deg"] = 24.0


def told(**cell: Any) -> Mistake:
    """Return what tells more of the cell."""

    def change(record: dict[str, Any], files: dict[str, bytes]) -> None:
        for name, value in cell.items():
            record["cell"][name] = {**record["cell"].get(name, {}), **value}

    return change


def few(mesh: str, *, rows: bool) -> Mistake:
    """Return what leaves three scans for a mesh, with the rows of their grids or without."""

    def change(record: dict[str, Any], files: dict[str, bytes]) -> None:
        record["captures"] = record["captures"][:3]
        record["cell"]["merge"]["mesh"] = mesh
        for name, data in [] if rows else list(files.items()):
            files[name] = re.sub(rb"WIDTH (\d+)\nHEIGHT (\d+)", in_one_row, data, count=1)

    return change


def in_one_row(size: re.Match[bytes]) -> bytes:
    """Return the size of a grid as that of a list of points."""
    return b"WIDTH %d\nHEIGHT 1" % (int(size[1]) * int(size[2]))


def nominal(scale: float = 1.0, shift_mm: float | None = None) -> Mistake:
    """Return what tells a nominal that is so many times too large, or placed by a matrix so far off."""

    def change(record: dict[str, Any], files: dict[str, bytes]) -> None:
        part = bracket()
        files["nominal.ply"] = b"".join(map(bytes, ply_pieces(scale * part.points_mm, triangles=part.triangles)))
        record["cell"]["merge"]["reference"] = "nominal.ply"
        if shift_mm is not None:
            way = np.eye(4)
            way[:3, 3] = shift_mm
            record["cell"]["merge"]["alignment"] = {"method": "matrix", "base_from_reference": way.tolist()}

    return change


def overlap(pairs: tuple[int, ...] = (9, 9, 9, 9), rms: float = 1.0, one: float = 1.0, **outward: Any) -> Case:
    """Return what is doubted of four scans: their pairs, and times that they lie as far apart as expected."""
    names = tuple(f"s{k}" for k in range(len(pairs)))
    figures = np.array([[count, 0.0, 0.01, 0.01] for count in pairs])
    figures[0, 2] *= one
    none: Any = None
    apart = Overlap(0.01 * rms, 0.01, sum(pairs) // 2, 0, figures)
    looked = Looked(names, {}, none, apart, replace(OUTWARD, **outward), None, np.zeros((len(names), 3)))
    return lambda: merge_doubts(solution_of(looked), [])


def solution_of(looked: Looked) -> MergeSolution:
    """Return a merge of which nothing but this is known."""
    none: Any = None
    return MergeSolution(none, none, None, looked, 0.01, none, none, None, None, {}, "")


def failed(*names: str) -> Case:
    """Return what is said where scans are of no use."""

    def case() -> Iterable[Finding]:
        none: Any = None
        apart = Overlap(0.01, 0.01, 9, 0, np.array([[9, 0.0, 0.01, 0.01]] * 2))
        errors = {name: MeasurementError("points on a surface", "none", "Scan it again.") for name in names}
        looked = Looked(("a", "b"), errors, none, apart, OUTWARD, None, np.zeros((2, 3)))
        return merge_doubts(solution_of(looked), [])

    return case


def placed_by(verdict: str) -> Case:
    """Return what is said of scans that a tool of such a verdict places."""
    tool = solved("tcp", "tcp").model_copy(update={"verdict": verdict})
    return lambda: calibration_of(CELL.session.cell, [], tool).findings


def placed_of(scenario: str) -> Case:
    """Return what is said of scans that the tool of a simulated cell places."""

    def case() -> Iterable[Finding]:
        cell = made(scenario, 1)
        tool = solve_stage(cell.session, "tcp", cell.files.__getitem__)
        assert isinstance(tool, TcpResult)
        return calibration_of(cell.session.cell, [], tool).findings

    return case


NOMINAL = nominal()
CASES: dict[str, tuple[Case, Case]] = {
    "scan-of-no-use": (failed("c"), failed()),
    "merge-calibration-failed": (lambda: placed_by("fail")(), lambda: placed_by("warn")()),
    "merge-place-open": (placed_of("scara"), placed_of("tcp")),
    "merge-table-direction": beside(reverse, table=True),
    "merge-table-steps": beside(longer_steps, table=True),
    "merge-one-table-angle": beside(one_angle, table=True),
    "merge-swapped-scans": beside(swap, table=True),
    "merge-pose-reading": beside(inverted),
    "merge-scans-in-metres": beside(one_in_metres, table=True),
    "merge-scan-elsewhere": beside(elsewhere),
    "merge-scans-do-not-fit": beside(rubble),
    "merge-no-overlap": (overlap((0, 0, 0, 0)), overlap((1, 1, 0, 0))),
    "merge-scans-alone": (overlap((9, 9, 9, 0)), overlap((9, 9, 9, 1))),
    "merge-scans-apart": (overlap(rms=1.51), overlap(rms=1.49)),
    "merge-scans-far-off": (overlap(one=3.1), overlap(one=2.9)),
    "merge-inside-out": (
        overlap(how="told", contradicts=True, certain=False),
        overlap(how="told", contradicts=False),
    ),
    "merge-outside-doubtful": (overlap(how="volume", certain=False), overlap(how="volume")),
    "merge-pose-scatter": (
        merged(),
        merged(told(robot={"position_sigma_mm": 0.05, "orientation_sigma_deg": 0.01})),
    ),
    "merge-no-mesh": (merged(few("grid", rows=False)), merged(few("grid", rows=True))),
    "merge-no-self-calibration": beside(told(merge={"self_calibration": True})),
    "merge-nominal-not-found": (merged(nominal(0.001)), merged(NOMINAL)),
    "merge-nominal-alike": (lambda: nominal_findings(1, 0.9), lambda: nominal_findings(0, 0.9)),
    "merge-nominal-far": (merged(nominal(shift_mm=60.0)), merged(nominal(shift_mm=0.0))),
}
