"""What machines that did not turn leave open, left out of results: null in place of a number."""

from typing import Any, TypeVar

import numpy as np

from calib_core.cell.found import UpToShift
from calib_core.chain.without_turns import OpenShifts
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.turntable.record import TurntableResult

_R = TypeVar("_R", TcpResult, TurntableResult, ChainResult)


def without_open_places(result: _R, shifts: OpenShifts) -> _R:
    """Return a result in which what the motions do not determine is null, and how it is used all the same."""
    if not len(shifts.directions):
        return result
    mount = result.mount_from_laser
    on_mount, in_base = shifts.of_mount, shifts.of_ball
    told: dict[str, Any] = {f"{mount.into}_from_laser": _opened(mount.to_rows(), on_mount)}
    if not isinstance(result, TcpResult):
        told |= {
            "base_from_turntable": _opened(result.base_from_turntable, in_base),
            "axis_point_in_base_mm": _vector(result.axis_point_in_base_mm, in_base),
            "axis_point_sigma_mm": np.nan if in_base.any() else result.axis_point_sigma_mm,
            "axis_point_covariance": _rows(result.axis_point_covariance, in_base, in_base),
        }
    if isinstance(result, TcpResult | ChainResult):
        told |= {
            "covariance": _rows(result.covariance, _pose(on_mount), _pose(on_mount)),
            f"sphere_center_in_{result.spheres[0].carrier}_mm": None,
            "sphere_center_covariance": _rows(result.sphere_center_covariance, in_base, in_base),
            "workpiece": None,
            "confidence_95": {k: v for k, v in result.confidence_95.items() if not _is_open(k, on_mount)},
        }
    if isinstance(result, TurntableResult):
        told["covariance"] = _rows(result.covariance, _pose(in_base), _pose(in_base))
    if isinstance(result, ChainResult):
        told["turntable_covariance"] = _rows(result.turntable_covariance, _pose(in_base), _pose(in_base))
        told["cross_covariance"] = _rows(result.cross_covariance, _pose(on_mount), _pose(in_base))
    told["spheres"] = [
        ball.model_copy(
            update={
                "center_mm": _vector(ball.center_mm, in_base),
                "covariance": _rows(ball.covariance, in_base, in_base),
            }
        )
        if ball.carrier == result.spheres[0].carrier and not isinstance(result, TurntableResult)
        else ball
        for ball in result.spheres
    ]
    told["axes"] = [
        axis.model_copy(
            update={
                "axis_point_mm": axis.axis_point_mm and _vector(axis.axis_point_mm, in_base),
                "covariance": _rows(axis.covariance, _pose(in_base), _pose(in_base)),
            }
        )
        for axis in result.axes
    ]
    told["frames"] = [
        frame.model_copy(
            update={
                "matrix": _opened(frame.matrix, on_mount),
                "covariance": frame.covariance and _rows(frame.covariance, _pose(on_mount), _pose(on_mount)),
            }
        )
        if (frame.into, frame.outof) == (mount.into, "laser")
        else frame
        for frame in result.frames
    ]
    own = result.model_dump(include=set(UpToShift.model_fields) - {"directions"})
    told["up_to_shift"] = UpToShift(directions=shifts.directions.tolist(), **own)
    return result.model_copy(update=told)


def _opened(rows: Any, is_open: np.ndarray) -> list[list[float]]:
    matrix = np.array(rows, dtype=float)
    matrix[:3, 3] = _vector(matrix[:3, 3], is_open)
    return matrix.tolist()


def _vector(values: Any, is_open: np.ndarray) -> list[float]:
    return np.where(is_open, np.nan, np.array(values, dtype=float)).tolist()


def _rows(values: Any, down: np.ndarray, across: np.ndarray) -> list[list[float]]:
    return np.where(down[:, None] | across, np.nan, np.array(values, dtype=float)).tolist()


def _pose(is_open: np.ndarray) -> np.ndarray:
    return np.concatenate([np.zeros(3, dtype=bool), is_open])


def _is_open(name: str, is_open: np.ndarray) -> bool:
    return name.startswith("t") and bool(is_open["xyz".index(name[1])])
