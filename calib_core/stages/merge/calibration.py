"""The calibration that a merge goes by: tool and table, their covariance, and how it moves each scan."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from calib_core.captures.arm_joints import applied_moves
from calib_core.captures.placement import Placement, placement_of
from calib_core.captures.scans import ScanGroup, poses_of
from calib_core.cell.carriers import scanner_name
from calib_core.cell.found import as_used, known_scanner, no_scanner, on_flange, own_base, turns_little
from calib_core.errors import InputError
from calib_core.findings.codes import merge as codes
from calib_core.findings.codes.placed_scanners import SCANNER_NOT_PLACED
from calib_core.frames import FloatArray, RigidTransform, vector_from_rotation
from calib_core.fusion.overlap import PoseErrors, move_of_pose_change
from calib_core.fusion.self_calibration import SelfCalibration
from calib_core.graph.stage_input import StageInput
from calib_core.guidance.arm_share import open_terms
from calib_core.records import Capture, Cell, Finding, VarianceComponents
from calib_core.records.results import ArmModelFound
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.merge.record import SharedShift
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.turntable.record import TurntableResult

CALIBRATION_SHARE = 0.2
"""Of a merge's progress."""

_NOT_PLACED = "no-scans"
_STEPS = (1e-5, 1e-5, 1e-5, 1e-2, 1e-2, 1e-2)  # rad and mm, of derivatives


@dataclass(frozen=True, eq=False)
class Calibration:
    """Where scans belong, how well that is known, the scatters of robot and table, the arm.

    The covariance is of tool and table, then of `others`, scanners by their names, of the cell's named axes, and
    of the arm's own errors, where poses are corrected by them.
    """

    placement: Placement
    covariance: FloatArray
    position_sigma_mm: float
    orientation_sigma_rad: float
    angle_sigma_rad: float
    by: str = "known"
    findings: tuple[Finding, ...] = ()
    arm: ArmModelFound | None = None
    others: tuple[str, ...] = ()

    @property
    def tells_scatter(self) -> bool:
        """Whether it says how far scans may lie apart."""
        return bool(self.by != "known" or self.position_sigma_mm or self.orientation_sigma_rad)


def calibration_of_session(given: StageInput, with_table: bool) -> Calibration:
    """Return tool and table: brought by the user, or solved from the session's own captures."""
    known, steps = given.session.cell.known, {c.step for c in given.session.captures if not c.excluded}
    scanner = known_scanner(given.session.cell) or own_base(given.session.cell, given.session.captures)
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
        return calibration_of(given.session.cell, given.captures, None)
    if not table_to_solve and "tcp" not in steps:
        raise no_scanner("the scanner's pose on the flange")
    result = given.solve_other(stage, tell)
    assert isinstance(result, TcpResult | TurntableResult | ChainResult)
    return calibration_of(given.session.cell, given.captures, result)


def calibration_of(
    cell: Cell, captures: Sequence[Capture], result: TcpResult | TurntableResult | ChainResult | None
) -> Calibration:
    """Return the calibration out of what the user brings and what was solved."""
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
        angle_deg = result.angle_sigma_deg
        # The turntable's covariance holds the tool's share where there is no joint one.
        covariance[6:, 6:] = used.get("turntable_covariance", used["covariance"])
    if isinstance(result, TcpResult | ChainResult):
        covariance[:6, :6] = used["covariance"]
    if isinstance(result, ChainResult):
        covariance[:6, 6:] = used["cross_covariance"]
        covariance[6:, :6] = np.transpose(used["cross_covariance"])
    placement = placement_of(cell, captures, [] if result is None else [result.model_dump(by_alias=True)])
    assert placement is not None  # the caller has seen to it
    if turns_little(used) and placement.base_from_turntable is None and not placement.held:
        findings.append(codes.PLACE_OPEN())
    frames = {one["scanner"]: one["covariance"] for one in used.get("frames", []) if one["outof"] == "laser"}
    others = tuple(name for name in placement.mounts if placement.mounts[name] is not placement.first)
    blocks = [frames.get(name) for name in others] + [axis.covariance for axis in placement.axes]
    if placement.axes:  # each counts by itself
        covariance[6:] = covariance[:, 6:] = 0.0
    for block in blocks:
        covariance = np.pad(covariance, (0, 6))
        covariance[-6:, -6:] = 0.0 if block is None else block
    by: str = "known" if result is None else result.stage
    arm = getattr(result, "arm_model", None)
    if (own := open_terms(used, 12)) is not None:
        cross = np.zeros((len(covariance), len(own.covariance)))
        cross[:12] = own.with_answer[:12]
        if placement.axes:
            cross[6:] = 0.0
        covariance = np.block([[covariance, cross], [cross.T, own.covariance]])
    angle_rad = float(np.deg2rad(angle_deg))
    return Calibration(placement, covariance, *scatter, angle_rad, by, tuple(findings), arm, others)


def not_placed(
    placement: Placement, cell: Cell, captures: Sequence[Capture], unused: Mapping[str, str]
) -> list[Finding]:
    """Return which scans are left out as nothing says where their scanners are; raises InputError if all are."""
    fit = [capture for capture in captures if capture.id not in unused]
    others: dict[str, list[str]] = {}
    for capture in fit:
        if not placement.places(capture):
            others.setdefault(scanner_name(cell, capture), []).append(capture.id)
    if fit and len(fit) == sum(map(len, others.values())):
        placement.mount(fit[0])
    return [SCANNER_NOT_PLACED(names, scanner=name, why=_NOT_PLACED) for name, names in others.items()]


def pose_errors(given: StageInput, groups: Sequence[ScanGroup], calibration: Calibration) -> PoseErrors:
    """Return how the calibration's uncertainty moves each scan in T.

    A sweep counts with its middle pose: the robot's error is taken to be the same along one sweep.
    """
    root = _root(calibration)
    common: list[FloatArray] = []
    own: list[FloatArray] = []
    for group in groups:
        pairs = poses_of(given.session, group, calibration.placement)
        capture, pose = pairs[len(pairs) // 2]
        turntable_from_base = calibration.placement.turntable_from_base(capture, pose)
        by_arm = applied_moves(given.session.cell, capture, calibration.arm)
        moves, mine = moves_of_scan(calibration, capture, turntable_from_base, pose, by_arm)
        common.append(moves @ root)
        own.append(mine)
    return PoseErrors(np.array(common), np.array(own))


def _root(calibration: Calibration) -> FloatArray:
    """Return the changes of all that was calibrated by one sigma of independent errors, in columns."""
    values, vectors = np.linalg.eigh(calibration.covariance)
    return vectors * np.sqrt(np.maximum(values, 0))


def shared_shift(calibration: Calibration, found: SelfCalibration | None) -> SharedShift | None:
    """Return what the overlap moves of tool and table, out of units of their independent errors."""
    if found is None:
        return None
    root = _root(calibration)
    return SharedShift(
        directions=found.directions,
        shift=(root @ found.shift)[:12].tolist(),
        covariance=(root @ found.covariance @ root.T)[:12, :12].tolist(),
    )


def moves_of_scan(
    calibration: Calibration,
    capture: Capture,
    turntable_from_base: RigidTransform,
    base_from_carrier: RigidTransform,
    by_arm: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the moves (6, n) of a scan by what was calibrated, and the covariance (6, 6) of those of its own.

    `by_arm` (6, p) is how the flange moves with the errors by which its pose is corrected; None where it is not.
    """
    placement, mount = calibration.placement, calibration.placement.mount(capture)
    carried = placement.carried(capture, base_from_carrier)
    turntable_from_carrier = turntable_from_base @ carried
    moves = np.zeros((6, len(calibration.covariance)))
    others = 12 + 6 * len(calibration.others)
    first = next((12 + 6 * n for n, name in enumerate(calibration.others) if name == capture.scanner), 0)
    moves[:, first : first + 6] = _by_pose(turntable_from_carrier.rotation, turntable_from_carrier @ mount)
    if placement.base_from_turntable is not None and not placement.axes:
        # B·exp(r), t + δ: a point of T moves by −r × p − Bᵀδ, seen at the table's angle.
        turned = turntable_from_base.rotation @ placement.base_from_turntable.rotation
        moves[:3, 6:9] = -turned
        moves[3:, 9:12] = -turntable_from_base.rotation
    for a in range(len(placement.axes)):
        back = placement.way(capture, base_from_carrier).inverse()
        for n, step in enumerate(np.diag(_STEPS)):
            moved = placement.with_axis_moved(a, step).way(capture, base_from_carrier) @ back
            twist = [*vector_from_rotation(moved.rotation), *moved.translation_mm]
            moves[:, others + 6 * a + n] = np.divide(twist, _STEPS[n])
    own = np.zeros((6, 6))
    if on_flange(mount) or placement.held:
        sigmas = np.repeat([calibration.orientation_sigma_rad, calibration.position_sigma_mm], 3)
        robot = _by_pose(turntable_from_carrier.rotation @ base_from_carrier.rotation.T, turntable_from_carrier)
        if placement.held:  # the object moves with the flange, in whose frame all is: the other way round
            robot = -block_diag(np.eye(3), base_from_carrier.rotation.T)
        own = (robot * sigmas) @ (robot * sigmas).T
        if by_arm is not None:
            turned = base_from_carrier.rotation.T @ by_arm[3:]
            moves[:, -by_arm.shape[1] :] = robot @ np.vstack([turned, by_arm[:3]])
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
