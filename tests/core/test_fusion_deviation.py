"""Deviations from a reference: known shifts come back with their sign, from an open mesh and from a sphere."""

import numpy as np
import pytest

from calib_core.errors import InputError, MeasurementError
from calib_core.fusion.deviation import histogram, mesh_deviations, sphere_deviations
from calib_core.simulation.part import build_part

CELL_MM = np.array([900.0, -300.0, 200.0])


def test_points_off_an_open_plate_have_the_side_of_its_normal() -> None:
    corners = np.array([[0, 0, 0], [40, 0, 0], [40, 30, 0], [0, 30, 0]], dtype=float) + CELL_MM
    rng = np.random.default_rng(1)
    off = rng.uniform(-0.5, 0.5, 500)
    points = np.column_stack([rng.uniform(1, 39, 500), rng.uniform(1, 29, 500), off]) + CELL_MM
    found = mesh_deviations(points, corners, [[0, 1, 2], [0, 2, 3]])
    assert found.values_mm == pytest.approx(off, abs=2e-5)  # single precision of 50 mm
    assert found.rms_mm == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-4)
    assert found.largest_mm(1.0) == pytest.approx(np.abs(off).max(), rel=1e-4)
    beside = mesh_deviations([[945.0, -290.0, 200.0]], corners, [[0, 1, 2], [0, 2, 3]])
    assert abs(beside.values_mm[0]) == pytest.approx(5.0, abs=1e-4)
    with pytest.raises(InputError, match="triangles"):
        mesh_deviations(points, corners, np.zeros((0, 3), dtype=int))


def test_a_blown_up_part_lies_outside_of_itself() -> None:
    part = build_part()
    a, b, c = (part.points_mm[part.triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    middles = (a + b + c) / 3
    lifted = mesh_deviations(middles + 0.05 * normals, part.points_mm, part.triangles)
    assert np.median(lifted.values_mm) == pytest.approx(0.05, abs=1e-4)
    assert np.mean(lifted.values_mm > 0) > 0.99
    sunk = mesh_deviations(middles - 0.05 * normals, part.points_mm, part.triangles)
    assert np.median(sunk.values_mm) == pytest.approx(-0.05, abs=1e-4)


def test_the_sphere_among_other_points_counts_alone() -> None:
    rng = np.random.default_rng(2)
    normal = rng.normal(size=(6000, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    noise = rng.normal(0, 0.02, 6000)
    ball = [40.0, -20.0, 90.0] + normal * (15.0 + noise)[:, None]
    plate = np.column_stack([rng.uniform(0, 80, 2000), rng.uniform(-60, 20, 2000), np.zeros(2000)])
    found = sphere_deviations(np.concatenate([ball, plate]), 30.0)
    assert found.center_mm == pytest.approx([40.0, -20.0, 90.0], abs=0.002)
    assert np.isnan(found.values_mm[6000:]).all()
    assert found.counted > 5990
    assert found.values_mm[:6000][np.isfinite(found.values_mm[:6000])].std() == pytest.approx(0.02, rel=0.05)
    assert sphere_deviations(ball).radius_mm == pytest.approx(15.0, abs=0.002)
    with pytest.raises(MeasurementError):
        sphere_deviations(plate, 30.0)


def test_the_histogram_counts_every_value_once() -> None:
    values = np.array([-9.0, -0.4, 0.0, 0.0, 0.2, 7.0, np.nan])
    counts = histogram(values, 0.5, bins=5)
    assert counts.tolist() == [2, 0, 2, 1, 1]
