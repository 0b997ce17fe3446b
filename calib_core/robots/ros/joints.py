"""The order of an arm's joints in a JointState, which lists them in any order, often by the alphabet."""

import math
import re

from calib_core.messages import message, plural

_UR = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")


def in_order(names: list[str], positions: list[float]) -> tuple[float, ...]:
    """Return the arm's angles in degrees, first joint first.

    Raises
    ------
    ValueError
        If the names do not tell the order, with a phrase.
    """
    if len(names) != len(positions):
        raise ValueError(
            plural(
                "{count} name of joints with {count_other} positions",
                "{count} names of joints with {count_other} positions",
                by="count",
                count=len(names),
                count_other=len(positions),
            )
        )
    known = dict(zip(names, positions, strict=True))
    by_part = [[n for n in names if n.removesuffix("_joint").endswith(part)] for part in _UR]
    if all(len(found) == 1 for found in by_part):
        return tuple(math.degrees(known[found[0]]) for found in by_part)
    numbered = {
        int(m[1]): n for n in names if (m := re.search(r"(?:joint|axis|[aj])_?([1-9])(?!\d)[a-z_]*$", n, re.I))
    }
    if len(numbered) != len(names) or sorted(numbered) != list(range(1, len(names) + 1)):
        raise ValueError(
            message(
                "the names {names} do not tell the order of the joints: none are taken", names=", ".join(names[:8])
            )
        )
    return tuple(math.degrees(known[numbered[k]]) for k in sorted(numbered))
