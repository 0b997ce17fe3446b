"""What machines that did not turn leave open, left out of results: null in place of a number."""

from typing import Any, TypeVar

import numpy as np

from calib_core.cell.carriers import rides_on_axis
from calib_core.cell.found import UpToShift
from calib_core.chain.without_turns import OpenShifts
from calib_core.frames import RigidTransform
from calib_core.records.results import FoundFrame
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.turntable.record import TurntableResult
from calib_core.stages.turntable.result import seen_from

FAR_MM = 1000.0
"""A place with such a standard deviation is not determined, and has no number."""
_R = TypeVar("_R", TcpResult, TurntableResult, ChainResult)


def without_open_places(result: _R, shifts: OpenShifts, *, own_base: bool = False) -> _R:
    """Return a result in which what the motions do not determine is null, and how it is used all the same.

    `own_base`: base is the scanner's own frame.
    """
    if not len(shifts.directions):
        return result
    mount, turned = result.mount_from_laser, shifts.travel is not None
    on_mount, in_base = (_pose(places, turned) for places in (shifts.of_mount, shifts.of_ball))
    told: dict[str, Any] = {f"{mount.into}_from_laser": _opened(mount.to_rows(), on_mount)}
    if not isinstance(result, TcpResult):
        told |= _open_table(result, in_base)
    if isinstance(result, TcpResult | ChainResult):
        told |= {
            "covariance": _rows(result.covariance, on_mount, on_mount),
            f"sphere_center_in_{result.spheres[0].carrier}_mm": None,
            "sphere_center_covariance": _rows(result.sphere_center_covariance, in_base[3:], in_base[3:]),
            "workpiece": None,
            "confidence_95": {k: v for k, v in result.confidence_95.items() if not _is_open(k, on_mount)},
        }
    if isinstance(result, TurntableResult):
        told["covariance"] = _rows(result.covariance, in_base, in_base)
    if isinstance(result, ChainResult):
        told["turntable_covariance"] = _rows(result.turntable_covariance, in_base, in_base)
        told["cross_covariance"] = _rows(result.cross_covariance, on_mount, in_base)
    told["spheres"] = [
        ball.model_copy(
            update={
                "center_mm": _vector(ball.center_mm, is_open[3:]),
                "covariance": _rows(ball.covariance, is_open[3:], is_open[3:]),
            }
        )
        if not rides_on_axis(ball.carrier) and not isinstance(result, TurntableResult)
        else ball
        for ball in result.spheres
        for is_open in [(on_mount if ball.carrier == mount.into else in_base) | _far_off(ball.covariance)]
    ]
    told["axes"] = [
        axis.model_copy(
            update={
                "axis_direction": _vector(axis.axis_direction, in_base[:3]),
                "axis_point_mm": axis.axis_point_mm and _vector(axis.axis_point_mm, in_base[3:]),
                "covariance": _rows(axis.covariance, in_base, in_base),
            }
        )
        for axis in result.axes
    ]
    told["frames"] = [
        frame.model_copy(
            update={
                "matrix": _opened(frame.matrix, is_open),
                "covariance": frame.covariance and _rows(frame.covariance, is_open, is_open),
            }
        )
        for frame in result.frames
        for is_open in [_open_of(frame, mount, on_mount, in_base) | _far_off(frame.covariance)]
    ]
    own = result.model_dump(by_alias=True, include=set(UpToShift.model_fields) - {"directions", "travel"})
    travel = None if shifts.travel is None or own_base else shifts.travel.tolist()
    told["up_to_shift"] = UpToShift(
        directions=shifts.directions.tolist(), travel=travel, own_base=own_base or None, **own
    )
    return result.model_copy(update=told)


def without_base(result: TurntableResult, scanner: str) -> TurntableResult:
    """Return a table that its scanner alone is tied to: null in base, where to each other told in frames."""
    base_from_laser = result.mount_from_laser
    laser_from_base = base_from_laser.inverse()
    table = laser_from_base @ RigidTransform.from_rounded(result.base_from_turntable, "base", "turntable")
    covariance = seen_from(base_from_laser, np.array(result.covariance, dtype=float))
    seen = FoundFrame(
        into=f"laser:{scanner}" if scanner else "laser",
        outof="turntable",
        matrix=table.to_rows(),
        covariance=covariance.tolist(),
    )
    every = OpenShifts(np.eye(3), np.eye(3), travel=np.zeros(3))
    placed = FoundFrame(into="base", outof="laser", scanner=scanner or None, matrix=base_from_laser.to_rows())
    opened = without_open_places(
        result.model_copy(update={"frames": [placed, *result.frames]}), every, own_base=True
    )
    return opened.model_copy(update={"frames": [*opened.frames, seen]})


def _open_of(frame: FoundFrame, mount: RigidTransform, on_mount: np.ndarray, in_base: np.ndarray) -> np.ndarray:
    """Return what of a frame is open, (6,): of the other end's scanners as of what stands there."""
    if frame.into == mount.into and frame.outof == "laser":
        return on_mount
    return np.zeros(6, dtype=bool) if frame.into.startswith("laser") else in_base


def _far_off(covariance: Any) -> np.ndarray:
    """Return which places of a pose (6,) are known to metres alone: its own captures did not turn for them."""
    variances = np.zeros(6) if covariance is None else np.diag(np.array(covariance, dtype=float))
    return np.concatenate([np.zeros(3, dtype=bool), variances[-3:] > FAR_MM**2])


def _open_table(result: TurntableResult | ChainResult, in_base: np.ndarray) -> dict[str, Any]:
    turned, places = in_base[:3], in_base[3:]
    told: dict[str, Any] = {
        "base_from_turntable": _opened(result.base_from_turntable, in_base),
        "axis_point_in_base_mm": _vector(result.axis_point_in_base_mm, places),
        "axis_point_sigma_mm": np.nan if places.any() else result.axis_point_sigma_mm,
        "axis_point_covariance": _rows(result.axis_point_covariance, places, places),
    }
    if turned.any():
        told |= {
            "axis_direction_in_base": _vector(result.axis_direction_in_base, turned),
            "axis_direction_sigma_deg": np.nan,
            "axis_direction_covariance": _rows(result.axis_direction_covariance, turned, turned),
            "circles": [],
            "circles_axis_direction_in_base": None,
        }
    return told


def _opened(rows: Any, is_open: np.ndarray) -> list[list[float]]:
    matrix = np.array(rows, dtype=float)
    matrix[:3, 3] = _vector(matrix[:3, 3], is_open[3:])
    matrix[:3, :3] = np.where(is_open[:3].any(), np.nan, matrix[:3, :3])
    return matrix.tolist()


def _vector(values: Any, is_open: np.ndarray) -> list[float]:
    return np.where(is_open, np.nan, np.array(values, dtype=float)).tolist()


def _rows(values: Any, down: np.ndarray, across: np.ndarray) -> list[list[float]]:
    return np.where(down[:, None] | across, np.nan, np.array(values, dtype=float)).tolist()


def _pose(is_open: np.ndarray, turned: bool) -> np.ndarray:
    """Return which of rx ry rz tx ty tz are open, (6,)."""
    return np.concatenate([np.full(3, turned), is_open])


def _is_open(name: str, is_open: np.ndarray) -> bool:
    return bool(is_open[3 * name.startswith("t") + "xyz".index(name[1])])
