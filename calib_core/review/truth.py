"""A simulated cell's truth beside what its results state: as blocks, for reports and the command line."""

from collections.abc import Mapping
from typing import Any

from calib_core.errors import InputError
from calib_core.evidence.numbers import fixed, quantity
from calib_core.records import Session
from calib_core.records.evidence import AnyBlock, Column, Row, Table
from calib_core.review.compare import Compared, FrameDifference, differences_from_truth


def off_the_truth(session: Session, result: Mapping[str, Any], truth: Mapping[str, Any]) -> list[FrameDifference]:
    """Return how far a result's frames lie from the truth; none where it has no frames."""
    return differences_from_truth(Compared(session.name, dict(result), session), truth)


def truth_blocks(session: Session, result: Mapping[str, Any], truth: Mapping[str, Any]) -> list[AnyBlock]:
    """Return a result beside the truth as a table, none where it has no frames."""
    try:
        frames = off_the_truth(session, result, truth)
    except InputError:
        if result.get("verdict") != "fail":
            raise
        frames = []  # what explains nothing may have a covariance that is none
    if not frames:
        return []
    columns = [
        Column(label="Frame", align="left"),
        Column(label="Turned"),
        Column(label="Shifted"),
        Column(label="At the workpiece"),
        Column(label="Distance", unit="σ", decimals=2),
        Column(label="Chance"),
    ]
    return [
        Table(
            id="truth",
            title="Beside the truth",
            caption="The cell is simulated: its truth is known, and no solver saw it. Off at the workpiece by so "
            "much, ± what the result states (k = 2); chance: how often a right answer is as far off or farther.",
            columns=columns,
            rows=_rows(frames),
        )
    ]


def _rows(frames: list[FrameDifference]) -> list[Row]:
    return [
        Row(
            cells=[
                frame.frame,
                fixed(frame.angle_deg, 4, "°"),
                fixed(frame.shift_mm, 3, "mm"),
                quantity(frame.at_workpiece_mm, "mm", frame.at_workpiece_sigma_mm),
                frame.distance,
                fixed(100 * frame.chance, 0, "%"),
            ]
        )
        for frame in frames
    ]
