"""Reference meshes: what other programs write is read, and what is broken is refused in words."""

import io
import json
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from calib_core.errors import CalibrationError, InputError
from calib_core.formats.meshes import parse_mesh
from calib_core.formats.ply import ply_pieces
from calib_core.simulation.part import build_part
from tests.point_files import mesh_file

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
        ("box.obj", written("obj")),
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
    as_obj = parse_mesh(mesh_file("obj", part.points_mm, part.triangles), "a.obj")
    np.testing.assert_allclose(as_obj.corners_mm, part.points_mm, atol=1e-4)
    np.testing.assert_array_equal(as_obj.triangles, part.triangles)
    as_stl = parse_mesh(mesh_file("stl", part.points_mm, part.triangles), "a.stl")
    np.testing.assert_allclose(as_stl.corners_mm[as_stl.triangles], part.points_mm[part.triangles], atol=1e-4)


@pytest.mark.parametrize(("kind", "mm_per_unit"), [("stl", 1), ("obj", 1), ("ply", 1), ("glb", 1000)])
def test_another_program_reads_our_meshes_within_a_micrometre(kind: str, mm_per_unit: float) -> None:
    part = build_part()
    data = mesh_file(kind, part.points_mm, part.triangles)
    read = trimesh.load_mesh(io.BytesIO(data), file_type=kind, process=False)
    corners = mm_per_unit * np.asarray(read.vertices)[read.faces]
    np.testing.assert_allclose(corners, part.points_mm[part.triangles], atol=1e-3)


def test_a_glb_has_lengths_places_and_bounds_as_its_standard_asks() -> None:
    part = build_part()
    data = mesh_file("glb", part.points_mm, part.triangles)
    assert int.from_bytes(data[8:12], "little") == len(data)
    length = int.from_bytes(data[12:16], "little")
    scene = json.loads(data[20 : 20 + length])
    assert (length % 4, len(data) % 4) == (0, 0)
    positions = np.frombuffer(data[28 + length :], "<f4", 3 * len(part.points_mm)).reshape(-1, 3)
    told = scene["accessors"][0]
    np.testing.assert_array_equal(np.float32([told["min"], told["max"]]), [positions.min(0), positions.max(0)])


def test_a_3mf_is_a_package_with_its_unit_and_one_model() -> None:
    part = build_part()
    data = mesh_file("3mf", part.points_mm, part.triangles)
    with zipfile.ZipFile(io.BytesIO(data)) as package:
        assert package.testzip() is None
        (target,) = [each.attrib["Target"] for each in ElementTree.fromstring(package.read("_rels/.rels"))]
        model = ElementTree.fromstring(package.read(target.lstrip("/")))
        assert b"3dmanufacturing-3dmodel+xml" in package.read("[Content_Types].xml")
    assert model.attrib["unit"] == "millimeter"
    names = {"": "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"}
    corners = [[float(each.attrib[a]) for a in "xyz"] for each in model.iterfind(".//vertex", names)]
    triangles = [
        [int(each.attrib[a]) for a in ("v1", "v2", "v3")] for each in model.iterfind(".//triangle", names)
    ]
    np.testing.assert_allclose(corners, part.points_mm, atol=1e-3)
    np.testing.assert_array_equal(triangles, part.triangles)
    built, held = model.find("build/item", names), model.find("resources/object", names)
    assert built is not None
    assert held is not None
    assert built.attrib["objectid"] == held.attrib["id"]
    assert data == mesh_file("3mf", part.points_mm, part.triangles)


def test_an_obj_counts_corners_from_the_end_and_passes_over_textures() -> None:
    text = b"o part\nv 0 0 0\nv 1 0 0 # one\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf -4/1/1 -3/1/1 -2//1 -1\n"
    assert parse_mesh(text, "s.obj").triangles.tolist() == [[0, 1, 2], [0, 2, 3]]


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
        ("part.step", b"ISO-10303-21;", "STL, PLY or OBJ"),
        ("part.stl", b"", "announced"),
        ("part.stl", written("stl")[:-7], "announced"),
        ("part.stl", b"solid x\n vertex 1 2\nendsolid", "corner"),
        ("part.ply", written("ply")[:-5], "fewer bytes"),
        ("part.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n", "without a line end_header"),
        ("part.ply", written("ply").replace(b"float y", b"float x"), "alike"),
        ("part.obj", written("obj") + b"\nf 1 2 99999999999999999999", "not there"),
        ("part.obj", b"v 1 2\nf 1 1 1\n", "x, y and z"),
        ("part.obj", b"v 1 2 3\nf a b c\n", "line 2"),
        ("cloud.obj", b"v 1 2 3\nv 1 2 4\n", "no triangle"),
        ("cloud.ply", b"".join(bytes(p) for p in ply_pieces(np.eye(3))), "no triangle"),
    ],
)
def test_what_is_no_mesh_is_refused_in_words(name: str, data: bytes, words: str) -> None:
    with pytest.raises(InputError, match=words):
        parse_mesh(data, name)


@given(st.integers(0, 400), st.integers(0, 255), st.sampled_from(["stl", "ply", "obj"]))
def test_a_changed_byte_is_read_or_refused(at: int, value: int, kind: str) -> None:
    data = bytearray(written(kind))
    data[at % len(data)] = value
    try:
        mesh = parse_mesh(bytes(data), f"x.{kind}")
    except CalibrationError:
        return
    assert mesh.triangles.max() < len(mesh.corners_mm)
