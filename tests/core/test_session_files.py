import io
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.errors import CalibrationError, InputError, MeasurementError, TooLargeError
from calib_core.formats.points import MAX_PROFILE_BYTES, parse_cloud, parse_profile, read_file, usual_kind

PROFILE = np.array([[-1.5, 200.25], [0.0, 201.0], [2.5, 199.125]])
CLOUD = np.array([[1.0, 2.0, 3.0], [-4.5, 5.25, 6.0], [7.0, 8.0, -9.75], [0.5, 0.25, 0.125]])


def npy(array, **kwargs):
    file = io.BytesIO()
    np.save(file, array, **kwargs)
    return file.getvalue()


@pytest.mark.parametrize(
    "text",
    [
        "x_mm,z_mm\n-1.5,200.25\n0,201\n2.5,199.125\n",
        "-1.5,200.25\n0,201\n2.5,199.125",
        "-1.5;200.25\r\n0;201\r\n2.5;199.125\r\n",
        "-1,5;200,25\n0;201\n2,5;199,125\n",
        "x_mm\tz_mm\tintensity\n-1.5\t200.25\t7\n0\t201\t8\n2.5\t199.125\t9\n",
        "  -1.5   200.25\n  0  201\n\n  2.5 199.125 \n",
        "# made by a scanner\n-1.5, 200.25\n0, 201\n2.5, 199.125\n",
        "x_mm,z_mm\n-3,\n-1.5,200.25\n0,201\nNaN,NaN\n2.5,199.125\n3,nan\n",
        "x_mm,z_mm,intensity\n-1.5,200.25,\n0,201,5\n2.5,199.125,\n",
        "\ufeffx_mm,z_mm\n-1.5,2.0025e2\n0,201\n2.5,199.125\n",
    ],
)
def test_a_profile_may_be_written_in_many_ways(text):
    np.testing.assert_array_equal(parse_profile(text.encode(), "p.csv"), PROFILE)


def test_utf16_text_of_a_spreadsheet_is_read():
    text = "x_mm\tz_mm\n-1.5\t200.25\n0\t201\n2.5\t199.125\n"
    np.testing.assert_array_equal(parse_profile(text.encode("utf-16"), "p.txt"), PROFILE)


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", ["<f4", ">f8", "<i2"])
def test_npy_profiles_of_any_number_type(order, dtype):
    array = np.array(np.round(PROFILE), dtype=dtype, order=order)
    np.testing.assert_array_equal(parse_profile(npy(array), "p.npy"), np.round(PROFILE))


def test_npy_clouds_keep_finite_rows():
    array = np.vstack([CLOUD, [np.nan, 0, 0]])
    np.testing.assert_array_equal(parse_cloud(npy(array), "c.npy"), CLOUD)


def ply(encoding, extra=""):
    head = f"ply\nformat {encoding} 1.0\ncomment made here\nelement vertex 4\n"
    head += f"property float x\nproperty float y\nproperty float z\n{extra}"
    return (head + "element face 0\nproperty list uchar int vertex_index\nend_header\n").encode()


@pytest.mark.parametrize(("encoding", "order"), [("binary_little_endian", "<"), ("binary_big_endian", ">")])
def test_binary_ply(encoding, order):
    body = b"".join(struct.pack(order + "fffB", *point, 9) for point in CLOUD)
    np.testing.assert_array_equal(parse_cloud(ply(encoding, "property uchar red\n") + body, "c.ply"), CLOUD)


def test_ascii_ply():
    body = "\n".join(" ".join(map(str, point)) for point in CLOUD).encode()
    np.testing.assert_array_equal(parse_cloud(ply("ascii") + body + b"\n", "c.ply"), CLOUD)


def pcd(data, count=4):
    head = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
    return f"{head}WIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA {data}\n".encode()


def test_ascii_and_binary_pcd():
    rows = np.column_stack([CLOUD, np.ones(4)]).astype("<f4")
    text = "\n".join(" ".join(map(str, row)) for row in rows).encode()
    np.testing.assert_array_equal(parse_cloud(pcd("ascii") + text, "c.pcd"), CLOUD)
    np.testing.assert_array_equal(parse_cloud(pcd("binary") + rows.tobytes(), "c.pcd"), CLOUD)


def test_compressed_pcd_with_literals_and_copies():
    rows = np.column_stack([CLOUD, np.ones(4)]).astype("<f4")
    planes = rows.T.tobytes()  # the last 16 bytes repeat 00 00 80 3f: a copy that reaches into itself
    literal = planes[:52]
    packed = b"\x1f" + literal[:32] + bytes([19]) + literal[32:] + bytes([7 << 5, 12 - 9, 3])
    body = struct.pack("<II", len(packed), len(planes)) + packed
    np.testing.assert_array_equal(parse_cloud(pcd("binary_compressed") + body, "c.pcd"), CLOUD)


@pytest.mark.parametrize("name", ["c.xyz", "c.txt"])
def test_xyz_text_with_further_columns(name):
    text = "//X Y Z R G B\n" + "\n".join(" ".join(map(str, [*p, 1, 2, 3])) for p in CLOUD)
    np.testing.assert_array_equal(parse_cloud(text.encode(), name), CLOUD)


@pytest.mark.thorough
def test_a_table_longer_than_one_block_keeps_its_order_and_line_numbers():
    count = 400_000  # 5.6 MB: two blocks
    lines = [f"{k * 0.5:.1f},{k % 7:.1f}" for k in range(count)]
    points = parse_profile("\n".join(lines).encode(), "p.csv")
    np.testing.assert_array_equal(points[:, 0], np.arange(count) * 0.5)
    lines[390_000] = "1.0,oops"
    with pytest.raises(InputError, match=r"'oops' in line 390001"):
        parse_profile("\n".join(lines).encode(), "p.csv")


@pytest.mark.parametrize(
    ("data", "name", "said"),
    [
        (b"", "p.csv", "an empty file"),
        (b"\n\n", "p.csv", "an empty file"),
        (b"x_mm,z_mm\n", "p.csv", "none: nothing came back"),
        (b"x_mm,z_mm\n1,\n2,\n", "p.csv", "2 blanks: nothing came back"),
        (b"x;z\r\n;\r\n;\r\n", "p.csv", "2 blanks: nothing came back"),
        (b"nan,nan\nnan,nan\nnan,nan\n", "p.csv", "3 blanks: nothing came back"),
        (b"x_mm,z_mm\n1,2\n3,abc\n", "p.csv", "'abc' in line 3"),
        (b"x_mm,z_mm\n1,2\n3", "p.csv", "1 in line 3"),
        (b"1,2,3,4\n", "p.csv", "4 in line 1"),
        (b"z_mm,x_mm,x_mm\n1,2,3\n", "p.csv", "2 columns named x in the header above line 2"),
        (
            b"time,distance\n1,2\n",
            "p.csv",
            "no column named x or z in the header above line 2: 'time', 'distance'",
        ),
        (b"1_0,2\n", "p.csv", "'1_0' in line 1"),
        (b"\x89PNG\x00\x00", "p.csv", "bytes that are no text"),
        (b"1,2\n", "p.docx", ".docx"),
        (b"", "p.npy", "an empty file"),
        (b"1,2\n3,4\n5,6\n", "p.npy", "does not begin like one"),
        (npy(CLOUD)[:-8], "c.npy", "3 in the file"),
        (npy(CLOUD)[:40], "c.npy", "cut off"),
        (npy(np.arange(3.0)), "c.npy", r"shape \(3,\)"),
        (npy(np.array([[{}, 1, 2]]), allow_pickle=True), "c.npy", "type object"),
        (ply("binary_little_endian") + b"\0" * 40, "c.ply", "3 in the file"),
        (ply("ascii") + b"1 2 3\n", "c.ply", "1 in the file"),
        (ply("binary_middle_endian"), "c.ply", "binary_middle_endian"),
        (ply("ascii").replace(b" z", b" w"), "c.ply", "the fields x y w"),
        (ply("ascii").replace(b"vertex 4", b"vertex many"), "c.ply", "'many'"),
        (b"ply\nformat ascii 1.0\n", "c.ply", "without a line end_header"),
        (b"solid\n", "c.ply", "does not begin with 'ply'"),
        (pcd("binary") + b"\0" * 63, "c.pcd", "3 in the file"),
        (pcd("binary_compressed") + struct.pack("<II", 99, 64) + b"\0" * 9, "c.pcd", "9 of 99 compressed bytes"),
        (pcd("binary_compressed") + struct.pack("<II", 3, 64) + b"\xff\xff\xff", "c.pcd", "do not unpack"),
        (pcd("zip"), "c.pcd", "DATA zip"),
    ],
)
def test_a_bad_file_is_named_with_what_is_wrong(data, name, said):
    parse = parse_profile if name.startswith("p") else parse_cloud
    kind = MeasurementError if "nothing came back" in said else InputError
    with pytest.raises(kind, match=said) as caught:
        parse(data, name)
    assert str(caught.value).startswith(f"{name}: need ")


def test_the_announced_and_the_held_count_are_both_said():
    with pytest.raises(InputError, match=r"need the 4 points that the header announces, got 3 in the file"):
        parse_cloud(ply("binary_little_endian") + b"\0" * 40, "c.ply")


def test_a_hostile_count_allocates_nothing():
    data = ply("binary_little_endian").replace(b"vertex 4", b"vertex 4000000000000") + b"\0" * 40
    with pytest.raises(TooLargeError, match="4000000000000 announced"):
        parse_cloud(data, "c.ply")


def test_a_profile_of_200_mb_is_refused_by_its_size():
    with pytest.raises(TooLargeError, match="200 MB") as caught:
        parse_profile(bytes(200_000_000), "p.csv")
    assert f"at most {MAX_PROFILE_BYTES / 1e6:.0f} MB" in str(caught.value)


@settings(max_examples=50, deadline=None)
@given(
    st.sampled_from(["p.csv", "p.npy", "c.ply", "c.pcd", "c.xyz", "c.npy"]),
    st.sampled_from([b"", ply("ascii"), ply("binary_big_endian"), pcd("binary_compressed"), npy(CLOUD)[:80]]),
    st.binary(max_size=300),
)
def test_no_bytes_raise_anything_but_a_clear_error(name, head, body):
    try:
        points = (parse_profile if name.startswith("p") else parse_cloud)(head + body, name)
    except CalibrationError:
        return
    assert np.isfinite(points).all()
    assert len(points)


@pytest.mark.parametrize(
    ("data", "name", "kind"),
    [
        (b"1,2,0\n", "a.csv", "profile"),
        (b"x,y,z\n1,2,3\n", "a.csv", "cloud"),
        (b"1 2\n", "a.txt", "profile"),
        (b"1 2 3\n", "a.txt", "cloud"),
        (npy(PROFILE), "a.npy", "profile"),
        (npy(CLOUD), "a.npy", "cloud"),
        (b"x;y;z\n1,5;2;3\n", "a.txt", "cloud"),
        (b"X [mm]\tZ [mm]\tI\n1\t2\t3\n", "a.txt", "profile"),
    ],
)
def test_the_kind_of_a_file_by_ending_and_columns(data, name, kind):
    assert read_file(data, name).kind == kind


def test_the_usual_kind_by_the_ending_alone():
    assert [usual_kind(f"a.{e}") for e in ("csv", "ply", "TIFF", "step")] == ["profile", "cloud", "frame", None]
