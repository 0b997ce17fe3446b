"""Repeatability and accuracy of poses, as ISO 9283 words them, where poses were taken several times."""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from calib_core.captures.content import pose_of
from calib_core.errors import InputError
from calib_core.evidence.numbers import fixed
from calib_core.frames import FloatArray
from calib_core.records import Session
from calib_core.records.evidence import AnyBlock, Column, Row, Table
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.tcp.record import TcpResidual, TcpResult

_LEAST_CYCLES = 3
_SAME_MM, _SAME_RAD = 0.1, 2e-4  # as controllers report one pose several times


def repeatability_table(session: Session, result: TcpResult | ChainResult) -> list[AnyBlock]:
    """Return repeatability RP and accuracy AP of each pose that was taken three times or more."""
    found = [row for row in result.residuals if isinstance(row, TcpResidual) and row.used and _offset(row)]
    poses = _poses(session)
    groups: list[list[TcpResidual]] = []
    for row in found:
        if row.capture not in poses:
            continue
        own = (g for g in groups if _is_same(poses[g[0].capture], poses[row.capture]))
        group = next(own, None)
        if group is None:
            groups.append([row])
        else:
            group.append(row)
    rows = [_row(group) for group in groups if len(group) >= _LEAST_CYCLES]
    if not rows:
        return []
    columns = [Column(label="First capture", align="left"), Column(label="Times")]
    columns += [Column(label="Repeatability RP", unit="mm"), Column(label="Accuracy AP", unit="mm")]
    return [
        Table(
            id="iso-9283",
            title="Repeatability and accuracy of poses (ISO 9283)",
            detail=True,
            caption="RP: mean and three standard deviations of the distances from their own mean; AP: how far "
            "that mean lies from where the answer expects it. The scanner's noise is part of both. ISO 9283 asks "
            "for five poses, 30 times each, reached from one side.",
            columns=columns,
            rows=rows,
        )
    ]


def _poses(session: Session) -> dict[str, FloatArray]:
    """Return the poses that can be read by the session's convention, which may be another one since the result."""
    found: dict[str, FloatArray] = {}
    for one in session.captures:
        with suppress(InputError):
            found[one.id] = pose_of(session.cell, one).matrix
    return found


def repeatability_mm(places_mm: FloatArray) -> float:
    """Return RP of places (n, 3) that were to be one."""
    apart = np.linalg.norm(places_mm - places_mm.mean(axis=0), axis=1)
    return float(apart.mean() + 3 * apart.std(ddof=1))


def _row(group: Sequence[TcpResidual]) -> Row:
    places = np.array([_offset(row) for row in group], dtype=float)
    accuracy_mm = float(np.linalg.norm(places.mean(axis=0)))
    figures = [fixed(repeatability_mm(places), 3, "mm"), fixed(accuracy_mm, 3, "mm")]
    return Row(cells=[group[0].capture, fixed(len(group), 0), *figures])


def _offset(row: TcpResidual) -> list[float] | None:
    """Return where a capture has the sphere beside where the answer has it."""
    return row.center_offset_in_base_mm or row.center_offset_in_tool0_mm


def _is_same(one: FloatArray, other: FloatArray) -> bool:
    apart = one - other
    turned_rad = float(np.linalg.norm(apart[:3, :3])) / np.sqrt(2)  # of small angles
    return float(np.linalg.norm(apart[:3, 3])) < _SAME_MM and turned_rad < _SAME_RAD
