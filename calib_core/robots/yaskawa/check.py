"""Yaskawa: the check move as a job."""

from collections.abc import Sequence

from calib_core.exports.check_programs import NumberedCheck, Sides, check_export
from calib_core.exports.writing import listed, remarks


def _program(comments: Sequence[str], sides: Sides, settings: NumberedCheck) -> list[str]:
    steps = [f"'{piece}" for line in comments for piece in remarks(line)]
    positions: list[str] = []
    speed = f"V={max(settings.speed_mm_s, 0.1):.1f} PL=0"
    for number, side in enumerate(sides):
        at, on = f"C{2 * number:05d}", f"C{2 * number + 1:05d}"
        positions += [f"{name}={listed(pose, 3, 4)}" for name, pose in zip((at, on), side, strict=True)]
        steps += [f"'side {number + 1}: is the way free?", "PAUSE", f"MOVL {at} {speed}", "PAUSE"]
        steps += [f"MOVL {on} {speed}", "'read the scanner now", "PAUSE", f"MOVL {at} {speed}"]
    head = ["/JOB", "//NAME SCANCHK", "//POS", f"///NPOS {len(positions)},0,0,0,0,0", f"///TOOL {settings.tool}"]
    head += ["///POSTYPE BASE", "///RECTAN", "///RCONF 0,0,0,0,0,0,0,0", *positions]
    return [*head, "//INST", "///ATTR SC,RW,RJ", "////FRAME BASE", "///GROUP1 RB1", "NOP", *steps, "END"]


CHECK = check_export("yaskawa", "Yaskawa", ".JBI", "yaskawa", NumberedCheck, _program)
