"""Files of clouds and meshes, read back by this project's readers, by Open3D and by trimesh."""

import os
import struct
from pathlib import Path

import numpy as np
import pytest

from calib_core.errors import InputError
from calib_core.formats.ply import ply_pieces
from calib_core.formats.points import parse_cloud, read_file
from calib_core.formats.shared.writing import write_pieces
from calib_core.kernels.checksum import crc32c_rows
from tests.point_files import cloud_pieces, mesh_file

POINTS = np.random.default_rng(0).uniform(-300, 300, (20_000, 3)).astype(np.float32)
NORMALS = POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)
WITH_NORMALS = np.hstack([POINTS, NORMALS])
NAMES = ("x", "y", "z", "nx", "ny", "nz")


@pytest.mark.parametrize("ending", ["ply", "pcd", "xyz"])
def test_this_projects_own_readers_read_what_was_written(tmp_path: Path, ending: str):
    path = tmp_path / f"cloud.{ending}"
    size = write_pieces(path, cloud_pieces(path.name, POINTS))
    assert size == path.stat().st_size
    atol = 1e-5 if ending == "xyz" else 0
    np.testing.assert_allclose(parse_cloud(path.read_bytes(), path.name), POINTS, rtol=0, atol=atol)


def test_open3d_and_trimesh_read_ply_as_it_was(tmp_path: Path):
    import open3d as o3d
    import trimesh

    path = tmp_path / "cloud.ply"
    write_pieces(path, ply_pieces(WITH_NORMALS, NAMES))
    theirs = o3d.io.read_point_cloud(str(path))
    np.testing.assert_array_equal(np.asarray(theirs.points), POINTS)
    np.testing.assert_array_equal(np.asarray(theirs.normals), NORMALS)
    np.testing.assert_array_equal(trimesh.load(path).vertices, POINTS)


def test_open3d_reads_pcd_with_normals(tmp_path: Path):
    import open3d as o3d

    path = tmp_path / "cloud.pcd"
    write_pieces(path, cloud_pieces(path.name, WITH_NORMALS, NAMES))
    theirs = o3d.io.read_point_cloud(str(path))
    np.testing.assert_array_equal(np.asarray(theirs.points), POINTS)
    np.testing.assert_array_equal(np.asarray(theirs.normals), NORMALS)


def test_checksum_is_that_of_the_published_example():
    assert crc32c_rows(np.array([[*b"123456789"]], np.uint8))[0] == 0xE3069283


def read_e57(data: bytes) -> np.ndarray:
    """The points (N, 3) of an E57 file by the standard's structure: pages, section, packets."""
    pages = np.frombuffer(data, np.uint8).reshape(-1, 1024)
    assert np.array_equal(pages[:, 1020:].copy().view(">u4").ravel(), crc32c_rows(pages[:, :1020].copy()))
    signature, major, minor, length, xml_at, xml_length, page = struct.unpack("<8sIIQQQQ", data[:48])
    assert (signature, major, minor, length, page) == (b"ASTM-E57", 1, 0, len(data), 1024)
    logical = pages[:, :1020].tobytes()

    def place(physical: int) -> int:
        return physical // 1024 * 1020 + physical % 1024

    xml = logical[place(xml_at) : place(xml_at) + xml_length].decode()
    assert xml.rstrip().endswith("</e57Root>")
    kind, size, data_at, _ = struct.unpack("<B7xQQQ", logical[48:80])
    assert kind == 1
    at, blocks = place(data_at), []
    while at < 48 + size:
        packet, _, last, streams = struct.unpack("<BBHH", logical[at : at + 6])
        if packet == 1:
            assert streams == 3
            lengths = struct.unpack("<HHH", logical[at + 6 : at + 12])
            block = np.frombuffer(logical, "<f4", sum(lengths) // 4, at + 12)
            blocks.append(block.reshape(3, -1).T)
        at += last + 1
    assert f'recordCount="{sum(map(len, blocks))}"' in xml
    return np.concatenate(blocks)


@pytest.mark.parametrize("count", [1, 5400, 20_000])
def test_e57_has_the_structure_of_the_standard_and_counts_in_metres(count: int):
    data = b"".join(bytes(piece) for piece in cloud_pieces("a.e57", POINTS[:count]))
    np.testing.assert_allclose(read_e57(data), POINTS[:count] / 1000, rtol=1e-6)


def test_las_is_read_by_laspy_and_says_that_it_is_in_metres(tmp_path: Path):
    import laspy

    far = POINTS.astype(np.float64) + np.array([1_200_000.0, -3000.0, 0.0])
    for points in (POINTS, far):
        path = tmp_path / "cloud.las"
        write_pieces(path, cloud_pieces(path.name, points))
        theirs = laspy.read(path)
        single = points.astype(np.float32)
        np.testing.assert_allclose(1000 * theirs.xyz, single, rtol=0, atol=6e-4)
        np.testing.assert_allclose(1000 * np.array([theirs.header.mins, theirs.header.maxs]),
                                   [single.min(0), single.max(0)], rtol=0, atol=6e-4)  # fmt: skip
        reading = read_file(path.read_bytes(), path.name)
        assert (reading.unit, reading.unit_from, reading.sure) == ("m", "header", "stated")
        np.testing.assert_allclose(reading.points, single, rtol=0, atol=6e-4)
    apart = np.array([[0, 0, 0], [3e6, 0, 0]])
    with pytest.raises(InputError, match="2 km"):
        list(cloud_pieces("a.las", apart))


def test_a_full_disk_leaves_the_old_file_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "cloud.ply"
    path.write_bytes(b"what was there")
    written = 0

    def full(_handle: int, data: memoryview) -> int:
        nonlocal written
        if written:
            raise OSError(28, "No space left on device")
        written = min(len(data), 1000)
        return written

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(InputError, match=r"cloud.ply.*No space left on device.*Make room"):
        write_pieces(path, ply_pieces(POINTS))
    monkeypatch.undo()
    assert path.read_bytes() == b"what was there"
    assert [p.name for p in tmp_path.iterdir()] == ["cloud.ply"]


def test_a_failure_between_the_pieces_leaves_nothing(tmp_path: Path):
    def pieces():
        yield b"half"
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_pieces(tmp_path / "cloud.ply", pieces())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("ending", ["ply", "pcd", "xyz", "e57", "las"])
def test_a_cloud_without_points_is_refused(ending: str):
    with pytest.raises(InputError, match="at least one point"):
        list(cloud_pieces(f"a.{ending}", np.empty((0, 3))))
    with pytest.raises(InputError, match="at least one point"):
        list(ply_pieces(np.empty((0, 3))))


def test_columns_without_names_and_wrong_corners_are_refused():
    with pytest.raises(InputError, match="3 columns"):
        list(ply_pieces(WITH_NORMALS))
    with pytest.raises(InputError, match="corners among 3"):
        mesh_file("stl", POINTS[:3], [[0, 1, 3]])
    with pytest.raises(InputError, match="three corners"):
        list(ply_pieces(POINTS, triangles=np.empty((0, 3), int)))
