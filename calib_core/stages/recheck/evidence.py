"""What a recheck says of itself: how far the repeated captures lie from those of the calibration."""

from typing import Final

from calib_core.evidence.numbers import fixed, quantity
from calib_core.records import Session
from calib_core.records.evidence import AnyBlock, Axis, Column, Figure, Plot, Row, Series, Table
from calib_core.stages.capability import capability_of_rounds
from calib_core.stages.evidence_parts import captures_used, left_out, provenance, residual_table
from calib_core.stages.recheck.record import RecheckResult

_COLUMNS: Final = (
    ("repeats", "Repeats", ""),
    ("change_mm", "Change", "mm"),
    ("expected_mm", "Expected", "mm"),
    ("mahalanobis", "Distance", "σ"),
    ("pose_distance_mm", "Pose off by", "mm"),
    ("pose_turn_deg", "Pose off by", "°"),
)


def evidence(session: Session, result: RecheckResult) -> list[AnyBlock]:
    """Return the recheck told in blocks, the answer first."""
    return [
        Figure(label="The calibration", text="still holds" if result.holds else "no longer holds", headline=True),
        Figure(
            label="Change at the workpiece",
            quantity=quantity(result.change_mm, "mm", result.uncertainty_mm / 2),
            headline=True,
        ),
        Figure(label="An unchanged cell shows as much in", quantity=fixed(100 * result.rounds[-1].chance, 1, "%")),
        captures_used(result),
        *_rounds(result),
        *capability_of_rounds(session, result.rounds),
        *left_out(result.residuals),
        *residual_table(result.residuals, _COLUMNS),
        *provenance(result),
    ]


def _rounds(result: RecheckResult) -> list[AnyBlock]:
    """Return the rounds over time, where there are several."""
    if len(result.rounds) < 2:
        return []
    axes = zip("xyz", zip(*(one.change_in_laser_mm for one in result.rounds), strict=True), strict=True)
    rows = [
        Row(
            cells=[
                str(number),
                ", ".join(one.captures),
                quantity(one.change_mm, "mm", one.uncertainty_mm / 2),
                "no" if one.changed == "nothing" else "yes",
            ]
        )
        for number, one in enumerate(result.rounds, 1)
    ]
    columns = [
        Column(label="Round", align="left"),
        Column(label="Captures", align="left", own=True),
        Column(label="Change"),
    ]
    return [
        Table(
            id="rounds",
            title="Rounds",
            caption="Each round repeats poses of the calibration; the last one decides.",
            columns=[*columns, Column(label="Larger than noise", align="left")],
            rows=rows,
        ),
        Plot(
            shape="line",
            caption="The change along the scanner's axes, round by round: a warming scanner wanders, then stays.",
            x=Axis(label="Round"),
            y=Axis(label="Change", unit="mm"),
            series=[
                Series(label=name, x=[float(k + 1) for k in range(len(values))], y=list(values))
                for name, values in axes
            ],
        ),
    ]
