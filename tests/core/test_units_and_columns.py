"""Units and columns: read as they truly are, or asked; never taken in silence."""

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib_core.errors import InputError
from calib_core.formats.format import PointKind
from calib_core.formats.points import FORMATS, read_file
from server.cli import main
from tests.core.point_file_forms import CLOUD, NORMALS, PROFILE, Form, forms, geo_keys, las, ptx, rows

FORMS = forms()


def is_right(form: Form) -> bool:
    reading = read_file(form.data, form.name, form.kind, settings=form.settings)
    points = reading.points[reading.known]
    return points.shape == form.truth_mm.shape and bool(np.abs(points - form.truth_mm).max() <= 2e-4)


def test_there_are_as_many_forms_as_are_promised() -> None:
    assert len(FORMS) >= 150


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.what)
def test_no_unit_and_no_column_is_misread_in_silence(form: Form) -> None:
    reading = read_file(form.data, form.name, form.kind, settings=form.settings)
    assert bool(reading.doubts) is form.asked, reading.doubts
    assert form.asked or is_right(form), reading.sentence()


def test_an_index_is_told_and_columns_that_are_told_are_not_doubted() -> None:
    counted = rows([np.arange(len(PROFILE)), PROFILE], ",").encode()
    assert "it is an index" in read_file(counted, "p.csv", "profile").notes[0]
    timed = rows([17.003 + 0.0021 * np.arange(len(PROFILE)), PROFILE], ",").encode()
    told = read_file(timed, "p.csv", "profile", settings={"columns": ["-", "x", "z"]})
    assert told.doubts == ()
    np.testing.assert_allclose(told.points, PROFILE, atol=1e-4)


@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize("kind", [None, "cloud"])
def test_whole_numbers_that_rise_beside_coordinates_are_asked_about(place: int, kind: PointKind | None) -> None:
    """Rows that brought nothing are left out of many files: their index has gaps, and was taken for x, y or z."""
    index = np.cumsum(np.random.default_rng(3).integers(1, 4, len(PROFILE))) + 7
    columns = [PROFILE[:, 0], PROFILE[:, 1]]
    columns.insert(place, index)
    doubts = read_file(rows(columns, " ").encode(), "c.xyz", kind).doubts
    assert any(f"column {place + 1} holds whole numbers that rise" in str(doubt) for doubt in doubts)


def test_pixels_of_a_profile_with_some_left_out_are_asked_about_and_whole_places_are_not() -> None:
    rises, z = np.cumsum(np.random.default_rng(3).integers(1, 3, len(PROFILE))), PROFILE[:, 1]
    assert "may be an index" in str(read_file(rows([rises, z], ",").encode(), "p.csv", "profile").doubts[0])
    for x in (2 * np.arange(len(z)), np.arange(len(z)) - 40):
        assert read_file(rows([x, z], ",").encode(), "p.csv", "profile").doubts == ()
    grid = np.column_stack([np.repeat(np.arange(20), 30), np.tile(np.arange(30), 20), np.linspace(0, 7.3, 600)])
    assert read_file(rows([grid], " ").encode(), "c.xyz", "cloud").doubts == ()


def test_a_column_between_x_and_z_that_stands_is_asked_about_unless_it_is_zero() -> None:
    """A file of z, brightness and x has it there too: its numbers were taken in their order, without a word."""
    stands = np.full(len(PROFILE), 120.0)
    for columns in ([PROFILE[:, 0], stands, PROFILE[:, 1]], [PROFILE[:, 1], stands, PROFILE[:, 0]]):
        assert "3 columns have no names" in read_file(rows(columns, ",").encode(), "p.csv", "profile").doubts[0]
    in_plane = [PROFILE[:, 0], np.zeros(len(PROFILE)), PROFILE[:, 1]]
    assert read_file(rows(in_plane, ",").encode(), "p.csv", "profile").doubts == ()


@pytest.mark.parametrize(("zone", "is_known"), [(32632, True), (25832, True), (26910, True), (4326, False)])
def test_a_projected_system_of_metres_is_known_by_its_code_and_another_is_asked_about(
    zone: int, is_known: bool
) -> None:
    reading = read_file(las(CLOUD, [(34735, geo_keys({1024: 1, 3072: zone}))]), "a.las", "cloud")
    assert (reading.unit, reading.unit_from) == (("m", "header") if is_known else ("mm", "assumed"))
    assert bool(reading.doubts) is not is_known


@pytest.mark.parametrize(("separator", "form"), [(",", ".4f"), (" ", ".6e")])
def test_a_last_number_that_was_cut_off_is_refused(separator: str, form: str) -> None:
    """A copy that ended early ends within a number as often as not: it was read, some millimetres off."""
    whole = rows([CLOUD], separator, form).encode()
    assert len(read_file(whole[:-1], "a.xyz", "cloud").points) == len(CLOUD)  # no end of line alone
    for left_out in (2, 3, 4):
        with pytest.raises(InputError, match="as whole as those before"):
            read_file(whole[:-left_out], "a.xyz", "cloud")


def test_a_cloud_in_degrees_is_refused() -> None:
    with pytest.raises(InputError, match="in degrees"):
        read_file(las(CLOUD, [(34735, geo_keys({1024: 2}))]), "a.las", "cloud")
    geographic = [(2112, b'GEOGCS["WGS 84",UNIT["degree",0.0174532925199433]]')]
    with pytest.raises(InputError, match="in degrees"):
        read_file(las(CLOUD, geographic), "a.las", "cloud")


def test_a_scan_has_its_pose_and_a_damaged_one_is_named() -> None:
    grid = np.vstack([CLOUD, CLOUD])[:28]
    scan_poses = FORMATS.get("ptx").scan_poses
    assert scan_poses is not None
    first, second = scan_poses(ptx([grid, grid]), "a.ptx")
    assert (first, second) == (np.eye(4).ravel().tolist(), [1, 0, 0, 1000, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
    with pytest.raises(InputError, match="28 points, as its grid says"):
        read_file(ptx([grid])[:-80], "a.ptx", "cloud")
    with pytest.raises(InputError, match="2 scans"):
        read_file(ptx([grid, grid]), "a.ptx", "cloud")


def e57_with_normals(path: Path) -> bytes:
    """A file whose points have the extension for normals, by the library itself."""
    libe57: Any = importlib.import_module("pye57.libe57")

    file = libe57.ImageFile(str(path), "w")
    file.extensionsAdd("nor", "http://www.libe57.org/E57_NOR_surface_normals.txt")
    root = file.root()
    for name, text in (
        ("formatName", "ASTM E57 3D Imaging Data File"),
        ("guid", "{a}"),
        ("coordinateMetadata", ""),
    ):
        root.set(name, libe57.StringNode(file, text))
    root.set("versionMajor", libe57.IntegerNode(file, 1))
    root.set("versionMinor", libe57.IntegerNode(file, 0))
    scans = libe57.VectorNode(file, True)
    root.set("data3D", scans)
    scan, fields = libe57.StructureNode(file), libe57.StructureNode(file)
    scan.set("guid", libe57.StringNode(file, "{b}"))
    values = {f"cartesian{axis}": CLOUD[:, k] / 1000 for k, axis in enumerate("XYZ")}
    values |= {f"nor:normal{axis}": NORMALS[:, k].copy() for k, axis in enumerate("XYZ")}
    buffers = libe57.VectorSourceDestBuffer()
    for name, column in values.items():
        fields.set(name, libe57.FloatNode(file, 0.0, libe57.E57_DOUBLE, -10.0, 10.0))
        buffers.append(libe57.SourceDestBuffer(file, name, column, len(column), True, True))
    points = libe57.CompressedVectorNode(file, fields, libe57.VectorNode(file, True))
    scan.set("points", points)
    scans.append(scan)
    writer = points.writer(buffers)
    writer.write(len(CLOUD))
    writer.close()
    file.close()
    return path.read_bytes()


def test_an_e57_with_normals_is_read(tmp_path: Path) -> None:
    pytest.importorskip("pye57")
    read = read_file(e57_with_normals(tmp_path / "a.e57"), "a.e57", "cloud")
    np.testing.assert_allclose(read.points, CLOUD, atol=1e-9)


def test_merge_says_which_scan_is_doubtful(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.xyz").write_text(rows([CLOUD / 1e6], " ", ".10f"))
    main(["merge", str(tmp_path / "a.xyz"), "--mesh", "none"])
    assert "a.xyz: All points lie within" in capsys.readouterr().err
