"""What a frame's uncertainty means at the workpiece: how far off a measured point lies, in mm.

A point p of the outer frame comes out at R·p + t.  A small change r, δt of the frame (the rotation on the right)
moves it by δ = −R·[p]×·r + δt, so that its covariance is J·C·Jᵀ with J = (−R·[p]×, 1).
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final, Literal

import numpy as np

from calib_core.cell.axes import read_axes
from calib_core.cell.found import as_used, carriers_found, placed_table, scanner_frame, table_seen
from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform, skew, vector_from_rotation
from calib_core.guidance.budget import calibrated_rows, corrected_arm_at_point, together
from calib_core.guidance.calibrated import Calibrated, View
from calib_core.messages import message
from calib_core.poses.numbers import parse_pose
from calib_core.records import Record, Session
from calib_core.steps import steps_that_show, table_stages, tool_stages

Of = Literal["tool", "table", "both"]
_LARGEST: Final = 1e18  # mm²: of motions that determine nothing, solvers state kilometres
_ROUNDING: Final = 1e-6
_NOTHING_KNOWN_MM: Final = 1000.0


class AtWorkpiece(Record):
    """How well a point of the workpiece is known by one frame, or by tool and table together.

    Parameters
    ----------
    of : "tool", "table" or "both"
    where : str
        The mounting of the sphere whose place on the table is meant; empty where it is the scanner's view.
    point_mm : (3,)
        In L for the tool: where the scanner saw the sphere on average. In T for the others.
    sigmas_mm : (3,)
        Standard deviations along the axes of the frame of `point_mm`.
    worst_sigma_mm : float
        In the worst direction.
    """

    of: Of
    where: str = ""
    point_mm: list[float]
    sigmas_mm: list[float]
    worst_sigma_mm: float


def at_workpiece(session: Session, result: Mapping[str, Any]) -> list[AtWorkpiece]:
    """Return what a result's frames mean at the workpiece; nothing for stages without such frames.

    Places that are known to no better than a metre are left out: there the result itself says "not determined".
    So are all of a result that failed: no ± is believed of it.

    Parameters
    ----------
    session : Session
        For the robot's poses.
    result : mapping
        The JSON data of a result of `tcp`, `turntable` or `chain`.

    Raises
    ------
    InputError
        If a frame or a covariance of the result is none.
    """
    stage = result.get("stage")
    is_open = result.get("up_to_shift") and table_seen(result) is None
    if is_open or result.get("verdict") == "fail":
        return []  # where in base a point lies is not determined, or not by captures that contradict each other
    found: list[AtWorkpiece] = []
    if stage in tool_stages():
        point = seen_in_laser_mm(session, result)
        if point is not None:
            found.append(_by_tool(result, scanner_frame(result), point))
    if stage in table_stages():
        found += [_on_the_table(result, mount) for mount in result["mounts"]]
    if stage == "chain":
        found += [both for mount in result["mounts"] if (both := _both(session, result, mount)) is not None]
    return [place for place in found if place.worst_sigma_mm <= _NOTHING_KNOWN_MM]


def turned_deg(session: Session, result: Mapping[str, Any]) -> dict[str, float]:
    """Return by how much the flange was turned at each capture of a result, in degrees from the first one.

    Captures without a pose that can be read are left out; so are all where the result is not of robot poses.
    """
    if result.get("stage") not in tool_stages():
        return {}
    poses = _poses(
        session, {row["capture"] for row in result["residuals"]}, steps_that_show("sphere", "sphere-on-table")
    )
    first = next(iter(poses.values()), None)
    if first is None:
        return {}
    turns = vector_from_rotation([first.rotation.T @ pose.rotation for pose in poses.values()])
    return dict(zip(poses, np.rad2deg(np.linalg.norm(turns, axis=1)).tolist(), strict=True))


def point_jacobian(frame: RigidTransform, point_mm: FloatArray) -> FloatArray:
    """Return the derivative (3, 6) of a point's place by rx ry rz tx ty tz of the frame that carries it."""
    return np.hstack([-frame.rotation @ skew(point_mm), np.eye(3)])


def covariance_in(result: Mapping[str, Any], name: str) -> FloatArray:
    """Return a covariance (6, 6) out of a stored result; raises InputError where it is none."""
    rows = as_used(result).get(name) or []
    square = len(rows) >= 6 and all(len(row) >= 6 for row in rows[:6])
    covariance = np.array([row[:6] for row in rows[:6]], dtype=float) if square else np.full((6, 6), np.nan)
    whole = name.startswith("cross") or (square and _is_covariance(covariance))
    if not ((np.abs(covariance) < _LARGEST).all() and whole):
        where = f"results/{result['stage']}.json: {name}"
        got = message("numbers that cannot be one") if square else message("something else")
        raise InputError("a covariance of six numbers", got, "Solve the session again.", where)
    return covariance


def _is_covariance(square: FloatArray) -> bool:
    """Whether no direction has a negative variance; a rounding error, in proportion to the largest, is none."""
    if not np.isfinite(square).all():
        return False
    variances = np.linalg.eigvalsh(square)
    return bool(variances[0] >= -_ROUNDING * max(1.0, float(variances[-1])))


def seen_in_laser_mm(session: Session, result: Mapping[str, Any]) -> FloatArray | None:
    """Return where the scanner saw the TCP's sphere on average, in L, mm; None without a pose that can be read."""
    carriers, frame = carriers_found(result), scanner_frame(result)
    center = np.array(result[f"sphere_center_in_{carriers.ball}_mm"], dtype=float)
    used = {row["capture"] for row in result["residuals"] if row["used"]}
    poses = _poses(session, used, steps_that_show("sphere"))
    seen = [(carriers.ball_from_scanner(pose) @ frame).inverse().apply(center) for pose in poses.values()]
    return np.mean(seen, axis=0) if seen else None


def _poses(session: Session, named: set[str], steps: Sequence[str]) -> dict[str, RigidTransform]:
    poses: dict[str, RigidTransform] = {}
    for capture in session.captures:
        if capture.id in named and capture.step in steps and capture.pose is not None:
            try:
                poses[capture.id] = parse_pose(session.cell.pose_convention, capture.pose)
            except InputError:
                continue  # it was changed since, and the stage says so when it is solved again
    return poses


def _on_the_table(result: Mapping[str, Any], mount: Mapping[str, Any]) -> AtWorkpiece:
    table = placed_table(result)
    covariance = covariance_in(result, "turntable_covariance" if result["stage"] == "chain" else "covariance")
    point = np.array(mount["center_in_turntable_mm"], dtype=float)
    return _known("table", mount["mount"], point, table.rotation, point_jacobian(table, point), covariance)


def _both(session: Session, result: Mapping[str, Any], mount: Mapping[str, Any]) -> AtWorkpiece | None:
    """Return how well a scanned point on the table is known, over the poses that saw the sphere there (RMS).

    The scanner's own errors count together with what they did to tool and table.  Of several scanners it is the
    first one's; where other axes than the table's moved, it is as if that had seen each place where it saw the
    sphere on average, and as if those axes were known apart from tool and table.
    """
    rows = [r for r in result["residuals"] if r["used"] and r.get("mount") == mount["mount"]]
    angles_deg = {r["capture"]: r["table_deg"] for r in rows if r.get("table_deg") is not None}
    scanner = result["scanner"] if isinstance(result.get("scanner"), str) else None
    by_it = {capture.id for capture in session.captures if scanner is None or capture.scanner == scanner}
    poses = _poses(session, set(angles_deg) & by_it, ("turntable",))
    if not poses:
        return None
    seen = result["workpiece"]["point_in_laser_mm"] if len(result.get("axes") or ()) > 1 else None
    carriers, tool = carriers_found(result), scanner_frame(result)
    table = placed_table(result)
    for name in ("covariance", "turntable_covariance", "cross_covariance"):
        covariance_in(result, name)
    known = Calibrated.of(result, [0.0, 0.0, 0.0])
    place = np.array(mount["center_in_turntable_mm"], dtype=float)
    total = np.zeros((3, 3))
    for capture, base_from_tool0 in poses.items():
        angle = float(np.deg2rad(angles_deg[capture]))
        turn = RigidTransform.of(
            [0.0, 0.0, result["direction"] * angle], [0.0, 0.0, 0.0], "turntable", "turntable"
        )
        base_from_mount = (
            base_from_tool0 if carriers.scanner == "tool0" else RigidTransform.identity("base", "base")
        )
        in_laser = (base_from_mount @ tool).inverse().apply((table @ turn).apply(place)) if seen is None else seen
        view = View(base_from_tool0.rotation, angle, in_laser)
        total += together(known, view, place) + corrected_arm_at_point(known, view, place)
    by_axes = _by_other_axes(session, result, set(poses), table.apply(place))
    return _summed("both", mount["mount"], place, total / len(poses) + by_axes * np.eye(3))


def _by_other_axes(session: Session, result: Mapping[str, Any], captures: set[str], point_mm: FloatArray) -> float:
    """Return the mean variance along any direction by where axes lie that moved beside the table's, mm²."""
    axes = result.get("axes") or ()
    if len(axes) < 2:
        return 0.0
    total = 0.0
    for capture in session.captures:
        if capture.id not in captures:
            continue
        read = read_axes(session.cell, capture)
        for axis in axes[:-1]:
            square = np.array(axis["covariance"], dtype=float)
            turned, shifted = (float(np.linalg.eigvalsh(square[k : k + 3, k : k + 3])[-1]) for k in (0, 3))
            by = read.get(axis["name"], 0.0)
            if axis["kind"] == "linear":
                total += by**2 * turned
            else:
                apart = float(np.linalg.norm(point_mm - np.array(axis["axis_point_mm"], dtype=float)))
                total += (2 * np.sin(by / 2)) ** 2 * (shifted + apart**2 * turned)
    return total / len(captures)


def _by_tool(result: Mapping[str, Any], tool: RigidTransform, point: FloatArray) -> AtWorkpiece:
    """Return how well a point is known by the tool, with the scanner's own errors where they are stated."""
    covariance = covariance_in(result, "covariance")
    together = result.get("workpiece")
    if together is None:
        return _known("tool", "", point, tool.rotation, point_jacobian(tool, point), covariance)
    point = np.array(together["point_in_laser_mm"], dtype=float)
    rows = np.array(together["covariance"], dtype=float) + _by_open_arm(result, point)
    return _summed("tool", "", point, tool.rotation.T @ rows @ tool.rotation)


def _by_open_arm(result: Mapping[str, Any], point: FloatArray) -> FloatArray:
    """Return what is open of a corrected arm puts into a point beside the tool, along the flange's axes, (3, 3).

    In base as the arm tells it, the mean over the poses that stand for the captures': what it does alike in all of
    them moves the base, and nothing that is measured in it.
    """
    known = Calibrated.of({**result, "base_from_turntable": None}, point.tolist())
    arm, none = known.arm, np.zeros((3, 3))
    if arm is None or arm.terms is None or not len(arm.rotations):
        return none
    in_tool0 = known.mount_from_laser.apply(point)
    poses = list(zip(arm.rotations, arm.translations, strict=True))
    moves = np.array([arm.term_moves(r, t[None], r @ in_tool0)[0] for r, t in poses])
    moves = np.swapaxes(arm.rotations, 1, 2) @ (moves - moves.mean(axis=0))
    rows = calibrated_rows(known, View(arm.rotations[0]), none[0])[0][:, : len(arm.terms.with_answer)]
    half = rows @ arm.terms.with_answer @ np.swapaxes(moves, 1, 2)
    own = moves @ arm.terms.covariance @ np.swapaxes(moves, 1, 2)
    return np.asarray((own + half + np.swapaxes(half, 1, 2)).mean(axis=0))


def _known(
    of: Of, where: str, point_mm: FloatArray, rotation: FloatArray, jacobian: FloatArray, covariance: FloatArray
) -> AtWorkpiece:
    own = rotation.T @ jacobian
    return _summed(of, where, point_mm, own @ covariance @ own.T)


def _summed(of: Of, where: str, point_mm: FloatArray, covariance: FloatArray) -> AtWorkpiece:
    return AtWorkpiece(
        of=of,
        where=where,
        point_mm=point_mm.tolist(),
        sigmas_mm=np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist(),
        worst_sigma_mm=float(np.sqrt(max(float(np.linalg.eigvalsh(covariance)[-1]), 0.0))),
    )
