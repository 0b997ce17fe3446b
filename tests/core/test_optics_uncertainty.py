"""What camera and plane of light are not known to: answers move by it as their covariances say."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from calib_core.captures.content import sphere_of
from calib_core.captures.frame_uncertainty import (
    MovedCalibration,
    chain_with_optics,
    moved_calibrations,
    optics_errors,
)
from calib_core.captures.observe import observe_capture
from calib_core.chain.moved import shift_by, spread_of
from calib_core.chain.observations import SphereObservation, SphereSize, TableObservation
from calib_core.chain.table_given import KnownTool
from calib_core.chain.tcp import solve_tcp
from calib_core.chain.turntable import solve_turntable
from calib_core.chain.whole import ChainSolution, solve_chain
from calib_core.frames import FloatArray, RigidTransform
from calib_core.guidance.budget import budget, calibrated_rows, covariances, together
from calib_core.guidance.calibrated import Calibrated, View
from calib_core.guidance.field import at_points
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.triangulate import ProfileCalibration
from calib_core.records import Session
from calib_core.simulation import simulate
from calib_core.sphere.circle import circle_step
from calib_core.stages.chain.result import chain_result
from calib_core.stages.turntable.solve import table_options

NAMES = ("fx", "fy", "cx", "cy", "k1")
SIGMAS = np.array([0.6, 0.6, 0.8, 0.8, 2e-4, 4e-6, 6e-6, 6e-6])
PLACE_MM = np.array([40.0, -20.0, 80.0])


@dataclass
class Cell:
    """A cell whose profiles a camera saw: what was observed, by a calibration, and how that may err."""

    session: Session
    sphere: SphereSize
    still: list[SphereObservation]
    turning: list[TableObservation]
    optics: ProfileCalibration
    covariance: FloatArray

    def solved(self, optics: ProfileCalibration | None = None) -> ChainSolution:
        """The whole chain, by another calibration than the frames were seen by."""
        still = [self.seen_by(o, optics) for o in self.still]
        turning = [replace(o, sphere=self.seen_by(o.sphere, optics)) for o in self.turning]
        tcp = solve_tcp(still, self.sphere)
        options = table_options(self.session.cell)
        table = solve_turntable(turning, self.sphere, KnownTool(tcp.joint.mount_from_laser, tcp.held), options)
        return solve_chain(still, turning, self.sphere, tcp, table, options)

    def seen_by(self, observation: SphereObservation, optics: ProfileCalibration | None) -> SphereObservation:
        """What the same pixels show."""
        if optics is None:
            return observation
        points = optics.points(self.pixels(observation.points_in_laser_mm))
        x, _, z = observation.center_in_laser_mm
        circle = circle_step(points[:, [0, 2]], np.array([x, z, observation.circle_radius_mm])).parameters
        middle = np.array([circle[0], 0.0, circle[1]])
        return replace(
            observation,
            points_in_laser_mm=points,
            center_in_laser_mm=middle,
            circle_radius_mm=float(circle[2]),
        )

    def pixels(self, points: FloatArray) -> FloatArray:
        """Where the camera sees points of L."""
        return self.optics.camera.project(self.optics.camera_from_laser.apply(points))

    def drawn(self, rng: np.random.Generator) -> ProfileCalibration:
        """A calibration as its covariance lets it be."""
        return self.moved(np.linalg.cholesky(self.covariance) @ rng.standard_normal(len(self.covariance)))

    def moved(self, step: FloatArray) -> ProfileCalibration:
        """The calibration with other numbers."""
        matrix, lens = self.optics.camera.camera_matrix.copy(), self.optics.camera.distortion.copy()
        matrix[[0, 1, 0, 1], [0, 1, 2, 2]] += step[:4]
        lens[0] += step[4]
        plane = self.optics.normal / self.optics.distance_mm + step[5:]
        length = float(np.linalg.norm(plane))
        camera = CameraModel(matrix, lens, image_size=self.optics.camera.image_size)
        return ProfileCalibration.of(camera, plane / length, 1 / length)

    def directions(self) -> list[MovedCalibration]:
        """The calibration moved along each independent direction."""
        return moved_calibrations(self.optics, NAMES, self.covariance)


@pytest.fixture(scope="module")
def cell() -> Cell:
    made = simulate("turntable", 2)
    matrix = np.array([[2200.0, 0, 960], [0, 2200, 600], [0, 0, 1]])
    camera = CameraModel(matrix, np.array([-0.08, *[0.0] * 13]), image_size=(1920, 1200))
    optics = ProfileCalibration.of(camera, np.array([0.0, np.cos(0.5), np.sin(0.5)]), 90.0)
    correlated = np.eye(8)
    correlated[3, 6] = correlated[6, 3] = 0.8  # the plane follows the camera's principal point
    correlated[1, 7] = correlated[7, 1] = -0.5
    seen = [(c, observe_capture(made.session, c, made.files.__getitem__)) for c in made.session.captures]
    return Cell(
        made.session,
        sphere_of(made.session.cell, made.session.captures),
        [o for c, o in seen if c.step == "tcp"],
        [
            TableObservation(o, float(np.deg2rad(c.table_deg or 0.0)), c.mount or "")
            for c, o in seen
            if c.step == "turntable"
        ],
        optics,
        correlated * np.outer(SIGMAS, SIGMAS),
    )


@pytest.fixture(scope="module")
def alone(cell: Cell) -> ChainSolution:
    return cell.solved()


@pytest.fixture(scope="module")
def whole(cell: Cell, alone: ChainSolution) -> ChainSolution:
    count = len(cell.still) + len(cell.turning)
    point = alone.tcp.in_view.seen_mm
    errors = optics_errors(alone.tcp.held, np.ones(count, dtype=bool), cell.optics, cell.directions(), point)
    return chain_with_optics(alone, errors)


def length(vector: FloatArray) -> float:
    return float(np.linalg.norm(vector))


def result_of(cell: Cell, solution: ChainSolution) -> dict[str, Any]:
    return chain_result(solution, cell.turning, "here", "0" * 64, []).to_json()


@pytest.mark.thorough
def test_answers_move_with_the_optics_as_if_all_were_solved_again(cell: Cell, whole: ChainSolution) -> None:
    moved = cell.drawn(np.random.default_rng(2))
    there, held = cell.solved(moved), whole.tcp.held
    step = shift_by(held, moved.points(cell.pixels(held.data.points)))
    by_unknowns = whole.turntable.covariance.pose_by_unknowns
    tool = whole.tcp.joint.mount_from_laser.difference(there.tcp.joint.mount_from_laser)
    table = whole.turntable.frame.base_from_turntable.difference(there.turntable.frame.base_from_turntable)
    # By optics that are off, captures seem to share errors of the arm: on the way to the tool that is best with
    # the poses as told, which that answer's own covariance states, nothing foretells it.
    as_told = there.tcp.held.by_poses
    assert whole.tcp.held.by_poses is None
    assert as_told is not None
    assert np.linalg.eigvalsh(there.tcp.held.covariance - np.outer(as_told, as_told))[0] > -1e-9
    tool, table = tool - as_told[:6], table - by_unknowns @ as_told[9 : 9 + by_unknowns.shape[1]]
    assert np.linalg.norm(tool[3:]) > 0.2  # mm: more than rounding and other sigmas do
    assert step[3:6] == pytest.approx(tool[3:], abs=0.06 * length(tool[3:]))
    assert step[:3] == pytest.approx(tool[:3], abs=0.06 * length(tool[:3]))
    expected = by_unknowns @ step[9 : 9 + by_unknowns.shape[1]]
    assert expected == pytest.approx(table, rel=0.03, abs=1e-6)


def test_directions_are_the_whole_covariance(cell: Cell, alone: ChainSolution, whole: ChainSolution) -> None:
    held, size = alone.tcp.held, len(alone.tcp.held.covariance)
    pixels = cell.pixels(held.data.points)
    columns = [shift_by(held, cell.moved(0.1 * step).points(pixels)) / 0.1 for step in np.diag(SIGMAS)]
    slopes = np.column_stack(columns) / SIGMAS
    expected = slopes @ cell.covariance @ slopes.T
    added = whole.tcp.held.covariance - held.covariance
    assert added[:6, :6] == pytest.approx(expected[:6, :6], rel=0.05, abs=0.02 * np.abs(expected[3:6, 3:6]).max())
    assert spread_of(whole.tcp.beside.optics, size) == pytest.approx(added)
    assert [error.source for error in whole.tcp.beside.optics] == ["camera"] * 5 + ["plane"] * 3


def test_a_scan_errs_with_the_tool_that_the_same_optics_gave(cell: Cell, whole: ChainSolution) -> None:
    known = Calibrated.of(result_of(cell, whole))
    tool, seen, table = known.mount_from_laser, known.point_in_laser_mm, known.base_from_turntable
    assert table is not None
    view, small = View(tool.rotation, 0.3), 0.1
    rows, _ = calibrated_rows(known, view, PLACE_MM)
    turn = RigidTransform.of([0.0, 0.0, known.direction * 0.3], [0.0] * 3, "turntable", "turntable")
    # The flange stands where the scanner sees the place.
    flange = (table @ turn).apply(PLACE_MM) - view.rotation @ tool.apply(seen)
    by_unknowns = whole.turntable.covariance.pose_by_unknowns
    size = slice(9, 9 + by_unknowns.shape[1])
    for column, error in zip(rows.T[-len(whole.tcp.beside.optics) :], whole.tcp.beside.optics, strict=True):
        other = tool.perturbed(error.step[:6] * small)
        found = view.rotation @ other.apply(seen + error.point_mm * small) + flange
        moved = table.perturbed(by_unknowns @ error.step[size] * small)
        shift = ((moved @ turn).inverse().apply(found) - PLACE_MM) / small
        assert shift == pytest.approx(column, abs=0.02 * length(column) + 1e-4)


def test_the_budget_tells_camera_and_plane(cell: Cell, alone: ChainSolution, whole: ChainSolution) -> None:
    before, known = Calibrated.of(result_of(cell, alone)), Calibrated.of(result_of(cell, whole))
    view = View(np.eye(3), 0.3)
    parts, without = covariances(known, view, PLACE_MM), covariances(before, view, PLACE_MM)
    assert parts.keys() - without.keys() == {"camera", "plane"}
    for name in without:
        assert parts[name] == pytest.approx(without[name], abs=1e-9)
    apart = together(before, view, PLACE_MM) + parts["camera"] + parts["plane"]
    assert together(known, view, PLACE_MM) == pytest.approx(apart, abs=1e-9)
    told = budget(known, [view], PLACE_MM.tolist())
    assert {part.name for part in told.parts if part.shared} >= {"camera", "plane"}
    views = [view, View(known.mount_from_laser.rotation, -1.2)]
    one, many = at_points(known, views, np.array([PLACE_MM, -PLACE_MM]))
    apiece = budget(known, views, PLACE_MM.tolist())
    assert 2 * np.sqrt(np.linalg.eigvalsh(one[0])[-1]) == pytest.approx(apiece.uncertainty_mm, rel=1e-9)
    assert 2 * np.sqrt(np.linalg.eigvalsh(many[0])[-1]) == pytest.approx(apiece.shared_uncertainty_mm, rel=1e-9)
    # Where the sphere was seen, tool and points largely cancel.
    added = whole.tcp.in_view.at_point - alone.tcp.in_view.at_point
    tool = spread_of(whole.tcp.beside.optics, len(whole.tcp.held.covariance))[3:6, 3:6]
    assert np.linalg.eigvalsh(added)[0] > -1e-12
    assert np.trace(added) < np.trace(tool)
