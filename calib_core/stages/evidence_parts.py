"""Blocks that several stages share: residuals, what is left out, the workpiece, the noise."""

from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np

from calib_core.cell.titles import step_title
from calib_core.evidence.numbers import decimals_of, number_text, plus_minus, quantity
from calib_core.evidence.words import by_cause, captures_text
from calib_core.exports.workpiece import AtWorkpiece, at_workpiece
from calib_core.messages import message, templates
from calib_core.records import CaptureResidual, Cell, Result, Session, VarianceComponents
from calib_core.records.evidence import (
    AnyBlock,
    Axis,
    Band,
    Column,
    Figure,
    Plot,
    Quantity,
    Row,
    Series,
    Table,
)
from calib_core.steps import declared_stages

BAND: Final = 2.795
"""The 95 % quantile of the length of three independent standard normal numbers (χ², 3 degrees of freedom)."""

_NOISE_LABELS: Final = {
    "point_sigma_mm": ("Noise of one point", "mm"),
    "position_sigma_mm": ("Robot's position, each axis", "mm"),
    "orientation_sigma_deg": ("Robot's orientation, each axis", "°"),
    "alike_position_sigma_mm": ("Robot's position, shared by alike poses", "mm"),
    "alike_orientation_sigma_deg": ("Robot's orientation, shared by alike poses", "°"),
    "play_sigma_mm": ("Play of the sphere's axis, each direction", "mm"),
}
_UNITS: Final = {"_mm": "mm", "_deg": "°", "_px": "px", "_rad": "rad"}


def label_of(name: str) -> tuple[str, str]:
    """Return the label and the unit of a number whose name ends in its unit."""
    for ending, unit in _UNITS.items():
        if name.endswith(ending):
            return name.removesuffix(ending).replace("_", " ").capitalize(), unit
    return name.replace("_", " ").capitalize(), ""


def captures_used(result: Result) -> Figure:
    """Return how many captures are used."""
    rows: list[CaptureResidual] = getattr(result, "residuals", [])
    return Figure(
        label="Captures used",
        text=message("{rows} of {count}", rows=sum(row.used for row in rows), count=len(rows)),
    )


def source_text(name: str, cell: Cell) -> str:
    """Return where a tool comes from: what its stage's result is called in a cell, or that it is given."""
    titles = (stage.title for stage in declared_stages() if stage.name == name)
    return step_title(cell, name) or next(titles, message("given"))


def left_out(rows: Sequence[CaptureResidual]) -> list[AnyBlock]:
    """Return the captures that are not used, one row a reason."""
    causes = by_cause({row.capture: row.reason or "no reason given" for row in rows if not row.used})
    if not causes:
        return []
    order = [row.capture for row in rows]
    return [
        Table(
            title="Left out",
            columns=[Column(label="Captures", align="left"), Column(label="Reason", align="left")],
            rows=[
                Row(cells=[captures_text(names, order), reason], capture=names[0] if len(names) == 1 else None)
                for reason, names in causes.items()
            ],
        )
    ]


def residual_plot(rows: Sequence[Any], title: str = "Residuals") -> list[AnyBlock]:
    """Return how far each capture's sphere lies from where the others expect it, in its own sigmas."""
    shown = [row for row in rows if row.mahalanobis is not None]
    if not shown:
        return []
    return [
        Plot(
            id="residuals",
            title=title,
            shape="captures",
            caption="How far each capture's sphere lies from where all the others expect it, in standard "
            "deviations of that expectation. The band holds 95 % of good captures; crosses "
            "are captures that are not used.",
            x=Axis(label="Capture"),
            y=Axis(label="Distance", unit="σ", low=0.0),
            series=[capture_series(shown, [row.mahalanobis for row in shown])],
            band=Band(low=0.0, high=BAND, label="expected of 95 % of good captures"),
        )
    ]


def capture_series(
    rows: Sequence[CaptureResidual], y: Sequence[float | None], label: str = "", x: Sequence[float] = ()
) -> Series:
    """Return one point a capture; those that are not used are rejected with their reason."""
    reasons = [None if row.used else row.reason or "left out" for row in rows]
    return Series(
        label=label,
        x=list(x),
        y=list(y),
        captures=[row.capture for row in rows],
        reasons=reasons if any(reasons) else [],
    )


def residual_table(
    rows: Sequence[Any], columns: Sequence[tuple[str, str, str]], title: str = "Each capture"
) -> list[AnyBlock]:
    """Return one row a capture with the fields named by `columns`: field, label, unit."""
    columns = [one for one in columns if any(getattr(row, one[0], None) is not None for row in rows)]
    decimals = [_decimals(rows, field) for field, _, _ in columns]
    heads = [Column(label="Capture", align="left", own=True)]
    heads += [
        Column(label=label, unit=unit, decimals=digits)
        for (_, label, unit), digits in zip(columns, decimals, strict=True)
    ]
    return [
        Table(
            title=title,
            detail=True,
            columns=heads,
            rows=[
                Row(
                    cells=[row.capture, *(getattr(row, field, None) for field, _, _ in columns)],
                    capture=row.capture,
                    used=row.used,
                    reason=row.reason,
                )
                for row in rows
            ],
        )
    ]


def _decimals(rows: Sequence[Any], field: str) -> int:
    values = [value for row in rows if row.used and isinstance(value := getattr(row, field, None), int | float)]
    return 0 if all(isinstance(value, int) for value in values) else min(decimals_of(values), 4)


def workpiece_headline(places: Sequence[AtWorkpiece], table: str = "On the table") -> list[AnyBlock]:
    """Return the one number that counts: how far off a measured point may lie, in the worst direction."""
    for of, label in (("both", "At the workpiece"), ("tool", "At the workpiece"), ("table", table)):
        sigmas = [place.worst_sigma_mm for place in places if place.of == of]
        if sigmas:
            return [
                Figure(
                    label=label, quantity=plus_minus(max(sigmas), "mm"), remark="worst direction", headline=True
                )
            ]
    return []


def workpiece_places(session: Session, result: Result) -> list[AtWorkpiece]:
    """Return what a result's frames mean at the workpiece."""
    return at_workpiece(session, result.model_dump(mode="json"))


def _at(what: str, mount: str) -> str:
    return message("{what}, mounting {mount}", what=what, mount=mount) if mount else what


def workpiece_table(places: Sequence[AtWorkpiece], table: str = "Turntable") -> list[AnyBlock]:
    """Return what the uncertainty means where it matters, one row a place; `table` is what carries the object."""
    words = {**templates({"tool": "Scanner, in its view", "both": "Both together"}), "table": table}
    rows: list[Row] = []
    for place in places:
        at = ", ".join(number_text(value, 0) for value in place.point_mm)
        sigmas = [*place.sigmas_mm, place.worst_sigma_mm]
        decimals = plus_minus(place.worst_sigma_mm, "").decimals
        shown = [plus_minus(sigma, "").model_copy(update={"decimals": decimals}) for sigma in sigmas]
        rows.append(Row(cells=[_at(words[place.of], place.where), at, *shown]))
    if not rows:
        return []
    heads = [Column(label="Known by", align="left"), Column(label="Point", unit="mm")]
    heads += [Column(label=label, unit="mm") for label in ("x", "y", "z", "Worst direction")]
    return [
        Table(
            id="workpiece",
            title="At the workpiece",
            caption="How far off a point may lie by this calibration alone (k = 2), along the axes of what it is "
            "known by. The robot's own error at each pose comes on top.",
            columns=heads,
            rows=rows,
        )
    ]


def _in_degrees(parts: VarianceComponents) -> dict[str, float]:
    """Return the standard deviations that are not zero by name, angles in degrees."""
    found: dict[str, float] = {}
    for name, value in parts.model_dump().items():
        if "_sigma_" in name and isinstance(value, float) and value:
            in_degrees = name.replace("_rad", "_deg")
            found[in_degrees] = float(np.rad2deg(value)) if in_degrees != name else value
    return found


def noise_table(parts: VarianceComponents, more: Iterable[tuple[str, Quantity, str]] = ()) -> Table:
    """Return the standard deviations that the answer rests on, and where they come from."""
    sigmas = _in_degrees(parts)
    order = [name for name in _NOISE_LABELS if name in sigmas] + [
        name for name in sigmas if name not in _NOISE_LABELS
    ]
    rows: list[Row] = []
    for name in order:
        label, unit = _NOISE_LABELS.get(name) or label_of(name)
        estimated = name.startswith("alike") or any(
            one.partition("_")[0] == name.partition("_")[0] for one in parts.estimated
        )
        rows.append(
            Row(
                cells=[
                    label,
                    quantity(sigmas[name], unit),
                    message("estimated") if estimated else message("given"),
                ]
            )
        )
    rows += [Row(cells=[label, shown, origin]) for label, shown, origin in more]
    heads = [
        Column(label="Source", align="left"),
        Column(label="Standard deviation"),
        Column(label="From", align="left"),
    ]
    return Table(id="noise", title="Noise", columns=heads, rows=rows)


def provenance(result: Result) -> list[AnyBlock]:
    """Return where the numbers come from."""
    return [
        Figure(title="Where it comes from", detail=True, label="Method", text=result.method),
        Figure(detail=True, label="Software", text=result.software),
        Figure(detail=True, label="SHA-256 of the inputs", text=result.inputs_sha256),
    ]
