"""The joint answer beside the paper's two steps."""

from typing import Any

import numpy as np

from calib_core.evidence.numbers import fixed, plus_minus, quantity, rms
from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import message
from calib_core.records.evidence import (
    AnyBlock,
    Column,
    Note,
    Row,
    Table,
)
from calib_core.stages.frame_blocks import pose_sigmas


def two_step_blocks(result: Any) -> list[AnyBlock]:
    """Return the joint answer beside the paper's two steps, with their difference in its own sigmas.

    Of an answer that failed no ± is believed: both are shown by themselves.
    """
    two = result.two_step
    title = "Joint answer beside the paper's two steps"
    other = two.placed_scanner
    if other is None:
        return [
            Note(
                title=title,
                text=message("No two-step answer: {reason}.", reason=two.reason or "too few pure translations"),
            )
        ]
    joint = result.mount_from_laser
    believed = result.verdict != "fail"
    ours = np.array(result.covariance, dtype=float)[:6, :6] if believed else np.full((6, 6), np.nan)
    theirs = np.array(two.covariance, dtype=float)[:6, :6] if believed and two.covariance is not None else None
    xi = joint.difference(other)
    rows = [
        _compared_axis(axis, joint, other, 3 + k, ours, theirs)
        for k, axis in enumerate(("x", "y", "z"))
    ]  # fmt: skip
    angle = float(np.linalg.norm(xi[:3]))
    along = np.concatenate([xi[:3] / angle if angle else np.zeros(3), np.zeros(3)])
    rows.append(
        Row(
            cells=[
                "Rotation",
                plus_minus(pose_sigmas(result.covariance)[1], "°") if believed else None,
                quantity(float(np.rad2deg(angle)), "°"),
                _in_sigmas(angle, along, ours, theirs),
            ]
        )
    )
    rows += [
        Row(cells=[label, rms(getattr(result, field), "mm"), rms(getattr(two, field), "mm"), None])
        for field, label in (
            ("center_scatter_rms_mm", "Scatter of the sphere's centres, RMS"),
            ("surface_rms_mm", "Points off the sphere, RMS"),
            ("leave_one_out_surface_rms_mm", "The same, each capture left out in turn"),
        )
    ]
    heads = [Column(label="Figure", align="left"), Column(label="Joint"), Column(label="Two-step")]
    caption = message("Of the rotation, the angle between the two answers.")
    if believed:
        caption = (
            message(
                "Differences are in units of their own standard deviation; of the rotation, the angle between the "
                "two answers."
            )
            if theirs is not None
            else message(
                "Differences are in units of their own standard deviation as far as the joint answer's "
                "uncertainty goes; of the rotation, the angle between the two answers."
            )
        )
    columns = [*heads, Column(label="Difference", unit="σ", decimals=1)]
    if not believed:
        columns, rows = heads, [row.model_copy(update={"cells": row.cells[:3]}) for row in rows]
    return [Table(id="two-step", title=title, caption=caption, columns=columns, rows=rows)]


def _compared_axis(
    axis: str, joint: RigidTransform, other: RigidTransform, k: int, ours: FloatArray, theirs: FloatArray | None
) -> Row:
    mine, its = float(joint.translation_mm[k - 3]), float(other.translation_mm[k - 3])
    sigma = None if theirs is None else float(np.sqrt(theirs[k, k]))
    shown = quantity(mine, "mm", float(np.sqrt(ours[k, k])))
    beside = fixed(its, shown.decimals, "mm") if sigma is None else quantity(its, "mm", sigma)
    return Row(
        cells=[
            message("Position {axis}", axis=axis),
            shown,
            beside,
            _in_sigmas(its - mine, np.eye(6)[k], ours, theirs),
        ]
    )


def _in_sigmas(difference: float, along: FloatArray, ours: FloatArray, theirs: FloatArray | None) -> float | None:
    """Return a difference of the two answers in its own sigmas.

    The joint answer has used all there is, so that the variance of the difference is the two steps' less its own.
    """
    better = float(along @ ours @ along)
    variance = better if theirs is None else float(along @ theirs @ along)
    variance = variance - better if variance > better and theirs is not None else max(variance, better)
    return difference / float(np.sqrt(variance)) if variance > 0 else None
