"""What was calibrated, as a result has it with all its covariances, and how a scan looks at a workpiece."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib_core.cell.found import as_used, on_flange, placed_table, scanner_frame
from calib_core.chain.chain_data import Sigmas
from calib_core.chain.scanner import NAMES
from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform, rotation_from_vector
from calib_core.guidance.arm_share import ArmShare
from calib_core.messages import message
from calib_core.records.results import LeftInFiles, OpticsShift


@dataclass(frozen=True, eq=False)
class Calibrated:
    """Tool, table and scanner as a result has them, with all their covariances.

    Attributes
    ----------
    mount_from_laser : RigidTransform
        Where the scanner is on what carries it: where it stands in base, no robot is on the way to a table.
    base_from_turntable : RigidTransform or None
    direction : {1, -1}
        Of the table's angles.
    nuisances : tuple of int
        Which of the scanner's errors the covariance has.
    covariance : (6 + 6 + n + m, …)
        Of tool, table (zero without one), the scanner's errors, and m unit variances of camera and plane of light.
    half_width_mm, facing, point_in_laser_mm
        See `chain.held`; where the scanner sees the workpiece, (3,).
    sigmas : Sigmas
    point_sigma_mm : float
    optics : tuple of OpticsShift
        What those m do; the tool's, table's and scanner's covariances are without them.
    arm : ArmShare or None
        How tool, table and scanner err together with the arm; None: as if they did not.
    left : (12 + n,) or None
        By how much tool, table and scanner are off for what is known of the files and stays in them. Its square
        is in the covariance.
    arm_growth : float
        One sigma of how much longer the arm is, of its length, for the temperatures that were told; 0 without any.
    """

    mount_from_laser: RigidTransform
    base_from_turntable: RigidTransform | None
    direction: int
    nuisances: tuple[int, ...]
    covariance: FloatArray
    half_width_mm: float
    facing: int
    point_in_laser_mm: FloatArray
    sigmas: Sigmas
    point_sigma_mm: float
    optics: tuple[OpticsShift, ...] = ()
    arm: ArmShare | None = None
    left: FloatArray | None = None
    arm_growth: float = 0.0

    @classmethod
    def of(cls, result: Mapping[str, Any], point_in_laser_mm: Sequence[float] | None = None) -> "Calibrated":
        """Return what a result of `chain` or `tcp` has; one of `turntable` has a scanner that is exact.

        A result of before the whole chain told how scanner and table are correlated is taken without the scanner.

        Raises
        ------
        InputError
            If its covariances are none, or nothing says where the scanner sees the workpiece.
        """
        result = as_used(result)
        scanner: Any = result.get("scanner")
        if isinstance(scanner, str):
            scanner = (result.get("scanner_errors") or {}).get(scanner)
        found: Mapping[str, Any] = result.get("variance_components") or {}
        table, mount = result.get("base_from_turntable"), scanner_frame(result)
        if scanner is None or (table is not None and scanner.get("covariance_with_table") is None):
            scanner = {
                "names": [],
                "covariance": [],
                "covariance_with_tool": [[]] * 6,
                "covariance_with_table": [[]] * 6,
            }
        seen = (result.get("workpiece") or {}).get("point_in_laser_mm")
        point = point_in_laser_mm if point_in_laser_mm is not None else seen
        if point is None and table is not None and result.get("mounts") and not on_flange(mount):
            spheres = [one["center_in_turntable_mm"] for one in result["mounts"]]
            point = (mount.inverse() @ placed_table(result)).apply(np.mean(spheres, axis=0)).tolist()
        if point is None:
            where = f"results/{result.get('stage')}.json: workpiece"
            got, to_do = "nothing", "Solve the session again."
            if result.get("up_to_shift"):
                got = message("a place that the captures leave open")
                to_do = message("Do what the result says of what is not determined.")
            raise InputError("where the scanner sees the workpiece", got, to_do, where)
        names = tuple(NAMES.index(name) for name in scanner["names"])
        count = len(names)
        covariance = np.zeros((12 + count, 12 + count))
        by_table = table is not None and "turntable_covariance" not in result
        covariance[:6, :6] = 0.0 if by_table else result["covariance"]
        covariance[12:, 12:] = np.reshape(scanner["covariance"], (count, count))
        covariance[:6, 12:] = scanner["covariance_with_tool"]
        if table is not None:
            covariance[6:12, 6:12] = result["covariance" if by_table else "turntable_covariance"]
            covariance[:6, 6:12] = 0.0 if by_table else result["cross_covariance"]
            covariance[6:12, 12:] = scanner["covariance_with_table"]
        covariance = np.triu(covariance) + np.triu(covariance, 1).T
        if not np.isfinite(covariance).all():
            raise InputError("covariances of finite numbers", "something else", "Solve the session again.")
        optics = tuple(OpticsShift.model_validate(one) for one in result.get("optics") or [])
        covariance = _with_optics_apart(covariance, optics)
        angle = float(np.deg2rad(result.get("angle_sigma_deg") or 0.0))
        told: Mapping[str, Any] = result.get("arm_errors") or {}
        return cls(
            mount_from_laser=mount,
            base_from_turntable=None if table is None else placed_table(result),
            direction=int(result.get("direction") or 1),
            nuisances=names,
            covariance=covariance,
            half_width_mm=float(scanner.get("half_width_mm") or 1.0),
            facing=int(scanner.get("facing") or 1),
            point_in_laser_mm=np.array(point, dtype=float),
            sigmas=Sigmas(0.0, 0.0, (angle,))
            if not on_flange(mount)
            else Sigmas(
                found.get("position_sigma_mm") or 0.0,
                found.get("orientation_sigma_rad") or 0.0,
                (angle,),
                told.get("position_sigma_mm") or found.get("alike_position_sigma_mm") or 0.0,
                told.get("orientation_sigma_rad") or found.get("alike_orientation_sigma_rad") or 0.0,
            ),
            point_sigma_mm=float(found.get("point_sigma_mm") or 0.0),
            optics=optics,
            arm=ArmShare.of(result, count > 0, table is not None) if on_flange(mount) else None,
            left=_left_in_files(scanner, table is not None),
        )

    @property
    def moves_by_optics(self) -> FloatArray:
        """By how much camera's and plane's errors move tool, table and scanner, (12 + n, m)."""
        return _moves_by(self.optics, 12 + len(self.nuisances))


def _moves_by(optics: Sequence[OpticsShift], size: int) -> FloatArray:
    """Return by how much each of camera's and plane's errors moves tool, table and scanner (size), (size, m)."""
    columns = [[*one.tool, *(one.turntable or [0.0] * 6), *one.scanner][:size] for one in optics]
    return np.array(columns, dtype=float).reshape(-1, size).T


def _with_optics_apart(covariance: FloatArray, optics: Sequence[OpticsShift]) -> FloatArray:
    """Return a covariance with the errors of camera and plane of light as members of their own."""
    size, many = len(covariance), len(optics)
    moves = _moves_by(optics, size)
    apart = np.eye(size + many)
    apart[:size, :size] = covariance - moves @ moves.T
    return apart


def _left_in_files(scanner: Mapping[str, Any], with_table: bool) -> FloatArray | None:
    if scanner.get("left_in_files") is None:
        return None
    found = LeftInFiles.model_validate(scanner["left_in_files"])
    return np.array([*found.tool, *((with_table and found.turntable) or [0.0] * 6), *found.scanner])


@dataclass(frozen=True, eq=False)
class View:
    """One scan: the flange's orientation in base (3, 3), the table's angle as read, and where L sees the point.

    `place_mm` (3,) is the flange's in base; with a table it follows from the point, and is not needed.
    """

    rotation: FloatArray
    angle_rad: float = 0.0
    point_in_laser_mm: FloatArray | None = None
    place_mm: FloatArray | None = None

    def base_from_mount(self, known: Calibrated) -> FloatArray:
        """Return how what carries the scanner is turned in base, (3, 3)."""
        return self.rotation if on_flange(known.mount_from_laser) else np.eye(3)

    def seen(self, known: Calibrated) -> FloatArray:
        """Return where L sees the point, (3,)."""
        return known.point_in_laser_mm if self.point_in_laser_mm is None else self.point_in_laser_mm

    def places(self, known: Calibrated, points_mm: FloatArray) -> FloatArray:
        """Return where in base the flange stands while points (P, 3) of T are measured, (P, 3)."""
        table = known.base_from_turntable
        if table is None:
            middle = np.zeros(3) if known.arm is None else known.arm.middle_mm
            return np.broadcast_to(middle if self.place_mm is None else self.place_mm, points_mm.shape)
        turn = rotation_from_vector(np.array([0.0, 0.0, known.direction * self.angle_rad]))
        flange = self.base_from_mount(known) @ known.mount_from_laser.apply(self.seen(known))
        return points_mm @ (table.rotation @ turn).T + table.translation_mm - flange
