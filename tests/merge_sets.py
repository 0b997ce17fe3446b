"""Sets of scans of simulated parts, with errors as arms make them, which share nothing with the solvers."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from calib_core.fusion.clean_scan import CleanScan
from calib_core.fusion.crew import MergeOptions, RegionGrids, by_region
from calib_core.fusion.merge import VoxelCloud, joined_clouds
from calib_core.fusion.scan import Scan
from calib_core.simulation.part import PartMesh
from calib_core.simulation.part_scan import PartScanner, PartScanOptions
from tests.shapes import SHAPES

FLIP = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, eq=False)
class ScanSet:
    """Scans as reported, and where they really stood, (S, 4, 4), of L at the middle of each scan."""

    part: PartMesh
    scans: list[Scan]
    actual: np.ndarray
    reported: np.ndarray


def turn(vector: np.ndarray) -> np.ndarray:
    angle = float(np.linalg.norm(vector))
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def look_from(out: np.ndarray, distance_mm: float) -> np.ndarray:
    """A pose of L that looks along −out at the middle."""
    side = np.cross([0.0, 0.0, 1.0], out) if abs(out[2]) < 0.99 else np.array([1.0, 0.0, 0.0]) - out[0] * out
    side /= np.linalg.norm(side)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([side, np.cross(-out, side), -out])
    pose[:3, 3] = distance_mm * out
    return pose


def directions(views: str, count: int) -> np.ndarray:
    """Where from: `around` all sides, `table` from above all around, `above` within 35° of the top."""
    k = np.arange(count)
    turned = k * np.pi * (3 - np.sqrt(5))
    if views == "around":
        z = 1 - 2 * (k + 0.5) / count
    elif views == "above":
        z = 1 - (1 - np.cos(np.deg2rad(35))) * (k + 0.5) / count
    else:
        turned, z = 2 * np.pi * k / count, np.sin(np.deg2rad(np.array([20.0, 45.0, 65.0])[k % 3]))
    flat = np.sqrt(1 - z**2)
    return np.column_stack([flat * np.cos(turned), flat * np.sin(turned), z])


def correlated(out: np.ndarray, sigma: float, share: float, rng: np.random.Generator) -> np.ndarray:
    """Errors (S, 3) of which a share of the variance is alike where views are alike, over about 0.5 rad."""
    apart = np.arccos(np.clip(out @ out.T, -1, 1))
    root = np.linalg.cholesky(np.exp(-((apart / 0.5) ** 2) / 2) + 1e-9 * np.eye(len(out)))
    alike = root @ rng.standard_normal((len(out), 3))
    return sigma * (np.sqrt(share) * alike + np.sqrt(1 - share) * rng.standard_normal((len(out), 3)))


@cache
def scan_set(
    shape: str,
    seed: int,
    count: int = 12,
    views: str = "around",
    pitch_mm: float = 0.7,
    position_sigma_mm: float = 0.05,
    orientation_sigma_rad: float = 2e-4,
    alike: float = 0.5,
    toward: bool = False,
    offset_mm: float = 0.0,
    sigma_mm: float = 0.02,
) -> ScanSet:
    """Scans of a shape; `toward`: depths count toward the scanner, from a zero `offset_mm` before it."""
    rng = np.random.default_rng([seed, 41])
    part = SHAPES[shape]()
    scanner = PartScanner(part, PartScanOptions(pitch_mm, 120.0, 120.0, 80.0, sigma_mm))
    out = directions(views, count)
    moves = correlated(out, position_sigma_mm, alike, rng)
    turns = correlated(out, orientation_sigma_rad, alike, rng)
    spin = rng.uniform(0, 2 * np.pi, count)
    own = np.eye(4)
    if toward:
        own[:3, :3] = FLIP
    own[2, 3] = offset_mm  # L's own zero, in the frame of the simulated light
    scans, actual, reported = [], [], []
    for k in range(count):
        told = look_from(out[k], 200.0)
        told[:3, :3] = told[:3, :3] @ turn(np.array([0, 0, spin[k]]))
        error = np.eye(4)
        error[:3, :3], error[:3, 3] = turn(turns[k]), moves[k]
        scan = scanner.scan(told @ error, rng)
        steps = np.linalg.inv((told @ error)[None]) @ scan.turntable_from_laser
        there = told[None] @ steps @ own  # the robot's error is one along a sweep
        points = (scan.points_in_laser_mm - own[:3, 3]) @ own[:3, :3]
        scans.append(Scan(f"s{k:02d}", points.astype(np.float32), there, sigma_mm))
        actual.append(told @ error @ own)
        reported.append(told @ own)
    return ScanSet(part, scans, np.array(actual), np.array(reported))


def fused(scans: Iterable[CleanScan], voxel_mm: float) -> VoxelCloud:
    """The kept points of scans summed in voxels, as the merge does."""
    options = MergeOptions(voxel_mm)
    grids = RegionGrids(options, None)
    for scan in scans:
        grids.add(dict(enumerate(by_region(scan, options))), scan.name)
    return joined_clouds([grids.cloud_of(*piece) for piece in grids.pieces()])


def pcd(points: np.ndarray) -> bytes:
    """An organised PCD of a scan's grid."""
    rows, columns = points.shape[:2]
    head = (
        "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {columns}\nHEIGHT {rows}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {rows * columns}\nDATA binary\n"
    ).encode()
    return head + np.ascontiguousarray(points, dtype=np.float32).tobytes()


def in_one_frame(scan: Scan, reported: np.ndarray) -> np.ndarray:
    """A sweep's points in the frame of its middle, as an area scanner would give them."""
    steps = np.linalg.inv(reported) @ scan.turntable_from_laser
    points = scan.points_in_laser_mm.astype(float)
    return np.einsum("pij,pcj->pci", steps[:, :3, :3], points) + steps[:, None, :3, 3]


def merge_session(there: ScanSet, table: bool = False, **merge: object) -> tuple[dict[str, Any], dict[str, bytes]]:
    """A session of the scans with known poses, and its files; `table`: poses are told by the table's angle."""
    files, captures = {}, []
    for number, (scan, pose) in enumerate(zip(there.scans, there.reported, strict=True)):
        name = f"captures/{scan.name}.pcd"
        files[name] = pcd(in_one_frame(scan, pose))
        capture = {"id": scan.name, "step": "scan", "kind": "cloud", "files": [name]}
        if table:
            degrees = 360.0 * number / len(there.scans)
            back = np.eye(4)
            back[:3, :3] = turn(np.array([0, 0, np.deg2rad(degrees)]))
            capture |= {"table_deg": degrees, "pose": (back @ pose).ravel().tolist()}
        else:
            capture |= {"pose": pose.ravel().tolist()}
        captures.append(capture)
    known = {"tool0_from_laser": np.eye(4).tolist()}
    if table:
        known["base_from_turntable"] = np.eye(4).tolist()
    cell = {
        "pose_convention": "matrix",
        "known": known,
        "merge": {"voxel_mm": 0.5, "mesh": "none", **merge},
    }
    return {"format": "scancell-session/1", "name": "part", "cell": cell, "captures": captures}, files
