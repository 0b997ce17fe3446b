"""Formats: what scanners' programs write, read as it truly is, or refused with the line or the column."""

import io
import random
import re
import sys

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.errors import CalibrationError, InputError
from calib_core.formats.points import FORMATS, endings_of, parse_cloud, parse_profile, read_file
from tests.core.scanner_files import ScannerFile, cloud_of, known, las, profile, scanner_files, surface
from tests.core.table_mutations import verdict_of
from tests.point_files import cloud_pieces

CLOUD = known(cloud_of(*surface()))


def named(file: ScannerFile) -> str:
    return f"{file.brand}: {file.variant}"


@pytest.mark.parametrize("file", scanner_files(), ids=named)
def test_every_brands_files_give_their_points_and_no_missing_value(file: ScannerFile) -> None:
    reading = read_file(file.data, file.name, file.kind, settings=file.settings)
    assert reading.kind == file.kind
    np.testing.assert_allclose(reading.points[reading.known], known(file.truth_mm), atol=file.digits_mm, rtol=0)
    assert reading.doubts == ()
    assert {"profile": {"x", "z"}, "cloud": {"x", "y", "z"}}[file.kind] == set(reading.columns)


@pytest.mark.parametrize("file", [f for f in scanner_files() if not f.name.endswith((".png", ".tif"))], ids=named)
def test_the_kind_is_known_without_being_told(file: ScannerFile) -> None:
    reading = read_file(file.data, file.name, settings=file.settings)
    assert reading.kind == ("cloud" if file.name.endswith(".ply") else file.kind)


def test_blank_columns_keep_their_place_for_a_scans_grid() -> None:
    for file in scanner_files():
        if file.kind == "profile" and len(file.truth_mm) == len(profile()) and file.name != "p.ply":
            points = read_file(file.data, file.name, "profile", settings=file.settings).points
            np.testing.assert_array_equal(
                np.isnan(points[:, 1]), np.isnan(file.truth_mm[:, 1]), err_msg=named(file)
            )


ROWS = "1,2,3,4\n2,3,4,5\n3,4,5,6\n"


@pytest.mark.parametrize(
    ("header", "kind", "columns"),
    [
        ("index,x,y,z", "cloud", [1, 2, 3]),
        ("z,y,x,q", "cloud", [2, 1, 0]),
        ("x_mm,quality,z_mm,t", "profile", [0, 2]),
        ("Intensity,X-Axis [mm],Y-Axis [mm],Height [mm]", "cloud", [1, 2, 3]),
        ("Pos. X (mm),Pos. Y (mm),Pos. Z (mm),R", "cloud", [0, 1, 2]),
        ("cartesianX,cartesianY,cartesianZ,i", "cloud", [0, 1, 2]),
    ],
)
def test_columns_are_taken_by_their_names(header: str, kind: str, columns: list[int]) -> None:
    table = np.array([[1, 2, 3, 4], [2, 3, 4, 5], [3, 4, 5, 6]], dtype=float)
    for name in ("a.csv", "a.txt", "a.xyz"):
        reading = read_file(f"{header}\n{ROWS}".encode(), name)
        assert reading.kind == kind
        np.testing.assert_array_equal(reading.points, table[:, columns])


@pytest.mark.parametrize(
    ("text", "kind", "said"),
    [
        ("index,x,y\n1,2,3\n", None, "no column named z in the header above line 2: 'index', 'x', 'y'"),
        ("x,y,z,x\n1,2,3,4\n", None, "2 columns named x in the header above line 2"),
        ("a,b,c\n1,2,3\n", "cloud", "no column named x or z"),
        ("x,z,i\n1,2,3\n4,5,6\n", "cloud", "a profile with the columns x, z"),
        ("x,y,z\n1,2,3\n4,5,6\n", "profile", "a cloud with the columns x, y, z"),
        ("X [px],Z [px]\n1,2\n", None, "no column named x or z"),
        ("5\n1 2 3\n4 5 6\n", "cloud", "need the 5 points that the first line announces, got 2"),
        ("1;2,5\n3;4.5\n", "profile", "both, first in line 2"),
        ("1;2\nabc;3\n4;5\n", "profile", "'abc' in line 2"),
        ("x;z\n1;2\n\n3;4;5\n", "profile", "3 in line 4"),
    ],
)
def test_columns_that_do_not_fit_are_named(text: str, kind: str | None, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_file(text.encode(), "a.txt", kind)


@pytest.mark.parametrize(
    "missing", ["-999", "-999.9999", "-9999.99", "65535", "32768", "-32768", "1e6", "1e+10", "-1.#IND", "1.#QNAN",
                "nan(ind)", "3.40282347e+38", "NaN", "", "0", "0.0000", "-2147483648", "99999", "---", "9999.998"]
)  # fmt: skip
@pytest.mark.parametrize("share", [0.04, 0.9])
def test_a_value_that_stands_for_nothing_is_no_point(missing: str, share: float) -> None:
    points = profile(100)
    points = known(points)
    gone = np.random.default_rng(3).uniform(size=len(points)) < share
    lines = [f"{x:.3f};{missing if g else f'{z:.3f}'}" for (x, z), g in zip(points, gone, strict=True)]
    reading = read_file("\n".join(lines).encode(), "p.csv", "profile")
    np.testing.assert_allclose(reading.points[reading.known], points[~gone], atol=6e-4)
    assert reading.missing == gone.sum()


@pytest.mark.parametrize("z", [[-1.0, 0.0, 1.0, 2.0], [0.0, 0.0, 0.0, 0.0], [-998.9, -999.0, -999.1, -999.2]])
def test_true_heights_stay_points(z: list[float]) -> None:
    text = "\n".join(f"{x};{value}" for x, value in enumerate(z, start=1))
    np.testing.assert_array_equal(parse_profile(text.encode(), "p.csv")[:, 1], z)


def test_what_looks_like_metres_is_doubted_and_not_scaled() -> None:
    metres = known(profile()) / 1000
    text = "\n".join(f"{x:.7f},{z:.7f}" for x, z in metres).encode()
    reading = read_file(text, "p.csv", "profile")
    assert reading.sure == "doubtful"
    assert "look like metres" in reading.doubts[0]
    np.testing.assert_allclose(reading.points, metres, atol=1e-7)
    told = read_file(text, "p.csv", "profile", settings={"unit": "m"})
    assert told.sure == "usual"
    np.testing.assert_allclose(told.points, metres * 1000, atol=1e-4)


def test_what_a_user_says_goes_before_the_file_and_typing_errors_are_named() -> None:
    reading = read_file(b"a,b,c\n1,2,3\n4,5,6\n", "a.csv", settings={"columns": ["z", "-", "x"], "missing": [6]})
    assert reading.points[reading.known].tolist() == [[3.0, 1.0]]
    for wrong in ({"unit": "furlong"}, {"colums": []}, {"columns": ["x", "z"]}):
        with pytest.raises(InputError, match=r"unit|colums|columns"):
            read_file(b"1,2,3\n4,5,6\n", "a.csv", settings=wrong)


def test_las_laz_and_e57() -> None:
    import laspy

    data = las(CLOUD)
    np.testing.assert_allclose(parse_cloud(data, "c.las"), CLOUD, atol=1e-4)
    packed = io.BytesIO()
    laspy.read(io.BytesIO(data)).write(packed, do_compress=True)
    np.testing.assert_allclose(parse_cloud(packed.getvalue(), "c.laz"), CLOUD, atol=1e-4)
    e57 = b"".join(bytes(piece) for piece in cloud_pieces("c.e57", CLOUD))
    reading = read_file(e57, "c.e57")
    np.testing.assert_allclose(reading.points, CLOUD, atol=1e-5)
    assert (reading.unit, reading.unit_from, reading.sure) == ("m", "format", "stated")


@pytest.mark.parametrize(
    ("place", "value", "match"),
    [
        ("item size", b"\xff\xff", "in its packing"),
        ("first point", b"\xff\xff\xff\x7f", "begin at byte"),
        ("records", b"\xff\xff\xff\xff", "records before"),
        ("table", b"\xff\xff\xff\xff\xff\xff\xff\x00", "table of its pieces"),
        ("pieces", b"\xff\xff\xff\x7f", "2147483647"),
    ],
)
def test_a_header_that_claims_too_much_reserves_nothing(place: str, value: bytes, match: str) -> None:
    """Each of these took seconds and gigabytes before it failed."""
    import laspy

    packed = io.BytesIO()
    laspy.read(io.BytesIO(las(CLOUD))).write(packed, do_compress=True)
    data = bytearray(packed.getvalue())
    first = int.from_bytes(data[96:100], "little")
    table = int.from_bytes(data[first : first + 8], "little")
    item = data.index(b"laszip encoded") - 2 + 54 + 32 + 2 + 2
    at = {"item size": item, "first point": 96, "records": 100, "table": first, "pieces": table + 4}[place]
    data[at : at + len(value)] = value
    with pytest.raises(CalibrationError, match=match):
        parse_cloud(bytes(data), "c.laz")


def test_without_its_extra_an_e57_is_refused_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    e57 = b"".join(bytes(piece) for piece in cloud_pieces("c.e57", CLOUD))
    monkeypatch.setitem(sys.modules, "pye57", None)  # as where it is not installed
    with pytest.raises(InputError, match=re.escape("pip install 'scancell[e57]'")):
        read_file(e57, "c.e57")


@pytest.mark.parametrize(("name", "count"), [("c.las", 60), ("c.laz", 30), ("c.e57", 40)])
def test_damaged_las_and_e57_are_refused(name: str, count: int) -> None:
    import laspy

    whole = las(CLOUD)
    if name.endswith("z"):
        packed = io.BytesIO()
        laspy.read(io.BytesIO(whole)).write(packed, do_compress=True)
        whole = packed.getvalue()
    if name.endswith("57"):
        whole = b"".join(bytes(piece) for piece in cloud_pieces("c.e57", CLOUD))
    for cut in (3, 100, 230, len(whole) // 2, len(whole) - 30):
        with pytest.raises(CalibrationError):
            parse_cloud(whole[:cut], name)
    chance = random.Random(5)
    for _ in range(count):
        data = bytearray(whole)
        data[chance.randrange(min(len(data), 500))] = chance.randrange(256)
        try:
            parse_cloud(bytes(data), name)
        except CalibrationError:
            continue


def opencv_file(kind: str, **nodes: object) -> bytes:
    storage = cv2.FileStorage(f".{kind}", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    for key, value in nodes.items():
        storage.write(key, value)
    return storage.releaseAndGetString().encode()


@pytest.mark.parametrize("kind", ["yml", "xml"])
def test_opencv_matrices_and_lists(kind: str) -> None:
    name = f"p.{kind}"
    np.testing.assert_allclose(parse_cloud(opencv_file(kind, points=CLOUD), name), CLOUD)
    organised = np.where(np.isnan(cloud_of(*surface())), np.nan, cloud_of(*surface())).reshape(9, 14, 3)
    assert read_file(opencv_file(kind, grid=organised), name).grid == (9, 14)
    beside = opencv_file(kind, points=CLOUD, camera=np.eye(3), intensity=np.arange(float(len(CLOUD))))
    np.testing.assert_allclose(parse_cloud(beside, name), CLOUD)
    both = opencv_file(kind, points=CLOUD, points2=2 * CLOUD)
    with pytest.raises(InputError, match="2: points, points2"):
        parse_cloud(both, name)
    np.testing.assert_allclose(read_file(both, name, settings={"node": "points2"}).points, 2 * CLOUD)
    with pytest.raises(InputError, match="none"):
        parse_cloud(opencv_file(kind, name="nothing"), name)


@pytest.mark.parametrize("kind", ["yml", "xml"])
def test_opencv_profiles_of_any_shape(kind: str) -> None:
    points = known(profile())
    with_y = np.insert(points, 1, 0.0, axis=1)
    for nodes in (
        {"scan_line": with_y},
        {"a": with_y.T.copy()},
        {"a": points.T.copy()},
        {"a": with_y.reshape(1, -1)},
        {"a": points.reshape(-1, 1, 2)},
        {"x": points[:, 0].copy(), "z": points[:, 1].copy()},
        {"camera_matrix": np.eye(3), "profile": points, "distortion": np.zeros((1, 5))},
    ):
        np.testing.assert_allclose(parse_profile(opencv_file(kind, **nodes), f"p.{kind}"), points)


@pytest.mark.parametrize("width", [2, 3])
def test_opencv_lists_of_plain_numbers(width: int) -> None:
    points = known(profile())
    rows = points if width == 2 else np.insert(points, 1, 0.0, axis=1)
    numbers = [f"{v:.8e}" for v in rows.ravel()]
    yaml = f"%YAML:1.0\n---\nscan_line: [ {', '.join(numbers)} ]\n"
    node = f"<scan_line>\n{' '.join(numbers)}</scan_line>"
    xml = f"<?xml version='1.0'?>\n<opencv_storage>\n{node}\n</opencv_storage>\n"
    for text, name in ((yaml, "p.yml"), (xml, "p.xml")):
        np.testing.assert_allclose(parse_profile(text.encode(), name), points, atol=1e-6)
    with pytest.raises(InputError):
        parse_profile(yaml[: len(yaml) // 2].encode(), "p.yml")


def test_opencv_lists_of_points() -> None:
    rows = "\n".join(f"   - [ {x}, {z} ]" for x, z in known(profile()))
    text = f"%YAML:1.0\n---\npoints:\n{rows}\n".encode()
    np.testing.assert_allclose(parse_profile(text, "p.yaml"), known(profile()))
    flat = "%YAML:1.0\n---\npoints: [ 1., 2., 3., 4., 5., 6. ]\n"
    assert parse_cloud(flat.encode(), "p.yaml").tolist() == [[1, 2, 3], [4, 5, 6]]
    assert parse_profile(flat.encode(), "p.yaml").tolist() == [[1, 2], [3, 4], [5, 6]]
    for bad in (
        flat[:30],
        flat.replace("]", ""),
        "%YAML:1.0\n---\n- {",
        "<?xml version='1.0'?><opencv_storage><a>",
    ):
        with pytest.raises(InputError):
            parse_cloud(bad.encode(), "p.yaml" if bad[0] == "%" else "p.xml")


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_a_range_grid_in_ply_is_an_organised_cloud(order: str) -> None:
    points = cloud_of(*surface()).reshape(9, 14, 3)
    points[2, 3] = points[7, :5] = np.nan
    seen = np.isfinite(points[..., 0]).ravel()
    numbers = np.where(seen, np.cumsum(seen) - 1, -1)
    head = (
        f"ply\nformat {order} 1.0\nobj_info num_cols 14\nobj_info num_rows 9\nelement vertex {seen.sum()}\n"
        "property float x\nproperty float y\nproperty float z\nelement range_grid 126\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    rows = points.reshape(-1, 3)[seen]
    if order == "ascii":
        lines = [" ".join(f"{v:.5f}" for v in row) for row in rows.tolist()]
        body = "\n".join([*lines, *("0" if n < 0 else f"1 {n}" for n in numbers.tolist())]).encode() + b"\n"
    else:
        sign = "<" if "little" in order else ">"
        cells = [b"\0" if n < 0 else b"\1" + np.array(n, f"{sign}i4").tobytes() for n in numbers.tolist()]
        body = rows.astype(f"{sign}f4").tobytes() + b"".join(cells)
    reading = read_file(head.encode() + body, "view.ply")
    assert reading.grid == (9, 14)
    np.testing.assert_allclose(reading.points, points.reshape(-1, 3), atol=1e-4)
    with pytest.raises(InputError, match="range_grid"):
        read_file(head.encode() + body[:-9], "view.ply")


def test_organised_and_height_arrays() -> None:
    def npy(array: np.ndarray) -> bytes:
        stream = io.BytesIO()
        np.save(stream, array)
        return stream.getvalue()

    x, y, z = surface()
    points = cloud_of(x, y, z)
    reading = read_file(npy(points.reshape(9, 14, 3)), "c.npy")
    assert reading.grid == (9, 14)
    np.testing.assert_array_equal(reading.points, points)
    with pytest.raises(InputError, match="x_pitch_mm, y_pitch_mm"):
        read_file(npy(z), "c.npy")
    told = {"x_pitch_mm": 1.0, "y_pitch_mm": 0.5, "x_start_mm": -6.5}
    np.testing.assert_allclose(read_file(npy(z), "c.npy", settings=told).points, points)
    records = np.zeros(3, dtype=[("z", "f4"), ("i", "u2"), ("x", "f4")])
    records["x"], records["z"] = [1, 2, 3], [7, 8, 9]
    assert parse_profile(npy(records), "p.npy").tolist() == [[1, 7], [2, 8], [3, 9]]


def test_a_height_image_without_pitches_says_which_are_lacking() -> None:
    png = cv2.imencode(".png", np.full((4, 5), 900, np.uint16))[1].tobytes()
    with pytest.raises(InputError, match="x_pitch_mm, y_pitch_mm, z_scale_mm"):
        parse_cloud(png, "h.png")
    with pytest.raises(InputError, match="8 bit"):
        parse_cloud(cv2.imencode(".png", np.full((4, 5), 90, np.uint8))[1].tobytes(), "h.png")


def test_the_registry_tells_page_and_clients_what_there_is() -> None:
    for entry in FORMATS:
        told = entry.to_json()
        assert told["endings"]
        assert told["settings"]["additionalProperties"] is False
    assert {".csv", ".e57", ".las", ".yml", ".pts", ".asc"} <= set(endings_of("cloud"))
    assert ".png" not in endings_of("profile")
    writers = {entry.name for entry in FORMATS if "mesh" in entry.to_json()["writes"]}
    assert writers == {"3mf", "glb", "obj", "ply", "stl"}
    with pytest.raises(InputError, match="a file format among"):
        read_file(b"1,2\n", "a.csv", format_name="cvs")


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32))
def test_mutated_tables_give_the_right_points_or_a_sentence(seed: int) -> None:
    verdict, why = verdict_of(random.Random(seed))
    assert verdict in ("right", "refused"), why


def test_the_mutations_reach_both_verdicts() -> None:
    found = [verdict_of(random.Random(seed))[0] for seed in range(60)]
    assert min(found.count("right"), found.count("refused")) > 9


def test_a_capture_says_what_its_file_does_not() -> None:
    from calib_core.captures.content import read_points
    from calib_core.records import parse_capture

    file = next(f for f in scanner_files() if f.variant == "16-bit grey with stamps")
    record = {"id": "s", "step": "scan", "kind": "cloud", "files": ["captures/s.png"], "pose": [0] * 6}
    capture = parse_capture({**record, "format": "height-image", "format_settings": file.settings})
    points = read_points(capture, lambda _: file.data)
    np.testing.assert_allclose(points, known(file.truth_mm), atol=file.digits_mm)
    with pytest.raises(InputError, match="x_pitch_mm"):
        read_points(parse_capture(record), lambda _: file.data)
