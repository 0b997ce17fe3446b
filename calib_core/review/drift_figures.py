"""The figures of a session that drift is told of: where scanner and axis are, and what verifying found."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from calib_core.cell.found import as_used, placed_table, scanner_frame
from calib_core.frames import FloatArray, RigidTransform, skew, vector_from_rotation
from calib_core.review.between_sessions import Measured, SolvedSession
from calib_core.review.common_errors import common_of

_LEAST_SIGMA: Final = 1e-9


def tool_point(session: SolvedSession, answer: Mapping[str, Any], point: FloatArray) -> Measured:
    """Return where a point of L lies on the flange."""
    answer, tool = as_used(answer), scanner_frame(answer)
    rows = np.hstack([-tool.rotation @ skew(point), np.eye(3)])
    return _moved(session, answer, tool.apply(point), rows)


def turns(answers: Sequence[tuple[SolvedSession, Mapping[str, Any]]]) -> list[Measured]:
    """Return how each session's scanner is turned against the first one's, degrees about its axes."""
    tools = [scanner_frame(answer) for _, answer in answers]
    rows = np.hstack([np.eye(3), np.zeros((3, 3))]) * np.rad2deg(1)
    turned = [np.rad2deg(vector_from_rotation(tools[0].rotation.T @ tool.rotation)) for tool in tools]
    return [_moved(*one, value, rows) for one, value in zip(answers, turned, strict=True)]


def _moved(session: SolvedSession, answer: Mapping[str, Any], value: FloatArray, rows: FloatArray) -> Measured:
    """Return a figure that moves by `rows` (n, 6) with the scanner's pose."""
    covariance = np.array(answer["covariance"], dtype=float)
    scanner = common_of(answer, covariance, session.equipment)
    common = None if scanner is None else scanner.along(value, rows)
    return Measured(session, value, _regular(rows @ covariance @ rows.T), common)


Table = tuple[RigidTransform, FloatArray]


def table_of(session: SolvedSession) -> Table | None:
    """Return base_from_turntable and its covariance (6, 6), None without one that holds."""
    chain, table = session.of("chain"), session.of("turntable")
    found = chain or table
    if found is None or found.get("verdict") == "fail" or "base_from_turntable" not in found:
        return None
    found, frame = as_used(found), placed_table(found)
    covariance = found.get("turntable_covariance") if chain else found.get("covariance")
    if covariance is None:
        return None
    return frame, np.array(covariance, dtype=float)


def axes(
    tables: Sequence[tuple[SolvedSession, Table]],
    figure: Callable[[RigidTransform, FloatArray, RigidTransform], tuple[FloatArray, FloatArray]],
) -> list[Measured]:
    """Return a figure of each session's table, against the first one's."""
    return [
        Measured(session, *figure(frame, covariance, tables[0][1][0])) for session, (frame, covariance) in tables
    ]


def axis_point(
    frame: RigidTransform, covariance: FloatArray, first: RigidTransform
) -> tuple[FloatArray, FloatArray]:
    """Return where the axis passes the plane through the first one's origin, across it (2,)."""
    across = first.rotation[:, :2].T
    local = first.inverse().apply(frame.translation_mm)
    direction = first.rotation.T @ frame.rotation[:, 2]
    place = local[:2] - direction[:2] / direction[2] * local[2]
    follows = np.hstack([np.zeros((2, 3)), across])
    follows[:, :3] = across @ (-frame.rotation @ skew(np.array([0.0, 0.0, -local[2]])))
    return place, _regular(follows @ covariance @ follows.T)


def axis_direction(
    frame: RigidTransform, covariance: FloatArray, first: RigidTransform
) -> tuple[FloatArray, FloatArray]:
    """Return how the axis is tilted against the first one (2,), degrees."""
    across = first.rotation[:, :2].T
    follows = across @ (-frame.rotation @ skew(np.array([0.0, 0.0, 1.0])))
    degrees = float(np.rad2deg(1))
    spread = follows @ covariance[:3, :3] @ follows.T * degrees**2
    return np.rad2deg(across @ frame.rotation[:, 2]), _regular(spread)


def verified(session: SolvedSession) -> Measured | None:
    """Return the tool's error as a session's verification found it, None without one."""
    checks = (session.of("verify") or {}).get("checks") or []
    found = next((check for check in checks if check["name"] == "tool"), None)
    if found is None:
        return None
    sigma = max(float(found["uncertainty_mm"]) / 2, _LEAST_SIGMA)
    # Its captures are others than those of the answer: of its poses nothing is known here.
    alone = replace(session, program=None)
    return Measured(alone, np.array([float(found["value_mm"])]), np.array([[sigma**2]]))


def _regular(covariance: FloatArray) -> FloatArray:
    """Return a covariance that can be inverted."""
    return covariance + _LEAST_SIGMA**2 * np.eye(len(covariance))
