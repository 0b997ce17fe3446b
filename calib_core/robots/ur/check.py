"""Universal Robots: moves from pose to pose as a program."""

from calib_core.exports.check_move import CheckSettings
from calib_core.exports.check_programs import Moves, check_export
from calib_core.exports.writing import fixed


def _pose(pose: list[float]) -> str:
    return "p[" + ", ".join(fixed(v, 9) for v in pose) + "]"


def _tool_check(tool: list[float]) -> list[str]:
    """Return the lines that end the program where the active TCP is not the answer, by 0.05 mm or 0.0005 rad."""
    told = "The active TCP is not the calibrated tool. Enter it and make it active."
    return [
        "  # the TCP is the active one: enter it and make it active first",
        f"  off = pose_trans(pose_inv(get_tcp_offset()), {_pose(tool)})",
        "  if norm([off[0], off[1], off[2]]) > 0.00005 or norm([off[3], off[4], off[5]]) > 0.0005:",
        f'    popup("{told}", error=True, blocking=True)',
        "    halt",
        "  end",
    ]


def _program(moves: Moves, settings: CheckSettings) -> list[str]:
    lines = [f"def scancell_{moves.name}():", *(f"  # {line}" for line in moves.comments)]
    if moves.tool is None:
        lines.append("  set_tcp(p[0, 0, 0, 0, 0, 0])")
    else:
        lines += _tool_check(moves.tool)
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
