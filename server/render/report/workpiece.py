"""What a report says of a result at the workpiece: how far off a point may lie, one row for each place."""

from collections.abc import Mapping
from typing import Any

from calib_core.exports.workpiece import at_workpiece
from calib_core.records import Session
from server.render.report.numbers import COVERAGE, number

_WORDS = {"tool": "Tool, in the scanner's view", "table": "Table, mount {}", "both": "Tool and table, mount {}"}


def workpiece_rows(session: Session, result: Mapping[str, Any]) -> list[list[str]]:
    """Return what is known by which frame, the point, and ± at k = 2 along x, y, z and in the worst direction.

    Raises
    ------
    InputError
        If a frame or a covariance of the result is none.
    """
    rows: list[list[str]] = []
    for row in at_workpiece(session, result):
        sigmas = [*row.sigmas_mm, row.worst_sigma_mm]
        place = ", ".join(number(value, 0) for value in row.point_mm)
        rows.append([_WORDS[row.of].format(row.where), place, *(number(COVERAGE * s, 3) for s in sigmas)])
    return rows
