"""Further arcs in a profile: other balls of a plate or bar that the plane of light meets at once."""

from collections.abc import Iterator

import numpy as np

from calib_core.captures.content import diameter_in_sight_mm, pose_of
from calib_core.captures.observe import arc_observation, see_sphere
from calib_core.cell.carriers import scanner_told
from calib_core.chain.observations import SphereObservation
from calib_core.errors import MeasurementError
from calib_core.records import Capture, ReadFile, Session
from calib_core.sphere.arc import ArcFit, fit_arc

_MOST = 4
_BORDER = 1.1  # of a circle's radius: what lies within is its own ball's
_AS_SMOOTH = 3.0  # an arc that is rougher than the first by more is no ball


def further_arcs(session: Session, capture: Capture, read: ReadFile) -> Iterator[SphereObservation]:
    """Give the arcs of a profile beside the clearest one, each as the solvers take it."""
    if capture.kind not in ("profile", "frame"):
        return
    first = see_sphere(session, capture, read)
    cell, told = session.cell, scanner_told(session.cell, capture)
    left, last = first.points.copy(), first.fit
    if not isinstance(last, ArcFit):
        return
    for _ in range(_MOST - 1):
        off = np.hypot(*(left - last.center_mm).T)
        left[off < _BORDER * last.radius_mm] = np.nan
        try:
            last = fit_arc(left, diameter_in_sight_mm(cell, capture), told.z_axis)
        except MeasurementError:
            return
        if last.rms_mm > _AS_SMOOTH * first.fit.rms_mm:
            return
        yield arc_observation(cell, capture, pose_of(cell, capture), left[last.inliers], last, first.without_ray)
