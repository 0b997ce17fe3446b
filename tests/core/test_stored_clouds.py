"""Merged clouds read back and exported: the same points in every format, and no fault in what others wrote."""

import io
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from calib_core.archive.folder import save_session
from calib_core.archive.stored_clouds import StoredFile, in_format, media_types, read_stored_ply, requested
from calib_core.errors import InputError, NotFoundError
from calib_core.formats.ply import ply_pieces
from calib_core.formats.points import parse_cloud
from calib_core.formats.shared.writing import write_pieces
from server.cli import main
from tests.core.test_session_merge import session
from tests.point_files import cloud_pieces, mesh_file

NAMES = ("x", "y", "z", "nx", "ny", "nz", "sigma")
POINTS = np.random.default_rng(5).normal(0, 100, (50, 7)).astype(np.float32)
TRIANGLES = np.random.default_rng(6).integers(0, 50, (20, 3))
CLOUD = b"".join(ply_pieces(POINTS, NAMES))
MESH = b"".join(ply_pieces(POINTS[:, :3], triangles=TRIANGLES))


def converted(data: bytes, wanted: str) -> bytes:
    return b"".join(in_format(StoredFile(io.BytesIO(data), "clouds/a.ply"), wanted, "clouds/a.ply"))


def test_what_was_written_is_read_back():
    cloud, mesh = read_stored_ply(CLOUD, "cloud"), read_stored_ply(MESH, "mesh")
    assert cloud.names == NAMES
    assert cloud.triangles is None
    np.testing.assert_array_equal(cloud.values, POINTS)
    np.testing.assert_array_equal(mesh.values, POINTS[:, :3])
    np.testing.assert_array_equal(mesh.triangles, TRIANGLES)
    assert converted(CLOUD, "ply") == CLOUD
    assert converted(MESH, "ply") == MESH


@given(st.binary(max_size=300), st.integers(0, len(MESH)), st.booleans())
def test_what_another_program_wrote_is_refused_and_never_a_fault(noise: bytes, cut: int, tail: bool):
    for data in (noise, MESH[:cut] + noise) if not tail else (MESH + noise, MESH[:cut] + noise + MESH[cut:]):
        if data != MESH:
            try:
                read_stored_ply(data, "clouds/mesh.ply")
            except InputError as error:
                assert error.where == "clouds/mesh.ply"  # noqa: PT017 (a lucky change may still be a mesh)


def test_requests_name_a_file_and_a_format():
    assert requested("merged.ply", None) == ("clouds/merged.ply", "ply")
    assert requested("merged.E57", None) == ("clouds/merged.ply", "e57")
    assert requested("mesh", "stl") == ("clouds/mesh.ply", "stl")
    assert requested("merged", None) == ("clouds/merged.ply", "ply")
    assert requested("merged.ply", "xyz") == ("clouds/merged.ply", "xyz")
    for name in ("merged.doc", "../../session", "a.b.c"):
        with pytest.raises(NotFoundError, match="pcd, ply"):
            requested(name, None)


def test_a_cloud_has_no_triangles_and_a_mesh_is_no_cloud():
    for data, wanted, said in ((CLOUD, "stl", "the mesh"), (MESH, "e57", "the cloud")):
        with pytest.raises(InputError, match=said):
            in_format(StoredFile(io.BytesIO(data), ""), wanted, "")


def test_a_file_read_in_blocks_gives_the_same_as_one_in_memory(tmp_path: Path):
    rng = np.random.default_rng(4)
    points = rng.normal(0, 100, (100_001, 4)).astype(np.float32)
    triangles = rng.integers(0, 100_001, (150_001, 3))
    cloud = b"".join(ply_pieces(points, ("x", "y", "z", "scan")))
    assert converted(cloud, "pcd") == b"".join(cloud_pieces("a.pcd", points, ("x", "y", "z", "scan")))
    assert converted(cloud, "xyz") == b"".join(cloud_pieces("a.xyz", points[:, :3]))
    assert converted(cloud, "e57") == b"".join(cloud_pieces("a.e57", points[:, :3]))
    mesh = tmp_path / "mesh.ply"
    write_pieces(mesh, ply_pieces(points[:, :3], triangles=triangles))
    with mesh.open("rb") as file:
        stl = b"".join(in_format(StoredFile(file, "mesh"), "stl", "mesh"))
    assert stl == mesh_file("stl", points[:, :3], triangles)


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("wanted", ["ply", "pcd", "xyz", "e57", "stl"])
def test_a_format_is_made_in_bounded_memory(tmp_path: Path, wanted: str):
    """The largest part are the lines of XYZ, a block of which are Python's own numbers for a while."""
    rng = np.random.default_rng(5)
    file = tmp_path / "a.ply"
    if wanted == "stl":
        points = rng.normal(0, 100, (200_000, 3)).astype(np.float32)
        write_pieces(file, ply_pieces(points, triangles=rng.integers(0, 200_000, (2_000_000, 3))))
    else:
        write_pieces(file, ply_pieces(rng.normal(0, 100, (1_000_000, 7)).astype(np.float32), NAMES))
    size = file.stat().st_size
    with file.open("rb") as content:
        pieces = in_format(StoredFile(content, "a"), wanted, "a")
        next(pieces)  # imports and compiled functions
        tracemalloc.start()
        total = 0
        for piece in pieces:
            total += len(piece)
            if total > 12_000_000:  # what kept all of it would be seen by now
                break
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert size >= 28_000_000
    assert total > 10_000_000
    assert peak < 18_000_000


@pytest.mark.thorough
def test_export_writes_every_format_and_merges_first_where_needed(tmp_path: Path, capsys):
    folder = tmp_path / "part"
    record, files = session(mesh="grid")
    save_session(folder, record, files)
    for name in media_types():
        out = tmp_path / f"cloud.{name}"
        if name == "pcd":
            assert main(["run", str(folder), "--stage", "merge"]) == 0  # from here on it is stored
        assert main(["export", str(folder), "--format", name, "--out", str(out)]) == 0
    assert not list(folder.glob("results/*"))[1:]
    points = {
        name: parse_cloud((tmp_path / f"cloud.{name}").read_bytes(), f"cloud.{name}") for name in ("ply", "pcd")
    }
    np.testing.assert_array_equal(points["ply"], points["pcd"])
    assert (tmp_path / "cloud.ply").read_bytes() == (folder / "clouds/merged.ply").read_bytes()
    np.testing.assert_allclose(np.loadtxt(tmp_path / "cloud.xyz"), points["ply"], atol=1e-5)
    surface = trimesh.load_mesh(io.BytesIO((tmp_path / "cloud.stl").read_bytes()), file_type="stl")
    assert len(surface.faces) > len(points["ply"]) / 2
    assert (tmp_path / "cloud.e57").read_bytes()[:8] == b"ASTM-E57"
    capsys.readouterr()


@pytest.mark.thorough
def test_export_says_what_is_missing(tmp_path: Path, capsys):
    record, files = session(mesh="none")
    save_session(tmp_path / "part", record, files)
    out = tmp_path / "mesh.stl"
    assert main(["export", str(tmp_path / "part"), "--format", "stl", "--out", str(out)]) == 2
    assert "cell.merge.mesh" in capsys.readouterr().err
    assert not out.exists()
    assert main(["export", str(tmp_path / "part"), "--format", "docx"]) == 2
    assert "e57" in capsys.readouterr().err
    full = Path("/dev/full/cloud.ply")
    assert main(["export", str(tmp_path / "part"), "--format", "ply", "--out", str(full)]) == 2
    assert "place to write" in capsys.readouterr().err
