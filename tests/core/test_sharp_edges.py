"""Edges of a nominal, where the means of voxels lie on no face."""

import numpy as np
import pytest

from calib_core.fusion.sharp_edges import near_sharp_edges
from calib_core.records import parse_session
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.pipeline import run
from tests.merge_sets import merge_session, scan_set
from tests.point_files import mesh_file
from tests.shapes import SHAPES, ball, box


def cylinder(radius_mm: float, facets: int) -> tuple[np.ndarray, np.ndarray]:
    """The side of a cylinder of 40 mm, without its ends."""
    angle = np.linspace(0, 2 * np.pi, facets, endpoint=False)
    ring = radius_mm * np.column_stack([np.cos(angle), np.sin(angle)])
    corners = np.concatenate([np.column_stack([ring, np.full(facets, z)]) for z in (-20.0, 20.0)])
    here, ahead = np.arange(facets), np.roll(np.arange(facets), -1)
    low = np.column_stack([here, ahead, facets + here])
    return corners, np.concatenate([low, np.column_stack([ahead, facets + ahead, facets + here])])


def test_places_within_a_voxel_of_a_boxs_edges_are_found_and_no_others() -> None:
    part = box((60.0, 40.0, 30.0))
    rng = np.random.default_rng(5)
    across = np.concatenate([rng.uniform(-30, 30, (3000, 1)), rng.uniform(-20, 20, (3000, 1))], axis=1)
    top = np.column_stack([across, np.full(3000, 15.0)])
    from_edge = np.minimum(30 - np.abs(across[:, 0]), 20 - np.abs(across[:, 1]))
    found = near_sharp_edges(top, part.points_mm, part.triangles, 0.8)
    assert found[from_edge < 0.8].all()
    assert not found[from_edge > 0.83].any()


@pytest.mark.parametrize(
    ("radius_mm", "facets", "bent"), [(20.0, 90, False), (5.0, 90, False), (0.4, 90, True), (1.6, 20, False)]
)
def test_a_rounding_counts_as_an_edge_where_it_is_smaller_than_the_voxels(
    radius_mm: float, facets: int, bent: bool
) -> None:
    corners, triangles = cylinder(radius_mm, facets)
    on_it = np.array([[radius_mm, 0.0, z] for z in (-10.0, 0.0, 10.0)])
    assert near_sharp_edges(on_it, corners, triangles, 0.5).all() == bent


def test_a_stl_that_names_each_corner_in_each_face_has_the_same_edges() -> None:
    part = box()
    apart = part.points_mm[part.triangles].reshape(-1, 3)
    loose = np.arange(len(apart)).reshape(-1, 3)
    places = np.random.default_rng(2).uniform(-30, 30, (2000, 3))
    whole = near_sharp_edges(places, part.points_mm, part.triangles, 1.0)
    assert np.array_equal(near_sharp_edges(places, apart, loose, 1.0), whole)
    assert not near_sharp_edges(places, ball().points_mm, ball().triangles, 0.3).any()


@pytest.mark.parametrize("shape", ["box", "sheet"])
def test_means_across_edges_and_thin_walls_are_no_deviations(shape: str) -> None:
    """With poses that are right all that is left is noise, of 0.02 mm: before it was 0.05 mm and more."""
    there = scan_set(shape, 6, pitch_mm=1.0, position_sigma_mm=1e-4, orientation_sigma_rad=1e-6)
    record, files = merge_session(there, voxel_mm=1.0, reference="part.stl", alignment="none")
    files["part.stl"] = mesh_file("stl", there.part.points_mm, SHAPES[shape]().triangles)
    merge = run(parse_session(record, "session"), files.__getitem__, "merge")["merge"]
    assert isinstance(merge, MergeResult)
    assert merge.verdict != "fail"  # one scan sees the sheet's edge alone: patches as coarse as that refused it
    assert merge.deviation is not None
    assert merge.deviation.rms_mm < 1.2 * 0.02
    assert merge.deviation.across_edges > 100
    assert merge.deviation.within_95_mm < 2.4 * 0.02
