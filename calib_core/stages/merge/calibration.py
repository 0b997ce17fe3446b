"""The calibration that a merge goes by: tool and table, their covariance, and how it moves each scan."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.captures.scans import Placement, ScanGroup, poses_of
from calib_core.cell.found import as_used, known_scanner, no_scanner, on_flange
from calib_core.errors import InputError
from calib_core.findings.codes import merge as codes
from calib_core.frames import FloatArray, RigidTransform
from calib_core.fusion.overlap import PoseErrors, move_of_pose_change
from calib_core.fusion.self_calibration import SelfCalibration
from calib_core.graph.stage_input import StageInput
from calib_core.records import Cell, Finding, VarianceComponents
from calib_core.records.results import ArmModelFound
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.merge.record import SharedShift
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.turntable.record import TurntableResult

CALIBRATION_SHARE = 0.2
"""Of a merge's progress."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Where scans belong, the covariance (12, 12) of tool and table, the scatters of robot and table, the arm."""

    placement: Placement
    covariance: FloatArray
    position_sigma_mm: float
    orientation_sigma_rad: float
    angle_sigma_rad: float
    by: str = "known"
    findings: tuple[Finding, ...] = ()
    arm: ArmModelFound | None = None

    @property
    def tells_scatter(self) -> bool:
        """Whether it says how far scans may lie apart."""
        return bool(self.by != "known" or self.position_sigma_mm or self.orientation_sigma_rad)


def calibration_of_session(given: StageInput, with_table: bool) -> Calibration:
    """Return tool and table: brought by the user, or solved from the session's own captures."""
    known, steps = given.session.cell.known, {c.step for c in given.session.captures if not c.excluded}
    scanner = known_scanner(given.session.cell)
    table_to_solve = known.base_from_turntable is None and "turntable" in steps
    if with_table and known.base_from_turntable is None and not table_to_solve:
        raise InputError(
            "the turntable, since scans have a table angle",
            "neither captures with step 'turntable' nor cell.known.base_from_turntable",
            "Capture the sphere on the table, or give base_from_turntable with the cell.",
            "captures",
        )

    def tell(fraction: float, what: str) -> None:
        given.progress(CALIBRATION_SHARE * fraction, what)

    stage = ("turntable" if scanner else "chain") if table_to_solve else "tcp"
    if not table_to_solve and scanner is not None:
        return _calibration_of(given.session.cell, None)
    if not table_to_solve and "tcp" not in steps:
        raise no_scanner("the scanner's pose on the flange")
    result = given.solve_other(stage, tell)
    assert isinstance(result, TcpResult | TurntableResult | ChainResult)
    return _calibration_of(given.session.cell, result)


def _calibration_of(cell: Cell, result: TcpResult | TurntableResult | ChainResult | None) -> Calibration:
    """Return the calibration out of what the user brings and what was solved."""
    tool = result.mount_from_laser if result else known_scanner(cell)
    table, direction, scale = cell.known.base_from_turntable, cell.turntable.direction or 1, 1.0
    covariance = np.zeros((12, 12))
    scatter = (cell.robot.position_sigma_mm or 0.0, cell.robot.orientation_sigma_rad or 0.0)
    angle_deg = cell.turntable.angle_sigma_deg or 0.0
    findings: list[Finding] = []
    if result is not None:
        parts: VarianceComponents = result.variance_components
        scatter = (parts.position_sigma_mm, parts.orientation_sigma_rad)
        if result.verdict == "fail":
            findings.append(codes.CALIBRATION_FAILED(stage=result.stage))
    used = as_used(result.model_dump()) if result is not None else {}
    if isinstance(result, TurntableResult | ChainResult):
        table, direction, angle_deg = used["base_from_turntable"], result.direction, result.angle_sigma_deg
        scale += result.encoder_scale.error if result.encoder_scale.applied else 0.0
        # The turntable's covariance holds the tool's share where there is no joint one.
        covariance[6:, 6:] = used.get("turntable_covariance", used["covariance"])
    if isinstance(result, TcpResult | ChainResult):
        covariance[:6, :6] = used["covariance"]
    if isinstance(result, ChainResult):
        covariance[:6, 6:] = used["cross_covariance"]
        covariance[6:, :6] = np.transpose(used["cross_covariance"])
    base_from_turntable = None if table is None else RigidTransform.from_rounded(table, "base", "turntable")
    assert tool is not None, "the caller has seen to it"
    placement = Placement(tool, base_from_turntable, direction, scale)
    by: str = "known" if result is None else result.stage
    if not on_flange(tool):  # no robot moves it
        scatter = (0.0, 0.0)
    arm = getattr(result, "arm_model", None)
    return Calibration(placement, covariance, *scatter, float(np.deg2rad(angle_deg)), by, tuple(findings), arm)


def pose_errors(given: StageInput, groups: Sequence[ScanGroup], calibration: Calibration) -> PoseErrors:
    """Return how the calibration's uncertainty moves each scan in T.

    A sweep counts with its middle pose: the robot's error is taken to be the same along one sweep.
    """
    root = _root(calibration)
    common: list[FloatArray] = []
    own: list[FloatArray] = []
    for group in groups:
        pairs = poses_of(given.session, group)
        capture, pose = pairs[len(pairs) // 2]
        turntable_from_base = calibration.placement.turntable_from_base(capture)
        moves, mine = moves_of_scan(calibration, turntable_from_base, pose)
        common.append(moves @ root)
        own.append(mine)
    return PoseErrors(np.array(common), np.array(own))


def _root(calibration: Calibration) -> FloatArray:
    """Return the changes (12, 12) of tool and table by one sigma of independent errors, in columns."""
    values, vectors = np.linalg.eigh(calibration.covariance)
    return vectors * np.sqrt(np.maximum(values, 0))


def shared_shift(calibration: Calibration, found: SelfCalibration | None) -> SharedShift | None:
    """Return what the overlap moves of tool and table, out of units of their independent errors."""
    if found is None:
        return None
    root = _root(calibration)
    return SharedShift(
        directions=found.directions,
        shift=(root @ found.shift).tolist(),
        covariance=(root @ found.covariance @ root.T).tolist(),
    )


def moves_of_scan(
    calibration: Calibration, turntable_from_base: RigidTransform, base_from_tool0: RigidTransform
) -> tuple[FloatArray, FloatArray]:
    """Return the moves (6, 12) of a scan by tool and table, and the covariance (6, 6) of those of its own."""
    placement = calibration.placement
    turntable_from_tool0 = turntable_from_base @ base_from_tool0
    moves = np.zeros((6, 12))
    moves[:, :6] = _by_pose(turntable_from_tool0.rotation, turntable_from_tool0 @ placement.mount_from_laser)
    if placement.base_from_turntable is not None:
        # B·exp(r), t + δ: a point of T moves by −r × p − Bᵀδ, seen at the table's angle.
        turned = turntable_from_base.rotation @ placement.base_from_turntable.rotation
        moves[:3, 6:9] = -turned
        moves[3:, 9:] = -turntable_from_base.rotation
    sigmas = np.repeat([calibration.orientation_sigma_rad, calibration.position_sigma_mm], 3)
    robot = _by_pose(turntable_from_base.rotation, turntable_from_tool0) * sigmas
    own = robot @ robot.T
    own[2, 2] += calibration.angle_sigma_rad**2 if placement.base_from_turntable is not None else 0.0
    return moves, own


def _by_pose(into_from_added: FloatArray, pose: RigidTransform) -> FloatArray:
    """Return the moves (6, 6) by a pose in the middle of a chain that ends in `pose`.

    Its rotation perturbs in the frame that `pose` maps from, its translation in one that `into_from_added` (3, 3)
    turns into T.
    """
    change = np.zeros((6, 6))
    change[:3, :3], change[3:, 3:] = np.eye(3), into_from_added
    return move_of_pose_change(pose.matrix, change)
