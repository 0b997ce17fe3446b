"""The error budget of a session's answer: at a point that is picked, and as a field over the table."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from calib_core.captures.poses import middle_pose
from calib_core.errors import ConflictError, InputError
from calib_core.guidance.budget import Budget, budget
from calib_core.guidance.calibrated import Calibrated, View
from calib_core.guidance.field import FieldPoint, field_over_table
from calib_core.messages import message
from calib_core.records import ResultsData, Session
from calib_core.steps import steps_that_show, table_stages, tool_stages

_MOST_VIEWS = 24
_THERMOMETERS_K = {"arm_c": 0.5, "air_c": 2.0}
"""One sigma of the arm's temperature: as it was taken on the arm, or else from that of the air."""
_ARM_PER_K = 23e-6
"""Of aluminium, of which most links are cast."""


class BudgetAtPart(Budget):
    """A budget with the stage that it is of, and the field over the table where that was asked for."""

    stage: str
    stale: bool = False
    field: list[FieldPoint] | None = None


def budget_at(
    session: Session, results: ResultsData, point_mm: Sequence[float] | None = None, with_field: bool = False
) -> BudgetAtPart:
    """Return the error budget of a session's answer.

    Parameters
    ----------
    session : Session
    results : mapping
        The stages' results as JSON data; those of `chain`, `tcp` or else `turntable` count.
    point_mm : (3,), optional
        In T at angle zero; without a table in L. Left out: the cell's, else where the sphere stood.
    with_field : bool
        With points all over the table.

    Raises
    ------
    ConflictError
        If none is solved.
    InputError
        If the result's covariances are none, or no pose of its captures can be read.
    """
    stage = next((name for name in (*tool_stages(), *table_stages()) if name in results), None)
    if stage is None:
        raise ConflictError("an answer", "none", "Solve the session first.", "results")
    result, cell = results[stage], session.cell
    known = _calibrated(session, result)
    views = _views(session, result, known)
    if point_mm is None and known.base_from_turntable is not None:
        mounts = [mount["center_in_turntable_mm"] for mount in result["mounts"]]
        point_mm = cell.workpiece_in_turntable_mm or np.mean(mounts, axis=0).tolist()
    found = budget(known, views, point_mm)
    field = None
    if with_field and known.base_from_turntable is not None:
        field = field_over_table(known, views, result)
    data = found.model_dump() | {"stage": stage, "stale": bool(result.get("stale")), "field": field}
    return BudgetAtPart.model_validate(data)


def field_of(session: Session, result: Mapping[str, Any]) -> list[FieldPoint]:
    """Return the field over the table of a chain's result, JSON data; raises InputError as `budget_at`."""
    known = _calibrated(session, result)
    return field_over_table(known, _views(session, result, known), result)


def _calibrated(session: Session, result: Mapping[str, Any]) -> Calibrated:
    """Return what was calibrated, with how far the arm's length is known for the temperatures that were told."""
    used = {row["capture"] for row in result["residuals"] if row.get("used")}
    own = [one.environment for one in session.captures if one.id in used]
    known = Calibrated.of(result, session.cell.workpiece_in_laser_mm)
    for name, thermometer_k in _THERMOMETERS_K.items():
        of_session = getattr(session.environment, name, None)
        told = [getattr(one, name, None) for one in own]
        found = [of_session if value is None else value for value in told]
        warm = [value for value in found if value is not None]
        if warm:
            return replace(known, arm_growth=_ARM_PER_K * float(np.hypot(thermometer_k, np.std(warm))))
    return known


def _views(session: Session, result: Mapping[str, Any], known: Calibrated) -> list[View]:
    """Return how the flange and the table stood in the captures: scans are taken from there too."""
    on_table = known.base_from_turntable is not None
    used = {row["capture"] for row in result["residuals"] if row.get("used")}
    steps = steps_that_show("sphere-on-table" if on_table else "sphere")
    views: list[View] = []
    for capture in session.captures:
        if capture.id in used and capture.step in steps:
            try:
                pose = middle_pose(session.cell, capture)
            except InputError:
                continue  # changed since; the stage says so when it is solved again
            angle = float(np.deg2rad(capture.table_deg or 0.0))
            views.append(View(pose.rotation, angle, place_mm=pose.translation_mm))
    if not views:
        to_do = message("Give the captures their poses, and solve again.")
        raise InputError("captures of the answer with poses that can be read", "none", to_do, str(result["stage"]))
    return views[:: max(1, len(views) // _MOST_VIEWS)]
