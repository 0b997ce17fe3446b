"""How boards before a known camera are bent: by their corners alone, where held-out views say so."""

from collections.abc import Sequence

import numpy as np

from calib_core.optics.adjust import Adjustment, shape_start
from calib_core.optics.board import BoardView
from calib_core.optics.board_shape import BoardShape
from calib_core.optics.camera_choice import choose_layout
from calib_core.optics.camera_layout import Layout
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.laser_plane_joint import HUBER, CameraUncertainty
from calib_core.optics.laser_plane_solve import posed_corners

_LEAST_VIEWS = 6
_FOLDS = 5


def bend_of(camera: CameraModel, views: Sequence[BoardView], flat: bool | None) -> CameraUncertainty | None:
    """Return how a board is bent, to be refined with the plane of light; None: it is flat, or nothing tells.

    Parameters
    ----------
    camera : CameraModel
        Exact.
    views : sequence of BoardView
    flat : bool or None
        What is told of the board; None: held-out views decide.
    """
    if flat or len(views) < _LEAST_VIEWS or not all(view.is_numbered for view in views):
        return None
    corners, state = posed_corners(camera, views)
    _, near, far = camera.bands
    known = Layout(camera.model, near, far, np.zeros(0, np.int64))
    layout, _ = choose_layout(corners, state, [known], _FOLDS, None if flat is None else True)
    if not layout.bends:
        return None
    end = Adjustment(corners, near, far, layout.free, HUBER).solve(state)
    start = shape_start(len(near))
    shape = BoardShape(end.state.shared[start : start + 7].copy(), corners.extent_mm)
    return CameraUncertainty(layout.free, end.covariance, (), shape)
