"""The session of a scanned part: a table turns it in front of an area scanner on a robot, all calibrated."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calib_core.records import Session
from calib_core.simulation.motion import ON_FLANGE, FloatArray, back, pose, turn
from calib_core.simulation.part import PartMesh, build_part
from calib_core.simulation.part_scan import PartScan, PartScanner, PartScanOptions, view_poses
from calib_core.simulation.profile_cell import pose_numbers, rounded_pose


@dataclass(frozen=True)
class PartScenario:
    """A part scanned on a turntable; lengths in mm.

    Parameters
    ----------
    scans : int
        At equal angles of the table, in turn at three heights.
    scanner : PartScanOptions
    position_sigma_mm, orientation_sigma_rad, angle_sigma_rad : float
        Errors of robot and table at each scan: recorded poses and angles are the commanded ones.
    """

    description: str = "a part with a free-form top, edges, holes and a ball, 12 scans around on a turntable"
    scans: int = 12
    scanner: PartScanOptions = field(default_factory=PartScanOptions)
    position_sigma_mm: float = 0.03
    orientation_sigma_rad: float = 0.0001
    angle_sigma_rad: float = 0.00005


PART_SCENARIOS = {"part": PartScenario()}


def simulate_part(options: PartScenario, name: str, seed: int) -> tuple[Session, dict[str, bytes], dict[str, Any]]:
    """Return the session record, its files (organised PCD, one a scan) and the truth."""
    rng = np.random.default_rng([seed, 20_263])
    mount_from_laser = pose(turn([0.35, 0.0, 0.0]) @ turn(rng.uniform(-0.1, 0.1, 3)), [35.0, -120.0, 140.0])
    base_from_turntable = pose(turn(rng.uniform(-0.02, 0.02, 3)), [900.0, 100.0, 50.0])
    part = build_part()
    stops = [(view, 360.0 * k / options.scans) for k, view in enumerate(view_poses(options.scans))]
    place = ScanCell(mount_from_laser, base_from_turntable)
    captures, files = take_scans(options, PartScanner(part, options.scanner), place, stops, rng)
    cell = {
        "pose_convention": "abb",
        "scanner": {"kind": "cloud", "point_sigma_mm": options.scanner.point_sigma_mm, "z_axis": "away"},
        "robot": {
            "position_sigma_mm": options.position_sigma_mm,
            "orientation_sigma_deg": float(np.rad2deg(options.orientation_sigma_rad)),
        },
        "turntable": {"direction": 1, "angle_sigma_deg": float(np.rad2deg(options.angle_sigma_rad))},
        "known": {ON_FLANGE: mount_from_laser.tolist(), "base_from_turntable": base_from_turntable.tolist()},
    }
    record = {"format": "scancell-session/1", "name": f"simulated {name}, seed {seed}", "cell": cell}
    session = Session.model_validate({**record, "captures": captures})
    return session, files, _truth(part, cell) | {"seed": seed, "scenario": name, "spoiled": []}


@dataclass(frozen=True, eq=False)
class ScanCell:
    """Where the scanner and the table really are: mount_from_laser and base_from_turntable, both (4, 4)."""

    mount_from_laser: FloatArray
    base_from_turntable: FloatArray


def take_scans(
    options: PartScenario,
    scanner: PartScanner,
    cell: ScanCell,
    stops: Sequence[tuple[FloatArray, float]],
    rng: np.random.Generator,
) -> tuple[list[dict[str, Any]], dict[str, bytes]]:
    """Return the records of the scans and their files (organised PCD), one a stop.

    A stop is turntable_from_laser (4, 4) and how far the table is turned, in degrees; errors are drawn from `rng`.
    """
    files: dict[str, bytes] = {}
    captures: list[dict[str, Any]] = []
    for k, (view, degrees) in enumerate(stops):
        wanted = cell.base_from_turntable @ pose(turn([0, 0, np.deg2rad(degrees)]), [0, 0, 0]) @ view
        commanded = rounded_pose(wanted @ back(cell.mount_from_laser))
        actual = commanded @ _error(options, rng)
        angle = np.deg2rad(degrees) + rng.standard_normal() * options.angle_sigma_rad
        turntable_from_base = pose(turn([0, 0, -angle]), [0, 0, 0]) @ back(cell.base_from_turntable)
        scan = scanner.scan(turntable_from_base @ actual @ cell.mount_from_laser, rng)
        file = f"captures/v{k + 1:02d}.pcd"
        files[file] = organised_pcd(in_one_frame(scan, options.scanner))
        captures.append(
            {"id": f"v{k + 1:02d}", "step": "scan", "kind": "cloud", "files": [file]}
            | {"pose": pose_numbers(commanded), "table_deg": degrees}
        )
    return captures, files


def _error(options: PartScenario, rng: np.random.Generator) -> FloatArray:
    turned = turn(rng.standard_normal(3) * options.orientation_sigma_rad)
    return pose(turned, rng.standard_normal(3) * options.position_sigma_mm)


def in_one_frame(scan: PartScan, options: PartScanOptions) -> FloatArray:
    """Return a scan's points (P, C, 3) in L of its middle profile: each row stands farther along y."""
    points = scan.points_in_laser_mm.copy()
    points[..., 1] += ((np.arange(len(points)) - (len(points) - 1) / 2) * options.pitch_mm)[:, None]
    return points


def organised_pcd(points_mm: FloatArray) -> bytes:
    """Return a binary PCD whose width and height are the scan's columns and rows, blanks as NaN."""
    rows, columns, _ = points_mm.shape
    blank = np.isnan(points_mm).any(axis=2, keepdims=True)
    values = np.where(blank, np.nan, points_mm).astype("<f4")
    header = (
        "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {columns}\nHEIGHT {rows}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {rows * columns}\nDATA binary\n"
    )
    return header.encode() + values.tobytes()


def _truth(part: PartMesh, cell: dict[str, Any]) -> dict[str, Any]:
    """Return the truth as JSON data; the part's own mesh is `calib_core.simulation.part.build_part`."""
    return {
        **cell["known"],
        "ball_center_in_turntable_mm": part.ball_center_mm.tolist(),
        "ball_diameter_mm": 2 * part.ball_radius_mm,
        "sigmas": {**cell["robot"], **cell["turntable"], "point_sigma_mm": cell["scanner"]["point_sigma_mm"]},
    }
