"""A transform that a result has as it is: an axis's frame in base."""

import numpy as np
import pytest

import calib_core as cc
from calib_core.errors import InputError
from calib_core.review.cell_frames import session_frames


def test_an_axis_that_another_stands_on_is_asked_for_in_base_and_base_in_it() -> None:
    session = cc.simulate("positioner", 1)[0].record
    known = np.diag([1e-8, 4e-8, 0.0, 0.01, 0.04, 0.09])
    tilt = {
        "name": "tilt",
        "kind": "rotary",
        "in": "base",
        "axis_direction": [0.6, 0.8, 0.0],
        "axis_point_mm": [900.0, -40.0, 200.0],
        "scale": 1.0,
        "covariance": known.tolist(),
    }
    chain = {
        "base_from_turntable": np.eye(4).tolist(),
        "turntable_covariance": np.eye(6).tolist(),
        "axes": [tilt, {**tilt, "name": "turn", "axis_point_mm": None}],
        "frames": [],
        "spheres": [{"in": "turn"}],
    }
    there = session_frames(session, {"chain": chain}, asked=("base", "tilt")).asked
    back = session_frames(session, {"chain": chain}, asked=("tilt", "base")).asked
    assert there is not None
    assert back is not None
    matrix = np.array(there.matrix)
    assert np.allclose(matrix[:3, 2], tilt["axis_direction"])
    assert np.allclose(matrix[:3, 3], tilt["axis_point_mm"])
    assert np.allclose(matrix @ np.array(back.matrix), np.eye(4), atol=1e-9)
    assert np.allclose(there.covariance, known)
    unknown = {"chain": {**chain, "axes": [{**tilt, "axis_point_mm": [float("nan")] * 3}]}}
    with pytest.raises(InputError):  # no number for a place that is left open
        session_frames(session, unknown, asked=("base", "tilt"))
