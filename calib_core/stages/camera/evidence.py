"""What the camera's result says of itself."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from calib_core.evidence.numbers import number_text, quantity, rms
from calib_core.frames import FloatArray
from calib_core.messages import message
from calib_core.optics.camera_evidence import MODELS
from calib_core.records import Session
from calib_core.records.camera_result import CameraResult
from calib_core.records.evidence import (
    AnyBlock,
    Axis,
    Band,
    Column,
    Figure,
    Note,
    Picture,
    Plot,
    Row,
    Series,
    Table,
)
from calib_core.stages.evidence_parts import capture_series, captures_used, provenance, residual_table
from calib_core.stages.frames_left_out import frames_left_out

_COLUMNS: Final = (("corners", "Corners", ""), ("rms_px", "RMS", "px"), ("edge_width_px", "Edge width", "px"))
_LABELS: Final = {
    "fx": "Focal length x",
    "fy": "Focal length y",
    "cx": "Principal point x",
    "cy": "Principal point y",
    "tauX": "Sensor's tilt x",
    "tauY": "Sensor's tilt y",
}


def evidence(session: Session, result: CameraResult) -> list[AnyBlock]:
    """Return the camera told in blocks, the answer first."""
    return [
        Figure(label="Reprojection, RMS", quantity=rms(result.reprojection_rms_px, "px"), headline=True),
        Figure(label="Model", text=_model(result)),
        captures_used(result),
        *_parameters(result),
        *_lengths(result),
        *_views(result),
        *_coverage(result),
        *_projection(result),
        *_candidates(result),
        Picture(
            id="camera-residuals",
            title="Residuals of each view",
            detail=True,
            drawing="camera-residuals",
            alt="Seen minus predicted corners of each view. Arrows of one direction in one region mean that the "
            "lens model does not fit there.",
        ),
        *frames_left_out(session, result),
        *residual_table(result.residuals, _COLUMNS, "Each view"),
        *_matrix(result),
        *provenance(result),
    ]


def _model(result: CameraResult) -> str:
    """Return the model with the members that the views determined."""
    members = " ".join(name for name in result.distortion if name in result.parameters)
    model = MODELS[result.model]
    return message("{what}: {why}", what=model, why=members) if members else model


def _sigma(result: CameraResult, name: str) -> float | None:
    if name not in result.parameters:
        return None
    index = result.parameters.index(name)
    return math.sqrt(max(result.covariance[index][index], 0.0))


def _parameters(result: CameraResult) -> list[AnyBlock]:
    matrix = result.camera_matrix
    values = {"fx": matrix[0][0], "fy": matrix[1][1], "cx": matrix[0][2], "cy": matrix[1][2], **result.distortion}
    rows: list[Row] = []
    for name, value in values.items():
        sigma = _sigma(result, name)
        if sigma is None and not value:
            continue
        if name.startswith("tau"):
            shown = quantity(math.degrees(value), "°", None if sigma is None else math.degrees(sigma))
        else:
            shown = quantity(value, "px" if name in ("fx", "fy", "cx", "cy") else "", sigma)
        rows.append(Row(cells=[_LABELS.get(name, name), shown]))
    heads = [Column(label="Parameter", align="left"), Column(label="Value")]
    figures: list[AnyBlock] = [
        Table(id="camera", title="Camera", caption="± at k = 2", columns=heads, rows=rows),
        Figure(label="Noise of a corner", quantity=quantity(result.corner_sigma_px, "px")),
    ]
    if result.tilt_correlation is not None:
        shown = number_text(result.tilt_correlation, 2)
        figures.append(Figure(label="Correlation of tilt and principal point", text=shown))
    if result.board_bend_mm is not None:
        figures.append(Figure(label="Board bent by", quantity=quantity(result.board_bend_mm, "mm")))
    return figures


def _lengths(result: CameraResult) -> list[AnyBlock]:
    told = result.by_robot
    if told is None:
        return []
    matrix = result.camera_matrix
    alone = [quantity(matrix[k][k], "px", _sigma(result, name)) for k, name in enumerate(("fx", "fy"))]
    both = [quantity(v, "px", s) for v, s in zip(told.focal_px, told.focal_sigma_px, strict=True)]
    pitch = quantity(100 * (told.pitch_factor - 1), "%", 100 * told.pitch_sigma)
    columns = [Column(label="", align="left"), Column(label="Boards"), Column(label="Boards and robot")]
    rows = [
        Row(cells=["Focal length x", alone[0], both[0]]),
        Row(cells=["Focal length y", alone[1], both[1]]),
        Row(cells=["Board's pitch beside the told one", "not seen", pitch]),
    ]
    caption = message(
        "By the robot's poses of {views} views of the fixed board. The camera stays that of the "
        "boards, and its uncertainty holds the difference. ± at k = 2.",
        views=told.views,
    )
    return [
        Table(id="robot-lengths", title="By the robot's lengths", caption=caption, columns=columns, rows=rows),
        Figure(label="Chance of such a difference", text=_chance(told.chance)),
    ]


def _chance(chance: float) -> str:
    return "below 0.001" if chance < 0.001 else number_text(chance, 3)


def _views(result: CameraResult) -> list[AnyBlock]:
    rows = [row for row in result.residuals if row.rms_px is not None]
    if not rows:
        return []
    return [
        Plot(
            id="residuals",
            title="Residuals",
            shape="captures",
            caption="How far the corners of each view lie from where the camera predicts them, RMS. The band is "
            "what corner noise alone gives; crosses are views that are not used.",
            x=Axis(label="View"),
            y=Axis(label="RMS", unit="px", low=0.0),
            series=[capture_series(rows, [row.rms_px for row in rows])],
            band=Band(low=0.0, high=math.sqrt(2) * result.corner_sigma_px, label="Corner noise"),
        )
    ]


def _coverage(result: CameraResult) -> list[AnyBlock]:
    seen = result.coverage
    near, far = number_text(seen.near_mm, 0), number_text(seen.far_mm, 0)
    tilt = number_text(math.degrees(seen.largest_tilt_rad), 0)
    return [
        Plot(
            id="coverage",
            title="Coverage",
            shape="grid",
            caption=message(
                "Corners seen in each part of the image. {covered} % of the parts saw a board, from "
                "{near} to {far} mm, tilted by up to {tilt}°.",
                covered=number_text(100 * seen.covered, 0),
                near=near,
                far=far,
                tilt=tilt,
            ),
            x=Axis(label="Column"),
            y=Axis(label="Corners"),
            series=_map_rows(seen.counts),
        )
    ]


def _projection(result: CameraResult) -> list[AnyBlock]:
    rows = [[None if one is None else 2 * one for one in row] for row in result.coverage.projection_sigma_px]
    known = [one for row in rows for one in row if one is not None]
    if not known:
        return []
    caption = message(
        "How far a ray of the scene may end from its pixel (k = 2), at places all over the image, from {least} to "
        "{most} px. A turn of the whole camera does not count: it is no error of the lens.",
        least=number_text(min(known), 3),
        most=number_text(max(known), 3),
    )
    return [image_map(rows, "projection", title="Uncertainty of the projection", caption=caption)]


def grid_rows(values: FloatArray) -> list[list[float | None]]:
    """Return a map's rows, None where it has no value."""
    return [[float(one) if np.isfinite(one) else None for one in row] for row in values.round(4)]


def image_map(rows: Sequence[Sequence[float | None]], name: str, title: str, caption: str) -> Plot:
    """Return pixels at places all over the image as a map."""
    return Plot(
        id=name,
        title=title,
        shape="grid",
        caption=caption,
        x=Axis(label="Column"),
        y=Axis(label="Distance", unit="px"),
        series=_map_rows(rows),
    )


def _map_rows(rows: Sequence[Sequence[float | None]]) -> list[Series]:
    return [Series(label=message("row {line}", line=k + 1), y=list(row)) for k, row in enumerate(rows)]


def _candidates(result: CameraResult) -> list[AnyBlock]:
    if not result.candidates:
        return []
    flat = {one.model: one.parameters for one in result.candidates if not one.bent}
    bent_by = sum(name.startswith("board") for name in result.parameters)
    rows = [
        Row(
            cells=[
                message("{model}, bent board", model=MODELS[one.model]) if one.bent else MODELS[one.model],
                one.parameters,
                one.held_out_rms_px,
                message("chosen")
                if (one.model, one.parameters - flat.get(one.model, one.parameters)) == (result.model, bent_by)
                else "",
            ]
        )
        for one in result.candidates
    ]
    columns = [
        Column(label="Candidate", align="left"),
        Column(label="Parameters"),
        Column(label="Held-out error", unit="px", decimals=4),
        Column(label="", align="left"),
    ]
    return [
        Table(id="candidates", title="Why this model", columns=columns, rows=rows),
        Note(
            text="The error on views that were held out decides; a larger model must be better by "
            "more than chance."
        ),
    ]


def _matrix(result: CameraResult) -> list[AnyBlock]:
    columns = [Column(label=label, decimals=4) for label in ("", "", "")]
    rows = [Row(cells=[*row]) for row in result.camera_matrix]
    return [Table(title="Camera matrix", detail=True, columns=columns, rows=rows)]
