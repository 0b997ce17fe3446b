"""Planes of light that must not be used: each reason by itself, and frames whose laser was off."""

from dataclasses import replace

import numpy as np
import pytest

from calib_core.optics.camera_model import CameraModel
from calib_core.optics.laser_plane_solve import PlaneSolution, solve_plane
from calib_core.records.laser_plane_result import LaserPlaneResult
from calib_core.simulation.frame_cell import (
    FrameScenario,
    as_png,
    board_views,
    build_cell,
    exposure_for,
    simulate_frames,
)
from calib_core.simulation.frames import render
from calib_core.stages.laser_plane.solve import noticed
from calib_core.stages.pipeline import solve_stage
from tests.core.test_optics_plane import views

MATRIX = np.array([[900.0, 0, 320.0], [0, 905.0, 240.0], [0, 0, 1]])
CAMERA = CameraModel.from_names(MATRIX, {"k1": -0.12, "k2": 0.08, "p1": 4e-4}, (640, 480))


@pytest.fixture(scope="module")
def sound() -> PlaneSolution:
    return solve_plane(CAMERA, views(1))


def test_a_sound_plane_has_no_failure(sound: PlaneSolution) -> None:
    assert noticed(sound, 0.1) == []


def test_figures_that_are_not_finite_fail(sound: PlaneSolution) -> None:
    for spoiled in (
        replace(sound, distance_mm=np.nan),
        replace(sound, covariance=np.full((4, 4), np.inf)),
        replace(sound, rms_mm=np.nan),
    ):
        assert [one.code for one in noticed(spoiled, 0.1)] == ["plane-not-determined"]
    assert noticed(sound, np.nan)[0].code == "plane-not-determined"


def test_a_plane_through_the_cameras_centre_fails(sound: PlaneSolution) -> None:
    covariance = sound.covariance.copy()
    covariance[3, 3] = 0.9**2
    near = replace(sound, distance_mm=0.005, covariance=covariance)
    (found,) = noticed(near, 0.1)
    assert "through the camera's centre within its uncertainty (0.01 ± 1.80 mm)" in found.text
    assert noticed(replace(near, distance_mm=2.8), 0.1) == []


def test_a_normal_that_is_hardly_known_fails(sound: PlaneSolution) -> None:
    (found,) = noticed(sound, 2.1)
    assert "±4.2°" in found.text
    assert found.severity == "error"


def test_most_measurable_lines_rejected_fails(sound: PlaneSolution) -> None:
    """Of eight boards two have no line; of the six that can be measured four lie off."""
    reasons = ["no-line"] * 2 + ["off-plane"] * 4 + [None] * 2
    seen = tuple(replace(v, left_out=r) for v, r in zip(sound.views, reasons, strict=True))
    (found,) = noticed(replace(sound, views=seen), 0.1)
    assert found.text.startswith("4 of 6 lines lie off")
    half = tuple(
        replace(v, left_out=r) for v, r in zip(sound.views, [*reasons[:5], None, None, None], strict=True)
    )
    assert noticed(replace(sound, views=half), 0.1) == []


@pytest.mark.thorough
def test_frames_with_the_laser_off_among_good_ones_are_refused_as_such() -> None:
    """Two frames of the board taken before the laser was on, under the light of the others."""
    options = FrameScenario("four boards with the stripe", plane_views=4, knows_calibration=True)
    session, files, truth = simulate_frames(options, "laser-plane", 3)
    rng = np.random.default_rng([3, 31_415])
    cell = build_cell(options, rng)
    record = session.to_json()
    del record["cell"]["known"]["laser_plane"]
    for index, board in enumerate(board_views(2, np.random.default_rng(8))):
        name = f"captures/off{index}.png"
        files[name] = as_png(render(cell.camera, [board], None, exposure_for(options, cell, 90.0), rng))
        record["captures"].append({"id": f"off{index}", "step": "laser-plane", "kind": "frame", "files": [name]})
    result = solve_stage(type(session).model_validate(record), "laser-plane", files.__getitem__)
    assert isinstance(result, LaserPlaneResult)
    rows = {row.capture: row for row in result.residuals}
    assert all("no laser line" in (rows[f"off{k}"].reason or "") for k in range(2))
    assert [one.captures for one in result.findings if one.code == "no-line-on-board"] == [["off0", "off1"]]
    assert sum(row.used for row in rows.values()) >= 3
    angle = np.arccos(np.clip(np.dot(result.plane_in_camera.normal, truth["plane_in_camera"]["normal"]), -1, 1))
    assert angle < 4 * np.deg2rad(result.normal_sigma_deg)
