"""A transform of a session that was asked for, where a result has it as it is."""

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from calib_core.frames import RigidTransform, skew, with_third
from calib_core.records import Matrix4, Record
from calib_core.records.base import Rows
from calib_core.steps import table_stages, tool_stages


class AskedFrame(Record):
    """A transform between two frames, along the edges `through`; its covariance holds theirs, where stated."""

    name: str
    matrix: Matrix4
    covariance: Rows
    through: list[str]
    stale: bool
    without_covariance: list[str]


def told_by_result(
    results: Mapping[str, Mapping[str, Any]], stale: Collection[str], into: str, outof: str, table: str | None
) -> AskedFrame | None:
    """Return a scanner's pose in another's frame, a table's in a scanner's, or an axis's in base; None without.

    Parameters
    ----------
    results : mapping
        As JSON data, by their stages.
    stale : collection of str
    into, outof : str
    table : str or None
        The axis whose frame is the turntable's, which has another origin than that of its axis.
    """
    found = [next((one for one in stages if one in results), None) for stages in (tool_stages(), table_stages())]
    for stage in filter(None, found):
        frames = [one for one in results[stage].get("frames") or [] if one["into"].startswith("laser")]
        frames += [_of_axis(one) for one in results[stage].get("axes") or [] if one["name"] != table]
        frame = next((one for one in frames if {one["into"], one["outof"]} == {into, outof}), None)
        if frame is None or not np.isfinite(np.array(frame["matrix"], dtype=float)).all():
            continue
        there = RigidTransform.from_rounded(frame["matrix"], "base", "tool0")
        covariance = np.array(frame["covariance"], dtype=float)
        if frame["into"] != into:
            back, moves = there.inverse(), np.zeros((6, 6))
            moves[:3, :3], moves[3:, 3:] = -there.rotation, -back.rotation
            moves[3:, :3] = skew(back.translation_mm)
            there, covariance = back, moves @ covariance @ moves.T
        return AskedFrame(
            name=f"{into}_from_{outof}",
            matrix=there.to_rows(),
            covariance=covariance.tolist(),
            through=[f"{frame['into']}_from_{frame['outof']}"],
            stale=stage in stale,
            without_covariance=[],
        )
    return None


def _of_axis(axis: Mapping[str, Any]) -> dict[str, Any]:
    """Return the frame of an axis in base where all read zero: z along it, x as `Placement` has it."""
    direction = np.array(axis["axis_direction"], dtype=float)
    matrix = np.eye(4)
    matrix[:3, :3] = with_third(direction / np.linalg.norm(direction))
    matrix[:3, 3] = axis["axis_point_mm"] or [0.0, 0.0, 0.0]  # a shift is the same wherever its axis is drawn
    return {"into": "base", "outof": axis["name"], "matrix": matrix.tolist(), "covariance": axis["covariance"]}
