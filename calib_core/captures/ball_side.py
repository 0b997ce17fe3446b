"""On which side of the ball its captures lie: whether z of L grows away from the scanner or toward it."""

from typing import Literal

import numpy as np

from calib_core.captures.observe import see_sphere
from calib_core.cell.carriers import scanner_told
from calib_core.errors import CalibrationError
from calib_core.records import Session
from calib_core.records.callbacks import ReadFile
from calib_core.sphere.arc import ArcFit
from calib_core.steps import steps_that_show

_ENOUGH, _MOST_READ = 5, 12
_CLEAR = 0.2  # of the radius: how far before its centre the middle of the seen part must lie


def side_of_ball(session: Session, read: ReadFile) -> Literal[1, -1] | None:
    """Return 1 where captures of the ball show z growing away from the scanner, −1 where toward it.

    None where there are none, where they do not agree, or where `z_axis` was told of every scanner.
    """
    steps = steps_that_show("sphere", "sphere-on-table")
    every = [c for c in session.captures if c.step in steps and c.kind != "center" and not c.excluded]
    captures = [c for c in every if scanner_told(session.cell, c).z_axis is None]
    sides: list[int] = []
    for capture in captures[:_MOST_READ]:
        try:
            seen = see_sphere(session, capture, read)
        except CalibrationError:
            continue  # its own stage says what is wrong with it
        fit = seen.fit
        if isinstance(fit, ArcFit):
            sides.append(fit.visible_side)
        else:
            before = float(fit.center_mm[2] - np.mean(seen.points[seen.on_sphere, 2]))
            if abs(before) > _CLEAR * fit.radius_mm:
                sides.append(1 if before > 0 else -1)
        if len(sides) == _ENOUGH:
            break
    if not sides or len(set(sides)) > 1:
        return None
    return 1 if sides[0] > 0 else -1
