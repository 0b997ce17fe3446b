"""One row of residuals a capture: the rows of a sweep's profiles brought together."""

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from calib_core.records import Capture
from calib_core.stages.tcp.record import TcpResidual
from calib_core.stages.turntable.record import TurntableResidual

_Row = TypeVar("_Row", bound=TcpResidual | TurntableResidual)

_ROOT_MEAN_SQUARES = (
    "surface_rms_mm",
    "leave_one_out_rms_mm",
    "two_step_surface_rms_mm",
    "center_distance_mm",
    "mahalanobis",
)
_OF_ONE_PROFILE = ("shift_without_mm", "turn_without_deg", "growth_without")
_MEANS = ("center_offset_in_base_mm", "center_in_base_mm", "radial_mm", "tangential_mm", "axial_mm", "angle_deg")


def one_row_each(rows: Sequence[TcpResidual | TurntableResidual]) -> dict[str, TcpResidual | TurntableResidual]:
    """Return one row a capture, by its id; a sweep's profiles have one row each to begin with."""
    grouped: dict[str, list[TcpResidual | TurntableResidual]] = {}
    for row in rows:
        grouped.setdefault(row.capture, []).append(row)
    return {name: group[0] if len(group) == 1 else _together(group) for name, group in grouped.items()}


def mark_sweeps(rows: Sequence[_Row], captures: Sequence[Capture]) -> list[_Row]:
    """Return the rows, those of sweeps with the number of profiles also where it is one or none."""
    marked: list[_Row] = []
    for row, capture in zip(rows, captures, strict=True):
        if capture.kind == "sweep" and row.profiles is None:
            seen = int(row.points > 0)
            row = row.model_copy(update={"profiles": seen, "profiles_used": int(row.used) * seen})
        elif capture.kind != "sweep" and row.profiles is not None:  # arcs of several balls
            row = row.model_copy(update={"profiles": None, "profiles_used": None})
        marked.append(row)
    return marked


def _together(rows: Sequence[TcpResidual | TurntableResidual]) -> TcpResidual | TurntableResidual:
    """Return a sweep's row: figures over its used profiles, or over all where none is used."""
    used = [row for row in rows if row.used]
    counted = used or list(rows)
    fields: dict[str, Any] = {
        "used": bool(used),
        "reason": None if used else rows[0].reason,
        "points": sum(row.points for row in rows),
        "profiles": len(rows),
        "profiles_used": len(used),
        "side": _common([row.side for row in counted]),
    }
    names = type(rows[0]).model_fields
    fields |= {name: None for name in _OF_ONE_PROFILE if name in names}
    for name in (*_ROOT_MEAN_SQUARES, *_MEANS):
        if name in names:
            values = [getattr(row, name) for row in counted if getattr(row, name) is not None]
            fields[name] = _mean(values, name in _ROOT_MEAN_SQUARES) if values else None
    if "zone" in names:
        fields["zone"] = max(
            (row.zone for row in counted if isinstance(row, TcpResidual) and row.zone), default=None
        )
    return rows[0].model_copy(update=fields)


def _mean(values: Sequence[Any], squared: bool) -> float | list[float]:
    table = np.array(values, dtype=float)
    if squared:
        return float(np.sqrt(np.mean(table**2)))
    mean = table.mean(axis=0)
    return float(mean) if mean.ndim == 0 else mean.tolist()


def _common(sides: Sequence[int | None]) -> int | None:
    """Return the side on which all are; None where the sweep crosses the sphere's middle."""
    return sides[0] if len(set(sides)) == 1 else None
