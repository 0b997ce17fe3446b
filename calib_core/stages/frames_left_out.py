"""Frames that a gate dropped, in evidence: which gate, how many, what was looked for, one of them to see."""

from collections.abc import Iterator, Sequence
from typing import Final

from calib_core.evidence.words import captures_text
from calib_core.findings import Finding, reasons_of
from calib_core.findings.codes import camera
from calib_core.findings.judgement import places_in
from calib_core.messages import Value, message, templates
from calib_core.records import Session
from calib_core.records.camera_result import CameraResult
from calib_core.records.evidence import AnyBlock, Column, Picture, Row, Table
from calib_core.records.laser_plane_result import LaserPlaneResult
from calib_core.stages.evidence_parts import left_out
from calib_core.stages.hand_eye.record import HandEyeResult

_BOARD: Final = (camera.FRAME_NOT_USED.name, camera.BOARD_NOT_AS_TOLD.name)
_LOOKED_FOR: Final = templates({
    "view-not-used": "corners where the camera of all other views expects them",
    "line-off-plane": "a line on the plane of the others",
    "no-line-on-board": "the points of one straight line on the board",
})  # fmt: skip
_GATES: Final = templates({
    "frame-not-used": "Frame shows what is needed",
    "board-not-as-told": "Board as told",
    "view-not-used": "Corners agree with other views",
    "line-off-plane": "Line in the plane of the others",
    "no-line-on-board": "Line on the board",
})  # fmt: skip
_COLUMNS: Final = (
    Column(label="Gate", align="left"),
    Column(label="Frames"),
    Column(label="Captures", align="left"),
    Column(label="Looked for", align="left"),
    Column(label="Found", align="left"),
)


def frames_left_out(session: Session, result: CameraResult | LaserPlaneResult | HandEyeResult) -> list[AnyBlock]:
    """Return one row a gate that dropped frames with a picture of its first one, then what else is not used."""
    rows = result.residuals
    dropped = {row.capture for row in rows if not row.used}
    gates = [
        one for one in result.findings if one.code in (*_BOARD, *_LOOKED_FOR) and dropped.issuperset(one.captures)
    ]
    named = {capture for one in gates for capture in one.captures}
    others = left_out([row for row in rows if row.capture not in named])
    if not gates:
        return others
    order = [row.capture for row in rows]
    table = Table(
        id="gates",
        title="Frames left out",
        caption="What each gate looked for and found instead, in the first of its frames where they differ.",
        columns=list(_COLUMNS),
        rows=[_row(one, order) for one in gates],
    )
    return [table, *(picture for one in gates for picture in _pictures(session, one)), *others]


def _looked_for(gate: Finding) -> Value:
    return places_in(gate)["need"] if gate.code in _BOARD else _LOOKED_FOR[gate.code]


def _row(gate: Finding, order: Sequence[str]) -> Row:
    names = gate.captures
    found = places_in(gate)["got"] if gate.code in _BOARD else reasons_of([gate])[names[0]]
    told = captures_text(names, order), str(_looked_for(gate)), str(found)
    return Row(cells=[str(_GATES[gate.code]), len(names), *told], capture=names[0] if len(names) == 1 else None)


def _pictures(session: Session, gate: Finding) -> Iterator[Picture]:
    """Give the files of a gate's first frame: of a board with the line on it, the lit board comes first."""
    name = gate.captures[0]
    first = next((one for one in session.captures if one.id == name), None)
    alt = message(
        "{capture}, dropped by “{gate}”. Looked for: {need}.",
        capture=name,
        gate=_GATES[gate.code],
        need=_looked_for(gate),
    )
    for file in first.files if first else ():
        yield Picture(capture=name, file=file, alt=alt)
