"""Cells that err as the solver believes of cells, each error drawn from its prior, by a forward model apart.

A stated covariance is a statement about such cells: over cells whose scanners, arms and spheres err so, the
squared errors must be the stated variances. A cell without any of these errors does better than is stated.
"""

from dataclasses import dataclass

import numpy as np

from calib_core.arms.alike import REACH_MM, REACH_RAD
from calib_core.chain.chain_data import ARM_SCALE_SIGMA, DRIFT_SIGMA_MM
from calib_core.chain.scanner import ScannerPriors
from calib_core.frames import FloatArray
from calib_core.guidance.budget import known_offset, stated, within_95
from calib_core.guidance.calibrated import Calibrated, View
from calib_core.guidance.design import SIGMAS
from calib_core.records import Session
from calib_core.robots import parse_pose
from calib_core.simulation.motion import turn
from calib_core.stages.pipeline import solve_stage
from tests.trouble import TableTrouble, Troubled, troubled
from tests.trouble.table_cell import TablePlan

_WAVES = 200  # of a random field: enough that it is Gaussian
_HALF_WIDTH_MM = 38.0  # how far from its middle these cells' scanner sees the sphere
_DIAMETER_SIGMA_MM = 0.002
_FROM_BASE_MM = np.array(
    [1000.0, 0.0, 400.0]
)  # about where the cells stand: an arm's lengths are compared from there


@dataclass(eq=False)
class ArmField:
    """An arm's smooth errors: the same at the same pose, alike where poses are alike; and its length scale."""

    rng: np.random.Generator

    def __post_init__(self) -> None:
        """Draw the field: a sum of waves over positions and orientations, by the spectrum of its covariance."""
        rng = self.rng
        self.of_place = rng.standard_normal((_WAVES, 3)) / REACH_MM
        self.of_turn = rng.standard_normal((_WAVES, 9)) / (np.sqrt(2) * REACH_RAD)
        self.phases = rng.uniform(0, 2 * np.pi, _WAVES)
        sizes = np.array([SIGMAS.alike_position_mm] * 3 + [SIGMAS.alike_orientation_rad] * 3)
        self.amplitudes = rng.standard_normal((_WAVES, 6)) * sizes * np.sqrt(2 / _WAVES)
        self.scale = ARM_SCALE_SIGMA * float(rng.standard_normal())

    def reached(self, commanded: FloatArray) -> FloatArray:
        """Return where a commanded pose (4, 4) leads."""
        waves = np.cos(self.of_place @ commanded[:3, 3] + self.of_turn @ commanded[:3, :3].ravel() + self.phases)
        error = waves @ self.amplitudes
        found = np.eye(4)
        found[:3, :3] = turn(error[3:]) @ commanded[:3, :3]
        from_there = commanded[:3, 3] - _FROM_BASE_MM
        found[:3, 3] = commanded[:3, 3] + error[:3] - self.scale * from_there
        return found


@dataclass(eq=False)
class Believed:
    """One such cell: its session, files and tool, the plan it was made by, and its arm's errors."""

    made: Troubled
    plan: TablePlan
    field: ArmField


def believed(seed: int) -> Believed:
    """Return a cell of a scanner, an arm and a sphere that err as is believed of them, with the makers' sigmas."""
    rng = np.random.default_rng([seed, 4711])
    field, priors = ArmField(rng), ScannerPriors()
    x, z, shear = rng.standard_normal(3) * [priors.scale, priors.scale, priors.shear]
    bow = float(rng.standard_normal()) * priors.bow
    shapes = rng.standard_normal(3) * priors.incidence_mm
    drift = rng.standard_normal(3) * DRIFT_SIGMA_MM
    radius = float(rng.standard_normal()) / 2
    plans: list[TablePlan] = []

    def scanner(p: FloatArray, _: np.random.Generator) -> FloatArray:
        return p - np.column_stack(
            [x * p[:, 0] + shear * p[:, 1], z * p[:, 1] + bow * p[:, 0] ** 2 / _HALF_WIDTH_MM]
        )

    def surface(angle: FloatArray, _: np.random.Generator) -> FloatArray:
        square = np.sin(angle) ** 2
        return np.column_stack([square - 0.3, square**2 - 0.15, square**4 - 0.05]) @ shapes

    def change(plan: TablePlan, _: np.random.Generator) -> None:
        count = plan.shifts + plan.tilts + len(plan.heights_mm) * len(plan.angles_deg)

        def led(pose: FloatArray, k: int, _: np.random.Generator) -> FloatArray:
            found = field.reached(pose)
            found[:3, 3] -= drift * (2 * k / (count - 1) - 1)  # the sphere's, seen from the flange
            return found

        plan.scanner, plan.surface, plan.pose_error = scanner, surface, led
        plan.told_diameter_mm, plan.told_diameter_sigma_mm = 2 * plan.radius_mm, _DIAMETER_SIGMA_MM
        plan.radius_mm += _DIAMETER_SIGMA_MM * radius
        plans.append(plan)

    return Believed(troubled(TableTrouble("as believed", change), seed, told=True), plans[0], field)


def measured(seed: int, points: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return of points of one such cell's workpiece errors (N, 3), stated covariances (N, 3, 3), intervals (N, 3).

    The workpiece lies in T as the table stands in truth; the arm, which errs there too, measures it.
    """
    cell = believed(seed)
    made, plan, field = cell.made, cell.plan, cell.field
    known = Calibrated.of(solve_stage(made.session, "chain", made.files.__getitem__).to_json())
    assert known.base_from_turntable is not None
    rng = np.random.default_rng([seed, 4713])
    poses, table = _on_table(made.session), made.true_base_from_turntable
    solved_tool, solved_table = known.mount_from_laser.matrix, known.base_from_turntable.matrix
    errors: list[FloatArray] = []
    covariances: list[FloatArray] = []
    halves: list[FloatArray] = []
    for _ in range(points):
        rotation = poses[rng.integers(len(poses))][:3, :3]
        place = np.array([*rng.uniform(-100, 100, 2), rng.uniform(0, 160)])
        seen = np.array([rng.uniform(-20, 20), 0.0, rng.uniform(150, 220)])
        angle = float(rng.uniform(0, 2 * np.pi))
        there = (table @ np.append(turn([0, 0, angle]) @ place, 1.0))[:3]
        own = turn(rng.standard_normal(3) * plan.orientation_rad)
        reported = np.eye(4)
        reported[:3, :3] = rotation
        reported[:3, 3] = there - rotation @ (made.tool0_from_laser @ np.append(seen, 1.0))[:3]
        for _ in range(3):  # the operator moves until the scanner sees the point there
            reached = field.reached(reported)
            reached[:3, :3] = reached[:3, :3] @ own
            reported[:3, 3] += there - (reached @ made.tool0_from_laser @ np.append(seen, 1.0))[:3]
        reported[:3, 3] += rng.standard_normal(3) * plan.position_mm
        straight_on = float(plan.surface(np.zeros(1), rng)[0])  # the sphere's points err so where light meets it
        x, z = made.scanner(seen[None, [0, 2]] - [0.0, straight_on])[0]
        told = np.array([x, 0.0, z + rng.standard_normal() * plan.point_mm, 1.0])
        read = angle + rng.standard_normal() * plan.encoder_rad
        in_table = (np.linalg.inv(solved_table) @ reported @ solved_tool @ told)[:3]
        errors.append(turn([0, 0, -known.direction * read]) @ in_table - place)
        view = View(rotation, known.direction * read, seen)
        covariances.append(stated(known, view, place))
        halves.append(within_95(known_offset(known, view, place)[None], covariances[-1][None]))
    return np.array(errors), np.array(covariances), np.array(halves)


def _on_table(session: Session) -> list[FloatArray]:
    convention = session.cell.pose_convention
    return [parse_pose(convention, c.pose or []).matrix for c in session.captures if c.step == "turntable"]
