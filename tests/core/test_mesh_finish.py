"""Meshes made ready: open edges are counted, holes closed, and flat places have few triangles."""

import numpy as np
import pytest
import trimesh

from calib_core.errors import CalibrationError
from calib_core.fusion.deviation import Nominal
from calib_core.fusion.mesh import Mesh, poisson_mesh
from calib_core.fusion.mesh_finish import closed, open_edges, sharpened, thinned
from calib_core.fusion.solve import MergeOptions, solve_merge
from calib_core.records import parse_session
from tests.merge_sets import scan_set


def mesh_of(theirs: trimesh.Trimesh) -> Mesh:
    return Mesh(np.asarray(theirs.vertices, np.float32), np.asarray(theirs.faces, np.int32))


def theirs(mesh: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.points_mm, mesh.triangles, process=False)


BALL = mesh_of(trimesh.creation.icosphere(subdivisions=4, radius=20.0))


@pytest.mark.thorough
def test_edges_are_as_sharp_as_the_planes_beside_them_and_round_places_stay_round() -> None:
    there = scan_set("box", 0, count=8, pitch_mm=0.6, position_sigma_mm=0.0, orientation_sigma_rad=0.0)
    found = solve_merge(there.scans, None, MergeOptions(1.0, "none"))
    cloud = found.grid.cloud()
    rounded = poisson_mesh(cloud, 1.0)
    sharp = sharpened(rounded, cloud, 1.0)
    edge = np.array([[0.0, y, z] for y in (-20.0, 20.0) for z in (-15.0, 15.0)]) + [
        [[x, 0, 0]] for x in range(-20, 21)
    ]

    def below_mm(mesh: Mesh) -> float:
        return float(np.median(np.abs(Nominal(mesh.points_mm, mesh.triangles).distances_mm(edge.reshape(-1, 3)))))

    assert below_mm(sharp) < 0.35 * below_mm(rounded)
    assert sharpened(BALL, cloud, 1.0).points_mm[100] == pytest.approx(BALL.points_mm[100])
    moved = np.linalg.norm(sharp.points_mm - rounded.points_mm, axis=1)
    inner = (np.abs(rounded.points_mm) < [25, 15, 10]).sum(axis=1) == 2  # amid a face
    assert (moved[inner].max(), moved.max() <= 0.75 + 1e-5) == (0.0, True)


def test_open_edges_are_those_without_just_one_partner_that_runs_back() -> None:
    assert open_edges(BALL.triangles) == 0
    assert open_edges(BALL.triangles[1:]) == 3
    assert open_edges(np.concatenate([BALL.triangles, BALL.triangles[:1, [0, 2, 1]]])) > 0
    turned = BALL.triangles.copy()
    turned[5] = turned[5, [0, 2, 1]]
    assert open_edges(turned) > 0
    assert open_edges(np.zeros((0, 3), np.int32)) == 0


def test_holes_are_filled_and_the_rest_stays() -> None:
    middles = BALL.points_mm[BALL.triangles].mean(axis=1)
    gone = (middles[:, 2] > 17) | (np.linalg.norm(middles - [20, 0, 0], axis=1) < 4)
    gone[np.flatnonzero(~gone)[:3]] = True
    opened = Mesh(BALL.points_mm, BALL.triangles[~gone])
    assert open_edges(opened.triangles) > 20
    whole = closed(opened)
    assert open_edges(whole.triangles) == 0
    assert theirs(whole).is_watertight
    assert theirs(whole).volume == pytest.approx(theirs(BALL).volume, rel=0.06)
    kept = {tuple(np.sort(row.round(3), axis=0).ravel()) for row in opened.points_mm[opened.triangles]}
    assert kept <= {tuple(np.sort(row.round(3), axis=0).ravel()) for row in whole.points_mm[whole.triangles]}


def test_an_edge_of_three_triangles_and_holes_that_touch_are_mended() -> None:
    fin = np.array([[BALL.triangles[0, 0], BALL.triangles[0, 1], len(BALL.points_mm)]], np.int32)
    finned = Mesh(np.vstack([BALL.points_mm, np.float32([[0, 0, 40]])]), np.concatenate([BALL.triangles, fin]))
    assert open_edges(closed(finned).triangles) == 0
    corner = 7  # two of its triangles that share no edge: two rings through one corner
    around = np.flatnonzero((BALL.triangles == corner).any(axis=1))
    apart = next(k for k in around[1:] if len(set(BALL.triangles[k]) & set(BALL.triangles[around[0]])) == 1)
    touching = np.delete(BALL.triangles, [around[0], apart], axis=0)
    assert open_edges(closed(Mesh(BALL.points_mm, touching)).triangles) == 0


def test_fewer_triangles_lie_within_the_tolerance() -> None:
    box = trimesh.creation.box((30.0, 20.0, 10.0)).subdivide_to_size(1.0)
    few = thinned(mesh_of(box), 0.01)
    assert len(few.triangles) < 0.02 * len(box.faces)
    assert theirs(few).volume == pytest.approx(6000, rel=1e-3)
    for tolerance_mm in (0.05, 0.2):
        ball = thinned(BALL, tolerance_mm)
        assert len(ball.triangles) < len(BALL.triangles)
        middles = ball.points_mm[ball.triangles].mean(axis=1)
        off = np.abs(np.linalg.norm(np.vstack([ball.points_mm, middles]), axis=1) - 20.0)
        assert off.max() <= tolerance_mm + 0.03  # BALL's own middles lie so far inside


@pytest.mark.thorough
def test_a_bowl_seen_from_above_is_closed_where_that_is_asked() -> None:
    scans = scan_set("bowl", 3, count=4, views="above", pitch_mm=1.5).scans
    left, filled = (solve_merge(scans, None, MergeOptions(1.5, "poisson", fill)).mesh for fill in (False, True))
    assert left is not None
    assert filled is not None
    assert open_edges(left.triangles) > 0
    assert open_edges(filled.triangles) == 0
    assert theirs(filled).is_watertight


def test_sheets_that_overlap_are_not_closed() -> None:
    cell = {"pose_convention": "matrix", "merge": {"mesh": "grid", "holes": "fill"}}
    with pytest.raises(CalibrationError, match="poisson"):
        parse_session({"name": "p", "cell": cell}, "session")
