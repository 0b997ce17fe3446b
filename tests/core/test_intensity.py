"""How bright points came back: read from every format that has it, averaged by the merge, written again."""

import io
from pathlib import Path

import numpy as np
import pytest

from calib_core.archive.stored_clouds import read_stored_ply
from calib_core.formats.format import ScanPlace
from calib_core.formats.las import las_pieces
from calib_core.formats.ply import ply_pieces
from calib_core.formats.points import read_file
from calib_core.formats.shared.e57_writing import pieces_of_scans
from server.cli import main

X, Y = (one.ravel() for one in np.meshgrid(np.arange(-20.0, 20.5, 0.5), np.arange(-20.0, 20.5, 0.5)))
SURFACE_MM = np.column_stack([X, Y, 200 + 0.005 * (X**2 + Y**2)])


def brightness(points_mm: np.ndarray) -> np.ndarray:
    """Rises along x, so that the mean of what fell into a voxel is that of the voxel's place."""
    return 100 + 4 * points_mm[:, 0]


TABLE = np.column_stack([SURFACE_MM, brightness(SURFACE_MM)])


def text(header: str, table: np.ndarray, separator: str) -> bytes:
    buffer = io.StringIO()
    np.savetxt(buffer, table, fmt="%.6f", delimiter=separator)
    return (header + buffer.getvalue()).encode()


def in_memory(name: str) -> bytes:
    """A file of the surface with its intensities, written without this product's writers where it has none."""
    if name == "a.csv":
        return text("x_mm,y_mm,z_mm,Intensity\n", TABLE, ",")
    if name == "a.ptx":
        table = np.column_stack([SURFACE_MM / 1000, brightness(SURFACE_MM)])
        return text("81\n81\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", table, " ")
    if name == "a.pcd":
        head = (
            f"VERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH {len(TABLE)}\n"
        )
        head += f"HEIGHT 1\nPOINTS {len(TABLE)}\nDATA binary\n"
        return head.encode() + TABLE.astype("<f4").tobytes()
    names = ("x", "y", "z", "intensity")
    if name == "a.las":
        return b"".join(map(bytes, las_pieces([TABLE], len(TABLE), names)))
    if name == "a.e57":
        scans = [ScanPlace("one", np.eye(4))]
        with_scan = np.column_stack([SURFACE_MM, np.zeros(len(TABLE)), TABLE[:, 3]])
        return b"".join(
            map(bytes, pieces_of_scans(lambda: [with_scan], ("x", "y", "z", "scan", "intensity"), scans))
        )
    return b"".join(map(bytes, ply_pieces(TABLE, names)))


@pytest.mark.parametrize("name", ["a.csv", "a.ptx", "a.pcd", "a.ply", "a.las", "a.e57"])
def test_intensities_are_read(name: str) -> None:
    if name == "a.e57":
        pytest.importorskip("pye57")
    reading = read_file(in_memory(name), name, "cloud")
    assert reading.intensity is not None
    assert reading.points == pytest.approx(SURFACE_MM, abs=1e-3)
    assert reading.intensity == pytest.approx(TABLE[:, 3], abs=0.5 if name == "a.las" else 1e-3)


def test_a_column_of_one_number_is_no_intensity() -> None:
    flat = np.column_stack([SURFACE_MM, np.full(len(SURFACE_MM), 255.0)])
    assert read_file(text("x,y,z,intensity\n", flat, ","), "a.csv", "cloud").intensity is None


def test_a_merge_averages_intensities_and_writes_them(tmp_path: Path) -> None:
    for k in range(2):
        (tmp_path / f"{k}.ply").write_bytes(in_memory("a.ply"))
    np.savetxt(tmp_path / "plain.xyz", SURFACE_MM + np.array([60.0, 0.0, 0.0]), fmt="%.6f")
    poses = tmp_path / "poses.csv"
    poses.write_text("x,y,z,qw,qx,qy,qz\n" + "500,0,300,1,0,0,0\n" * 3)
    names = [str(tmp_path / name) for name in ("0.ply", "1.ply", "plain.xyz")]
    out = tmp_path / "out"
    told = ["--poses", str(poses), "--mesh", "none", "--voxel-mm", "1.5", "--out", str(out), "--json"]
    main(["merge", *names, *told])
    assert main(["archive", "pack", str(out), "--out", str(tmp_path / "bag.zip"), "--no-scene"]) == 0
    assert main(["archive", "replay", str(tmp_path / "bag.zip")]) == 0  # what is written is a whole session
    stored = read_stored_ply((out / "clouds" / "merged.ply").read_bytes(), "merged.ply")
    assert stored.intensity is not None
    bright = stored.points_mm[:, 0] < 525
    assert np.isnan(stored.intensity[~bright]).all()  # nobody says how bright the third scan's points came back
    expected = brightness(stored.points_mm[bright] - [500.0, 0.0, 0.0])
    assert stored.intensity[bright] == pytest.approx(expected, abs=0.01)
    assert (~bright).any()
