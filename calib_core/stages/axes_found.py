"""The axes that a solution found, told alike by every stage."""

from collections.abc import Callable

import numpy as np

from calib_core.cell.layout import Layout
from calib_core.chain.encoder_scales import EncoderScales
from calib_core.chain.model import ChainState
from calib_core.chain.table_frame import LEVEL
from calib_core.findings import Finding
from calib_core.findings.codes.turntable import ENCODER_SCALE
from calib_core.frames import FloatArray
from calib_core.records.topology import FoundAxis


def axes_found(state: ChainState, covariance: FloatArray, known: str = "") -> list[FoundAxis]:
    """Return every axis as it stands in base where all read zero, but for those that carry what is `known`.

    The covariance is of the edges' unknowns.
    """
    layout, found = state.walk.layout, list[FoundAxis]()
    for a, (edge, axis) in enumerate(zip(layout.axes, state.position.axes, strict=True)):
        if edge.carries == known:
            continue
        rotary, columns = edge.kind == "rotary", layout.axis(a)
        sign = -1 if rotary and axis.rotation[2, 2] < -LEVEL else 1
        moves = np.zeros((6, 5))
        moves[[0, 1], [0, 1]] = 1.0
        moves[3:, 2:4] = axis.rotation[:, :2] if rotary else 0.0
        own = covariance[columns, columns]
        found.append(
            FoundAxis.model_validate(
                {
                    "name": edge.name,
                    "in": "base",
                    "kind": edge.kind,
                    "axis_direction": (sign * axis.rotation[:, 2]).tolist(),
                    "axis_point_mm": axis.origin.tolist() if rotary else None,
                    "direction": sign,
                    "scale": axis.scale,
                    "scale_sigma": None if axis.scale == 1.0 else float(np.sqrt(max(own[4, 4], 0.0))),
                    "covariance": (moves @ own @ moves.T).tolist(),
                }
            )
        )
    return found


def encoder_findings(
    encoders: EncoderScales, layout: Layout, asked: Callable[[int], bool | None]
) -> list[Finding]:
    """Return which encoders count wrongly beyond doubt, but for those whose scale the cell asks for."""
    found: list[Finding] = []
    for number, scale in encoders.items():
        if not scale.significant or asked(number):
            continue
        axis = layout.named(number)
        found.append(
            ENCODER_SCALE(
                of=layout.axes[number].kind if axis else "one",
                axis=axis,
                handled="applied" if scale.applied else "left",
                error_percent=100 * scale.error,
                uncertainty_percent=200 * scale.sigma,
            )
        )
    return found
