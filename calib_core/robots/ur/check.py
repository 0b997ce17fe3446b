"""Universal Robots: moves from pose to pose as a program."""

from calib_core.exports.check_move import CheckSettings
from calib_core.exports.check_programs import Moves, check_export
from calib_core.exports.writing import fixed


def _pose(pose: list[float]) -> str:
    return "p[" + ", ".join(fixed(v, 9) for v in pose) + "]"


def _program(moves: Moves, settings: CheckSettings) -> list[str]:
    lines = [f"def scancell_{moves.name}():", *(f"  # {line}" for line in moves.comments)]
    if moves.tool is None:
        lines.append("  set_tcp(p[0, 0, 0, 0, 0, 0])")
    else:
        lines.append("  # the TCP is the active one: enter it and make it active first")
    speed = f"a=0.1, v={settings.speed_mm_s / 1000:.3f}"
    for stop in moves.stops:
        lines += [
            f'  popup("{stop.title}: is the way to the approach free?", blocking=True)',
            f"  movel({_pose(stop.approach)}, {speed})",
            f'  popup("{stop.title}: go to {moves.goal}?", blocking=True)',
            f"  movel({_pose(stop.target)}, {speed})",
            f'  popup("{stop.title}: {moves.to_do}, then go back", blocking=True)',
            f"  movel({_pose(stop.approach)}, {speed})",
        ]
    return [*lines, "end"]


CHECK = check_export("ur", "Universal Robots", ".script", "ur", CheckSettings, _program)
