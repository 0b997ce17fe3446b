"""Universal Robots' URScript."""

from collections.abc import Mapping, Sequence

from calib_core.robots.programs.program import HEAD, Plan, Program, number


def _pose(pose: Sequence[float]) -> str:
    return "p[" + ", ".join(number(v, 8) for v in pose) + "]"


def write(plan: Plan) -> Mapping[str, str]:
    """Return the script; its poses are in metres and rotation vectors, of the flange."""
    fields = f' + " {plan.fields}"' if plan.fields else ""
    lines = [
        "def scancell_captures():",
        *(f"  # {line}" for line in HEAD),
        "  def answered():",
        '    said = socket_read_line("cell", timeout=20)',
        "    textmsg(said)",
        '    if str_find(said, "OK") != 0:',
        '      popup(said, title="scancell", warning=True, blocking=True)',
        "    end",
        "  end",
        "  def shot(name):",
        "    sleep(0.5)",
        f'    socket_send_line(name + " " + to_str(get_actual_tool_flange_pose()){fields}, "cell")',
        "    answered()",
        "  end",
        "  set_tcp(p[0, 0, 0, 0, 0, 0])",
        f'  if not socket_open("{plan.host}", {plan.port}, "cell"):',
        '    popup("The workbench does not listen", title="scancell", error=True, blocking=True)',
        "    halt",
        "  end",
        f'  socket_send_line("{plan.token}", "cell")',
        "  answered()",
    ]
    speed = f"a=0.2, v={plan.speed_mm_s / 1000:.3f}"
    for stop in plan.stops:
        lines += [
            f'  popup("{stop.name}: is the way to the approach free?", title="scancell", blocking=True)',
            f"  movel({_pose(stop.approach)}, {speed})",
            f"  movel({_pose(stop.pose)}, {speed})",
            f'  shot("{stop.name}")',
            f"  movel({_pose(stop.approach)}, {speed})",
        ]
    lines += ['  socket_send_line("done", "cell")', "  answered()", '  socket_close("cell")', "end"]
    return {"scancell.script": "\n".join(lines) + "\n"}


PROGRAM = Program("urscript", "Universal Robots URScript", "ur", write)
