"""The error budget of a session's answer: at a point that is picked, and as a field over the table."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from calib_core.captures.poses import middle_pose
from calib_core.errors import ConflictError, InputError
from calib_core.guidance.budget import Budget, Calibrated, View, budget
from calib_core.records import Record, Session
from calib_core.stages.registry import steps_that_show, tool_stages

_MOST_VIEWS = 24
_RINGS, _AROUND, _LAYERS = 4, 8, 3
_LEAST_RADIUS_MM, _LEAST_HEIGHT_MM = 50.0, 50.0


class FieldPoint(Record):
    """± (k = 2) of one scan at a point of T, mm, and what any number of scans leaves."""

    point_mm: list[float]
    uncertainty_mm: float
    shared_uncertainty_mm: float


class BudgetAtPart(Budget):
    """A budget with the stage that it is of, and the field over the table where that was asked for."""

    stage: str
    stale: bool = False
    field: list[FieldPoint] | None = None


def budget_at(
    session: Session,
    results: Mapping[str, Mapping[str, Any]],
    point_mm: Sequence[float] | None = None,
    with_field: bool = False,
) -> BudgetAtPart:
    """Return the error budget of a session's answer.

    Parameters
    ----------
    session : Session
    results : mapping
        The stages' results as JSON data; those of `chain` or else `tcp` count.
    point_mm : (3,), optional
        In T at angle zero; without a table in L. Left out: the cell's, else where the sphere stood.
    with_field : bool
        With points all over the table.

    Raises
    ------
    ConflictError
        If neither is solved.
    InputError
        If the result's covariances are none, or no pose of its captures can be read.
    """
    stage = next((name for name in tool_stages() if name in results), None)
    if stage is None:
        raise ConflictError("a solved tcp or chain", "none", "Solve the session first.", "tcp")
    result, cell = results[stage], session.cell
    known = Calibrated.of(result, cell.workpiece_in_laser_mm)
    views = _views(session, result, known)
    if point_mm is None and known.base_from_turntable is not None:
        mounts = [mount["center_in_turntable_mm"] for mount in result["mounts"]]
        point_mm = cell.workpiece_in_turntable_mm or np.mean(mounts, axis=0).tolist()
    found = budget(known, views, point_mm)
    field = None
    if with_field and known.base_from_turntable is not None:
        field = [_at(known, views, point) for point in _grid(result)]
    data = found.model_dump() | {"stage": stage, "stale": bool(result.get("stale")), "field": field}
    return BudgetAtPart.model_validate(data)


def _at(known: Calibrated, views: Sequence[View], point: Sequence[float]) -> FieldPoint:
    found = budget(known, views, point)
    return FieldPoint(
        point_mm=list(point),
        uncertainty_mm=found.uncertainty_mm,
        shared_uncertainty_mm=found.shared_uncertainty_mm,
    )


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
            views.append(View(pose.rotation, float(np.deg2rad(capture.table_deg or 0.0))))
    if not views:
        to_do = "Give the captures their poses, and solve again."
        raise InputError("captures of the answer with poses that can be read", "none", to_do, str(result["stage"]))
    return views[:: max(1, len(views) // _MOST_VIEWS)]


def _grid(result: Mapping[str, Any]) -> list[list[float]]:
    """Return points over the table: as far out and as high as the sphere stood, and somewhat beyond."""
    places = np.array([mount["center_in_turntable_mm"] for mount in result["mounts"]], dtype=float)
    radius = max(1.25 * float(np.hypot(places[:, 0], places[:, 1]).max()), _LEAST_RADIUS_MM)
    low, high = float(places[:, 2].min()), float(places[:, 2].max())
    high = max(high, low + _LEAST_HEIGHT_MM)
    points: list[list[float]] = []
    for z in np.linspace(low, high, _LAYERS):
        points.append([0.0, 0.0, float(z)])
        for ring in np.linspace(0.0, radius, _RINGS + 1)[1:]:
            angles = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)
            points += [[float(ring * np.cos(a)), float(ring * np.sin(a)), float(z)] for a in angles]
    return points
