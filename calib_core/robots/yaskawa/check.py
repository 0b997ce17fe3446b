"""Yaskawa: moves from pose to pose as a job."""

from calib_core.exports.check_programs import Moves, NumberedCheck, check_export
from calib_core.exports.writing import listed, remarks


def _program(moves: Moves, settings: NumberedCheck) -> list[str]:
    steps = [f"'{piece}" for line in moves.comments for piece in remarks(line)]
    if moves.tool is None:
        steps += [f"'{piece}" for piece in remarks("by tool 0: see that it is the flange, all zeros")]
    positions: list[str] = []
    speed = f"V={max(settings.speed_mm_s, 0.1):.1f} PL=0"
    for number, stop in enumerate(moves.stops):
        at, on = f"C{2 * number:05d}", f"C{2 * number + 1:05d}"
        positions += [f"{name}={listed(pose, 3, 4)}" for name, pose in stop.named(at, on)]
        steps += [
            *(f"'{piece}" for piece in remarks(f"{stop.title}: is the way free?")),
            "PAUSE",
            f"MOVL {at} {speed}",
            "PAUSE",
        ]
        steps += [f"MOVL {on} {speed}", f"'{moves.to_do} now", "PAUSE", f"MOVL {at} {speed}"]
    tool = 0 if moves.tool is None else settings.tool
    head = [
        "/JOB",
        f"//NAME SCAN{moves.name[:4].upper()}",
        "//POS",
        f"///NPOS {len(positions)},0,0,0,0,0",
        f"///TOOL {tool}",
    ]
    head += ["///POSTYPE BASE", "///RECTAN", "///RCONF 0,0,0,0,0,0,0,0", *positions]
    return [*head, "//INST", "///ATTR SC,RW,RJ", "////FRAME BASE", "///GROUP1 RB1", "NOP", *steps, "END"]


CHECK = check_export("yaskawa", "Yaskawa", ".JBI", "yaskawa", NumberedCheck, _program)
