"""Yaskawa INFORM: it has no sockets, so the job stands at each pose until an input says that it may go on.

The workbench takes the capture by itself once robot and stripe stand still (`automatic`); whoever sees its colour
and hears its sound, or a PLC that reads its answer, sets the input.
"""

from collections.abc import Mapping, Sequence

from calib_core.robots.programs.program import Plan, Program, number

_GO_ON_INPUT = 1


def _position(index: int, pose: Sequence[float]) -> str:
    digits = (3, 3, 3, 4, 4, 4)
    return f"P{index:05d}=" + ",".join(number(v, d) for v, d in zip(pose, digits, strict=True))


def write(plan: Plan) -> Mapping[str, str]:
    """Return the job; positions are those of tool 63, which must be the flange: zeros."""
    positions: list[str] = []
    steps = ["NOP", "'SCANCELL CAPTURES", "'MANUAL MODE, REDUCED SPEED", "'TOOL 63 IS THE FLANGE"]
    speed = f"V={plan.speed_mm_s:.1f} PL=0"
    for index, stop in enumerate(plan.stops):
        out, at = 2 * index, 2 * index + 1
        positions += [_position(out, stop.approach), _position(at, stop.pose)]
        steps += [
            f"'{stop.name[:20]}: WAY FREE?",
            "PAUSE",
            f"MOVL P{out:05d} {speed}",
            f"MOVL P{at:05d} {speed}",
            "TIMER T=0.50",
            f"WAIT IN#({_GO_ON_INPUT})=ON",
            f"WAIT IN#({_GO_ON_INPUT})=OFF",
            f"MOVL P{out:05d} {speed}",
        ]
    lines = [
        "/JOB",
        "//NAME SCANCELL",
        "//POS",
        f"///NPOS 0,0,0,{len(positions)},0,0",
        "///TOOL 63",
        "///POSTYPE BASE",
        "///RECTAN",
        "///RCONF 0,0,0,0,0,0,0,0",
        *positions,
        "//INST",
        "///DATE 2026/01/01 00:00",
        "///ATTR SC,RW,RJ",
        "////FRAME BASE",
        "///GROUP1 RB1",
        *steps,
        "END",
    ]
    return {"SCANCELL.JBI": "\r\n".join(lines) + "\r\n"}


PROGRAM = Program("inform", "Yaskawa INFORM", "yaskawa", write)
