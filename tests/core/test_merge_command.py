"""`scancell merge`: an E57 of several scans with their poses, without a session."""

import json
from pathlib import Path

import numpy as np
import pytest

from server.cli import main
from tests.merge_sets import in_one_frame, merge_session, scan_set

pye57 = pytest.importorskip("pye57")


@pytest.mark.thorough
def test_an_e57_of_several_scans_is_merged_by_its_own_poses(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    there = scan_set("bracket", 2, count=12, views="table")
    file = pye57.E57(str(tmp_path / "part.e57"), mode="w")
    for scan, pose in zip(there.scans, there.reported, strict=True):
        points = in_one_frame(scan, pose).reshape(-1, 3)
        x, y, z = points[np.isfinite(points).all(axis=1)].T / 1000
        w = 0.5 * np.sqrt(max(1 + np.trace(pose[:3, :3]), 1e-12))
        r = pose[:3, :3]
        turned = np.array([w, *(np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / (4 * w))])
        file.write_scan_raw(
            {"cartesianX": x, "cartesianY": y, "cartesianZ": z}, rotation=turned, translation=pose[:3, 3] / 1000
        )
    file.close()
    out = tmp_path / "out"
    asked = ["--voxel-mm", "0.8", "--fill-holes", "--mesh-tolerance-mm", "0.1"]
    status = main(["merge", str(tmp_path / "part.e57"), *asked, "--out", str(out), "--json"])
    told = json.loads(capsys.readouterr().out)["results"]["merge"]
    assert (status, told["normals_outward"]) == (0, "visibility")
    assert told["overlap_pairs"] > 500
    assert (told["mesh_open_edges"], told["triangles"] > 1000) == (0, True)
    assert (out / "clouds" / "merged.ply").stat().st_size > 10_000
    assert json.loads((out / "results" / "merge.json").read_text())["points"] == told["points"]


def test_scans_in_metres_are_merged_by_the_unit_that_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    x, y = (one.ravel() for one in np.meshgrid(np.arange(-20.0, 20.5), np.arange(-20.0, 20.5)))
    points_mm = np.column_stack([x, y, 200 + 0.005 * (x**2 + y**2)])
    names = [str(tmp_path / f"{k}.xyz") for k in range(2)]
    for name in names:
        np.savetxt(name, points_mm / 1000, fmt="%.6f")
    poses = tmp_path / "poses.csv"
    poses.write_text("x,y,z,qw,qx,qy,qz\n500,0,300,1,0,0,0\n500,0,300.01,1,0,0,0\n")
    main(["merge", *names, "--poses", str(poses), "--unit", "m", "--mesh", "none", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert [one["format_settings"] for one in told["session"]["captures"]] == [{"unit": "m"}] * 2
    assert told["results"]["merge"]["points"] > 1000
    assert "merge-scans-in-metres" not in {one["code"] for one in told["results"]["merge"]["findings"]}


@pytest.mark.thorough
def test_scans_that_changed_places_are_named_and_the_folder_that_was_written_repairs_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    record, files = merge_session(scan_set("bracket", 2, count=12, views="table"))
    for name, data in files.items():
        (tmp_path / Path(name).name).write_bytes(data)
    poses = np.array([capture["pose"] for capture in record["captures"]])
    poses[[2, 5]] = poses[[5, 2]]
    np.savetxt(tmp_path / "poses.txt", poses)
    names = [str(tmp_path / Path(name).name) for name in files]
    given = [*names, "--poses", str(tmp_path / "poses.txt"), "--mesh", "none", "--voxel-mm", "1"]
    assert main(["merge", *given]) == 1
    assert "--out DIR" in capsys.readouterr().err
    out = tmp_path / "out"
    assert main(["merge", *given, "--out", str(out)]) == 1
    assert f"scancell run {out} --apply 1" in capsys.readouterr().err
    assert main(["run", str(out), "--apply", "1"]) == 0
