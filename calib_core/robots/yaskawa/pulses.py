"""Pulses of jobs as joints: how many make a degree stands in the same backup's parameters (ALL.PRM, RC.PRM).

Group RCnG holds, ten numbers a line, each axis' gear as a denominator and a numerator, 4096 pulses a turn of the
motor; a sign there is the motor's. In a public backup of a GP25 the soft limits, which the same group holds in
pulses, are by them those of its data sheet. Of older controllers it is known from a third party's program alone.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from calib_core.messages import message
from calib_core.robots.controller_file import Found, Taught

_TURN = 4096.0
_GEARS = ((200, 1090, 1100), (100, 972, 980))
"""Lines that a group has at least, and where the first denominator and numerator are: YRC, then older ones."""
_SIX = 6


@dataclass
class Pulses(Found):
    """What a file of Yaskawa's holds besides: positions whose joints are pulses still, and what makes a degree."""

    pulses: list[Taught] = field(default_factory=list[Taught])
    group: int = 1
    per_degree: dict[int, tuple[float, ...]] = field(default_factory=dict[int, tuple[float, ...]])


def per_degree_of(text: str) -> dict[int, tuple[float, ...]]:
    """Return how many pulses make a degree of each of six axes, by the robot's number, as far as a file tells."""
    found: dict[int, tuple[float, ...]] = {}
    for group, body in re.findall(r"^///RC(\d)G\s*\n((?:[-+\d.,\s]+\n?)*)", text, re.MULTILINE):
        lines = body.split()
        row = next((row for row in _GEARS if len(lines) >= row[0]), None)
        values = [
            float(one) for line in lines for one in line.split(",") if re.fullmatch(r"[-+]?\d+(\.\d+)?", one)
        ]
        if row is None or len(values) != 10 * len(lines):
            continue
        below, above = (values[start : start + _SIX] for start in row[1:])
        if all(below) and all(above):
            each = zip(above, below, strict=True)
            found[int(group)] = tuple(_TURN * abs(a / b) / 360.0 for a, b in each)
    return found


def with_joints(found: Sequence[Found]) -> Sequence[Found]:
    """Return what files hold, positions in pulses as joints where one of them tells what makes a degree."""
    parts = [part for part in found if isinstance(part, Pulses)]
    known = {group: each for part in parts for group, each in part.per_degree.items()}
    for part in parts:
        for taught in part.pulses:
            pulses, each = taught.joints_deg or (), known.get(part.group)
            if each is None or len(pulses) != _SIX:
                why = _ALONE if each is None else message("pulses of six axes are supported")
                part.skip(taught.line, message("{what}: {why}", what=taught.name, why=why), taught.name)
            else:
                joints = tuple(value / one for value, one in zip(pulses, each, strict=True))
                part.poses.append(replace(taught, joints_deg=joints))
        part.poses.sort(key=lambda taught: taught.line)
    return found


_ALONE = message(
    "pulses alone, no pose: how many make a degree stands in ALL.PRM or RC.PRM of the same backup; give one of "
    "these as well, or record Cartesian positions (POSTYPE BASE)"
)
