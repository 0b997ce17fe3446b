"""Reference meshes: what other programs write is read, and what is broken is refused in words."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from calib_core.errors import CalibrationError, InputError
from calib_core.formats.meshes import parse_mesh
from calib_core.formats.ply import ply_pieces
from calib_core.simulation.part import build_part
from tests.point_files import stl_pieces

BOX = trimesh.creation.box((30.0, 20.0, 10.0))


def written(kind: str, **options: object) -> bytes:
    data = BOX.export(file_type=kind, **options)
    return data.encode() if isinstance(data, str) else data


def surface(corners: np.ndarray, triangles: np.ndarray) -> tuple[float, float]:
    mesh = trimesh.Trimesh(corners, triangles, process=False)
    return float(mesh.area), float(mesh.volume)


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("box.stl", written("stl")),
        ("box.STL", written("stl_ascii")),
        ("box.ply", written("ply")),
        ("box.ply", written("ply", encoding="ascii")),
    ],
)
def test_what_another_program_wrote_has_its_area_and_volume(name: str, data: bytes) -> None:
    mesh = parse_mesh(data, name)
    assert surface(mesh.corners_mm, mesh.triangles) == pytest.approx((2 * (600 + 300 + 200), 6000), rel=1e-5)


def test_our_own_meshes_come_back() -> None:
    part = build_part()
    as_ply = parse_mesh(b"".join(bytes(p) for p in ply_pieces(part.points_mm, triangles=part.triangles)), "a.ply")
    np.testing.assert_allclose(as_ply.corners_mm, part.points_mm, atol=1e-4)
    np.testing.assert_array_equal(as_ply.triangles, part.triangles)
    as_stl = parse_mesh(b"".join(bytes(p) for p in stl_pieces(part.points_mm, part.triangles)), "a.stl")
    np.testing.assert_allclose(as_stl.corners_mm[as_stl.triangles], part.points_mm[part.triangles], atol=1e-4)


def test_faces_of_four_corners_are_cut_in_two() -> None:
    square = "ply\nformat {}\nelement vertex 4\n" + "".join(f"property float {a}\n" for a in "xyz")
    square += "element face 1\nproperty list uchar int vertex_index\nend_header\n"
    text = square.format("ascii 1.0") + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype="<f4")
    binary = square.format("binary_little_endian 1.0").encode() + corners.tobytes()
    binary += b"\x04" + np.arange(4, dtype="<i4").tobytes()
    for data in (text.encode(), binary):
        assert parse_mesh(data, "s.ply").triangles.tolist() == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("part.step", b"ISO-10303-21;", "STL or PLY"),
        ("part.stl", b"", "announced"),
        ("part.stl", written("stl")[:-7], "announced"),
        ("part.stl", b"solid x\n vertex 1 2\nendsolid", "corner"),
        ("part.ply", written("ply")[:-5], "fewer bytes"),
        ("part.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n", "without a line end_header"),
        ("part.ply", written("ply").replace(b"float y", b"float x"), "alike"),
        ("cloud.ply", b"".join(bytes(p) for p in ply_pieces(np.eye(3))), "no triangle"),
    ],
)
def test_what_is_no_mesh_is_refused_in_words(name: str, data: bytes, words: str) -> None:
    with pytest.raises(InputError, match=words):
        parse_mesh(data, name)


@given(st.integers(0, 400), st.integers(0, 255), st.sampled_from(["stl", "ply"]))
def test_a_changed_byte_is_read_or_refused(at: int, value: int, kind: str) -> None:
    data = bytearray(written(kind))
    data[at % len(data)] = value
    try:
        mesh = parse_mesh(bytes(data), f"x.{kind}")
    except CalibrationError:
        return
    assert mesh.triangles.max() < len(mesh.corners_mm)
