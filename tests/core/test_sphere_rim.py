"""The rim of a sphere in a camera's frame: where light a part of a millimetre thick is not seen whole."""

import numpy as np
import pytest

from calib_core.frames import FloatArray
from calib_core.sphere.arc import fit_arc, without_rim

RADIUS_MM = 20.0
EYE_MM = np.array([0.0, -110.0, 0.0])


def seen_arc(height_mm: float, half_rad: float) -> FloatArray:
    """Return an arc's points, drawn inwards where the camera looks along the surface, as a rendered stripe is."""
    circle_mm = float(np.sqrt(RADIUS_MM**2 - height_mm**2))
    turn = np.linspace(-half_rad, half_rad, 220)
    points = np.column_stack([circle_mm * np.sin(turn), 170.0 - circle_mm * np.cos(turn)])
    whole = np.insert(points, 1, 0.0, axis=1)
    rays = EYE_MM - whole
    outwards = (whole - [0.0, height_mm, 170.0]) / RADIUS_MM
    steep = np.rad2deg(np.arccos((outwards * rays).sum(axis=1) / np.linalg.norm(rays, axis=1)))
    drawn_mm = 0.05 * np.clip((steep - 74) / 8, 0, None) ** 2
    inwards = ([0.0, 170.0] - points) / circle_mm
    noise = np.random.default_rng(2).normal(0, 0.004, 220)
    return np.asarray(points + (drawn_mm + noise)[:, None] * inwards)


@pytest.mark.parametrize("side", [-1, 1])
def test_points_that_are_seen_along_the_surface_do_not_draw_the_circle(side: int) -> None:
    points = seen_arc(-10.0, 0.95)
    arc = fit_arc(points, 2 * RADIUS_MM)
    eye = EYE_MM * [1, side, 1]  # on which side of the light the sphere's middle lies is not known
    kept = without_rim(points, arc, RADIUS_MM, eye)
    true_mm = float(np.sqrt(RADIUS_MM**2 - 100))
    assert abs(arc.radius_mm - true_mm) > 0.02
    assert abs(kept.radius_mm - true_mm) < 0.006
    assert 0.6 < kept.inliers.sum() / arc.inliers.sum() < 0.95
    assert kept.extent_rad == arc.extent_rad, "how much of the arc is seen stays what it is"


def test_an_arc_that_is_all_rim_stays_as_it_is() -> None:
    points = seen_arc(-17.0, 0.9)
    arc = fit_arc(points, 2 * RADIUS_MM)
    assert without_rim(points, arc, RADIUS_MM, EYE_MM) is arc
