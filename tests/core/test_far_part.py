"""A part at base coordinates of a kilometre: the same answer within a micrometre, in every file too."""

import io
import re
import zipfile
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from calib_core.archive.stored_clouds import CLOUD_FILE, MESH_FILE, StoredFile, in_format, read_stored_ply
from calib_core.formats.e57 import scan_poses
from calib_core.formats.meshes import parse_mesh
from calib_core.formats.points import parse_cloud
from calib_core.records import parse_session
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.pipeline import run
from tests.merge_sets import in_one_frame, merge_session, scan_set
from tests.point_files import mesh_file

SHIFT_MM = np.array([1e6, -1e6, 1e6])
MICROMETRE = 1e-3


def ply(points: np.ndarray) -> bytes:
    """A cloud in double precision, as surveyors' programs write it."""
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    return (
        head.encode() + b"property double x\nproperty double y\nproperty double z\nend_header\n" + points.tobytes()
    )


@cache
def merged(far: bool, by: str) -> tuple[MergeResult, dict[str, bytes]]:
    """Merge scans of a part that stands so far off: by the robot's poses, or by the points' own coordinates."""
    shift_mm = SHIFT_MM if far else np.zeros(3)
    there = scan_set("bracket", 3, count=10, pitch_mm=1.0)
    told = {"voxel_mm": 0.8, "mesh": "poisson", "reference": "part.obj", "registration": True}
    record, files = merge_session(there, **told)
    files["part.obj"] = mesh_file("obj", there.part.points_mm + shift_mm, there.part.triangles)
    for capture, scan, pose in zip(record["captures"], there.scans, there.reported, strict=True):
        if by == "poses":
            moved = pose.copy()
            moved[:3, 3] += shift_mm
            capture["pose"] = moved.ravel().tolist()
        else:
            turned = np.eye(4)
            turned[:3, :3] = pose[:3, :3]
            capture["pose"] = turned.ravel().tolist()
            points = in_one_frame(scan, pose).reshape(-1, 3)
            points = points[np.isfinite(points).all(axis=1)] + (pose[:3, 3] + shift_mm) @ pose[:3, :3]
            capture["files"] = [capture["files"][0].replace(".pcd", ".ply")]
            files[capture["files"][0]] = ply(points)
    stored: dict[str, bytes] = {}

    def keep(name: str, pieces: Iterable[bytes | memoryview]) -> None:
        stored[name] = b"".join(bytes(piece) for piece in pieces)

    result = run(parse_session(record, "session"), files.__getitem__, "merge", store=keep)["merge"]
    assert isinstance(result, MergeResult)
    return result, stored


@pytest.mark.thorough
@pytest.mark.parametrize("by", ["poses", "points"])
def test_a_part_far_away_has_the_same_answer_within_a_micrometre(by: str) -> None:
    (near, near_files), (far, far_files) = merged(False, by), merged(True, by)
    assert near.points == pytest.approx(far.points, rel=1e-3)
    assert near.overlap_rms_mm == pytest.approx(far.overlap_rms_mm, abs=MICROMETRE)
    assert near.registration_shift_rms_mm == pytest.approx(far.registration_shift_rms_mm, abs=MICROMETRE)
    assert np.array(far.low_mm) - SHIFT_MM == pytest.approx(np.array(near.low_mm), abs=MICROMETRE)
    for file in (CLOUD_FILE, MESH_FILE):
        here, there = read_stored_ply(near_files[file], file), read_stored_ply(far_files[file], file)
        assert (here.points_mm.dtype, there.points_mm.dtype) == (np.float32, np.float64)
        off, _ = KDTree(here.points_mm).query(there.points_mm - SHIFT_MM)
        assert np.quantile(off, 0.99) < MICROMETRE  # of a point between two voxels the last digit decides
    assert near.deviation is not None
    assert far.deviation is not None
    assert far.deviation.rms_mm == pytest.approx(near.deviation.rms_mm, abs=MICROMETRE)
    assert near.alignment is not None
    assert far.alignment is not None
    place = {
        "here": np.array(near.alignment.cloud_from_reference),
        "far": np.array(far.alignment.cloud_from_reference),
    }
    corner = np.array([30.0, 20.0, 10.0, 1.0])
    there = place["far"] @ (corner + np.append(SHIFT_MM, 0.0))
    assert there[:3] - SHIFT_MM == pytest.approx((place["here"] @ corner)[:3], abs=MICROMETRE)
    assert far.deviation.extremes[0].deviation_mm == pytest.approx(
        near.deviation.extremes[0].deviation_mm, abs=MICROMETRE
    )


@pytest.mark.thorough
def test_every_format_keeps_the_micrometre(tmp_path: Path) -> None:
    _, files = merged(True, "poses")
    cloud = read_stored_ply(files[CLOUD_FILE], CLOUD_FILE).points_mm

    def converted(file: str, wanted: str) -> bytes:
        (tmp_path / "stored.ply").write_bytes(files[file])
        with (tmp_path / "stored.ply").open("rb") as stored:
            return b"".join(bytes(piece) for piece in in_format(StoredFile(stored, file), wanted, file))

    for wanted in ("pcd", "xyz", "las"):
        again = parse_cloud(converted(CLOUD_FILE, wanted), f"merged.{wanted}")
        assert np.abs(again - cloud).max() < MICROMETRE, wanted
    mesh = read_stored_ply(files[MESH_FILE], MESH_FILE)
    assert mesh.triangles is not None
    for wanted in ("stl", "obj", "ply"):
        again: Any = parse_mesh(converted(MESH_FILE, wanted), f"mesh.{wanted}")
        assert np.abs(again.corners_mm[again.triangles] - mesh.points_mm[mesh.triangles]).max() < MICROMETRE, (
            wanted
        )

    scene = trimesh.load(io.BytesIO(converted(MESH_FILE, "glb")), file_type="glb", process=False)
    assert np.abs(1000 * scene.to_geometry().vertices - mesh.points_mm).max() < MICROMETRE
    with zipfile.ZipFile(io.BytesIO(converted(MESH_FILE, "3mf"))) as archive:
        numbers = re.findall(r'[xyz]="([^"]*)"', archive.read("3D/3dmodel.model").decode())
    assert np.abs(np.reshape(np.array(numbers, float), (-1, 3)) - mesh.points_mm).max() < MICROMETRE


@pytest.mark.thorough
def test_an_e57_has_a_scan_a_pose_and_each_point_where_it_was(tmp_path: Path) -> None:
    pye57 = pytest.importorskip("pye57")
    for far in (False, True):
        result, files = merged(far, "poses")
        path = tmp_path / "stored.ply"
        path.write_bytes(files[CLOUD_FILE])
        cloud = read_stored_ply(files[CLOUD_FILE], CLOUD_FILE)
        with path.open("rb") as stored:
            pieces = in_format(StoredFile(stored, CLOUD_FILE), "e57", CLOUD_FILE, result.scan_places)
            (tmp_path / "scans.e57").write_bytes(b"".join(bytes(piece) for piece in pieces))
        assert cloud.scans is not None
        with pye57.E57(str(tmp_path / "scans.e57")) as opened:
            headers = [opened.get_header(k) for k in range(opened.scan_count)]
            names = [header["name"].value() for header in headers]
            own = [number for number in range(len(result.scan_names)) if (cloud.scans == number).any()]
            others = ["others"] if (cloud.scans < 0).any() else []
            assert names == [
                *(result.scan_names[number] for number in own),
                *others,
            ]  # a scan may weigh most nowhere
            for at, (number, header) in enumerate(zip(own, headers, strict=False)):
                raw = opened.read_scan_raw(at, ignore_unsupported_fields=True)
                points = np.column_stack([raw[f"cartesian{axis}"] for axis in "XYZ"]).astype(float)
                placed = 1000 * (points @ header.rotation_matrix.T + header.translation)
                assert np.abs(placed - cloud.points_mm[cloud.scans == number]).max() < MICROMETRE
                row = next(row for row in result.residuals if row.capture == names[at])
                assert np.array(row.cloud_from_laser)[:3, 3] == pytest.approx(1000 * header.translation, abs=1e-6)
            whole = opened.read_scan(0, ignore_missing_fields=True, transform=True)
            assert len(whole["cartesianX"]) == (cloud.scans == 0).sum()
    with path.open("rb") as stored:
        alone = b"".join(bytes(piece) for piece in in_format(StoredFile(stored, ""), "e57", ""))
    again = parse_cloud(alone, "merged.e57") - cloud.points_mm
    assert np.ptp(again, axis=0).max() < MICROMETRE
    assert scan_poses(alone, "merged.e57")[0] is not None
