"""Whether a camera's boards tell the distortion where none was seen: a note where they do, a warning where not."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib_core.captures.boards import frames_not_used
from calib_core.errors import MeasurementError
from calib_core.evidence.html import blocks_html
from calib_core.findings import Finding
from calib_core.frames import FloatArray
from calib_core.optics.board import BoardView
from calib_core.optics.camera import calibrate_camera
from calib_core.optics.camera_evidence import camera_findings, coverage_findings
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.camera_solution import CameraSolution
from calib_core.optics.extrapolation import extrapolation, sigmas_in_light
from calib_core.optics.laser_plane_solve import PlaneSolution
from calib_core.optics.projection_map import projection_difference
from calib_core.records import Capture, Session
from calib_core.records.camera_result import CameraCoverage, CameraResidual, CameraResult
from calib_core.records.evidence import Picture, Table
from calib_core.stages.camera.evidence import image_map
from calib_core.stages.frames_left_out import frames_left_out
from calib_core.stages.laser_plane.solve import not_covered

SIZE = (1280, 960)
MATRIX = np.array([[1300.0, 0, 645], [0, 1300, 475], [0, 0, 1]])
LENS = CameraModel.from_names(MATRIX, {"k1": -0.25, "k2": 0.12, "k3": -0.03}, SIZE)
BOARD = np.array([[x, y, 0.0] for y in range(6) for x in range(8)]) * 8
CORNERS = [(0.12, 0.14), (0.88, 0.14), (0.12, 0.86), (0.88, 0.86), (0.5, 0.5)]
MIDDLE = [(0.4, 0.4), (0.6, 0.4), (0.4, 0.6), (0.6, 0.6), (0.5, 0.5)]


def calibrated(places: Sequence[tuple[float, float]], seed: int, stretched: float = 1.0) -> CameraSolution:
    """Return the camera of 15 views of a board whose middle stands at these places of the image, in turn.

    `stretched`: so many times its pitch along the columns is told.
    """
    rng = np.random.default_rng(seed)
    views: list[BoardView] = []
    while len(views) < 15:
        place = np.array(places[len(views) % len(places)]) * SIZE
        turned = BOARD @ Rotation.from_rotvec(rng.uniform(-0.6, 0.6, 3)).as_matrix().T
        ray = np.append((place - MATRIX[:2, 2]) / 1300, 1.0) * rng.uniform(300, 400)
        pixels: FloatArray = LENS.project(turned - turned.mean(0) + ray)
        if (pixels > 0).all() and (pixels < SIZE).all():
            noisy = pixels + rng.normal(0, 0.05, pixels.shape)
            views.append(BoardView(noisy, BOARD * [1.0, stretched, 1.0], np.arange(len(BOARD)), SIZE, 0.05))
    return calibrate_camera(views, SIZE)


def findings(places: Sequence[tuple[float, float]], seed: int) -> list[Finding]:
    found = camera_findings(calibrated(places, seed))
    return [one for one in found if one.code.startswith("image-")]


@pytest.mark.parametrize("seed", [1, 2])
def test_boards_in_the_corners_tell_the_whole_image_and_those_in_the_middle_do_not(seed: int) -> None:
    (told,) = findings(CORNERS, seed)
    assert (told.code, told.severity) == ("image-covered-in-part", "note")
    # Lenses of two terms, as the middle asks for, state an even ±, and are 20 px off in the corners.
    (warned,) = findings(MIDDLE, seed)
    assert (warned.code, warned.severity) == ("image-not-covered", "warning")


@pytest.mark.parametrize(("aside", "warned"), [(0.0, []), (-0.4, ["image-not-covered"])])
def test_of_an_image_covered_in_part_what_the_plane_of_light_is_seen_in_counts(
    aside: float, warned: list[str]
) -> None:
    """Boards stand along the image's upright middle line; a plane is seen there, another near the left edge."""
    solved = calibrated([(0.5, 0.2), (0.5, 0.5), (0.5, 0.8)], 1)
    alone, followed = (
        [one.code for one in camera_findings(solved, plane_follows) if one.code.startswith("image-")]
        for plane_follows in (False, True)
    )
    assert (alone, followed) == (["image-not-covered"], ["image-covered-in-part"])
    light = np.array([np.cos(0.5), 0.0, np.sin(0.5)]), 350 * float(np.sin(0.5) + aside * np.cos(0.5))
    used_px = sigmas_in_light(LENS, solved.coverage.projection_sigma_px, light, (300.0, 400.0))
    found = coverage_findings(0.25, extrapolation(used_px), float(used_px.max()))
    assert [one.code for one in found if one.severity == "warning"] == warned


@pytest.mark.thorough
def test_the_map_of_uncertainty_holds_the_difference_to_the_truth() -> None:
    shares = []
    for seed in (1, 2, 3):
        solved = calibrated(CORNERS, seed)
        shares.append(projection_difference(solved.camera, LENS) / solved.coverage.projection_sigma_px)
    assert 0.5 < np.sqrt(np.square(shares).mean()) < 1.6
    assert projection_difference(LENS, LENS).max() < 1e-6


def test_a_gate_is_told_with_its_count_what_it_looked_for_and_a_picture() -> None:
    captures = [Capture(id=f"b{k}", step="camera", kind="frame", files=[f"b{k}.png"]) for k in range(3)]
    session = cast("Session", SimpleNamespace(captures=captures))
    failed = {name: MeasurementError("the whole board", "no board", "Light it.") for name in ("b1", "b2")}
    result = SimpleNamespace(
        residuals=[CameraResidual(capture=f"b{k}", used=k == 0, reason="no board") for k in range(3)],
        findings=frames_not_used(failed, 1),
    )
    blocks = frames_left_out(session, cast("CameraResult", result))
    table, picture = blocks
    assert isinstance(table, Table)
    assert isinstance(picture, Picture)
    assert table.rows[0].cells == ["Frame shows what is needed", 2, "b1 and b2", "the whole board", "no board"]
    assert (picture.capture, picture.file) == ("b1", "b1.png")
    assert '<img src="data:b1.png"' in blocks_html(blocks, address="data:{}".format)
    assert "<img" not in blocks_html(blocks)


def test_a_camera_of_before_the_projections_uncertainty_was_kept_covers_what_it_covered() -> None:
    """Its plane of light is solved again as any: the answer of the camera is not of today's form."""
    old = CameraCoverage(counts=[[1]], covered=0.5, near_mm=300.0, far_mm=400.0, largest_tilt_rad=0.5)
    camera, plane = (
        SimpleNamespace(coverage=old),
        SimpleNamespace(camera=LENS, normal=np.array([0.88, 0.0, 0.48]), distance_mm=168.0),
    )
    assert not_covered(cast("CameraResult", camera), cast("PlaneSolution", plane)) == []


def test_rows_of_a_map_are_counted_from_one() -> None:
    rows = [series.label for series in image_map([[1.0], [2.0]], "map", "Map", "").series]
    assert [str(label) for label in rows] == ["row 1", "row 2"]
