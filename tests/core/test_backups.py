"""Whole backups: a bad file is skipped and named, blank runs cost nothing, state outranks programs."""

import contextlib
import io
import time
import zipfile

import pytest

from calib_core.errors import InputError
from calib_core.formats.zip_files import zipped
from calib_core.robots.backup import read_controller_files
from calib_core.robots.registry import BRANDS
from tests.core.robot_dialects import CONFIG, LS

STARTS = {
    "abb": "MODULE a\n", "kuka": "DEFDAT X\n", "fanuc": "/PROG A\n", "ur": "p[1,2,3,4,5,6]\n",
    "staubli": "<Database>", "kawasaki": ".TRANS\n", "mitsubishi": "Def Pos P1\n", "yaskawa": "/JOB\n//NAME A\n",
    "nachi": "MOVEX A=1\n", "ros": "orientation: {x: 0, w: 1}\n", "comau": "PROGRAM a\n", "denso": "TakeArm\n",
    "doosan": "posx(1,2,3,4,5,6)\n", "epson": "TLSet 1, XY(1,2,3,4,5,6)\n", "table": "name,x,y,z,qx,qy,qz,qw\n",
}  # fmt: skip


@pytest.mark.parametrize("brand", sorted(STARTS))
@pytest.mark.parametrize("blank", ["\n", " \n", "\t\n"])
def test_runs_of_blank_lines_cost_nothing(brand: str, blank: str) -> None:
    reader = BRANDS.get(brand)
    text = STARTS[brand] + blank * 8000 + STARTS[brand]
    begun = time.process_time()
    reader.recognises(text, "a.txt")
    with contextlib.suppress(InputError):
        reader.find(text.encode(), "a.txt")
    assert time.process_time() - begun < 1.5


def test_every_brand_is_tried() -> None:
    assert set(STARTS) == {brand.name for brand in BRANDS if brand.reads}


def damaged(archive: bytes, name: str) -> bytes:
    """Return a zip with one byte of one entry's content changed."""
    with zipfile.ZipFile(io.BytesIO(archive)) as packed:
        entry = packed.getinfo(name)
    at = entry.header_offset + 30 + len(name) + entry.compress_size // 2
    return archive[:at] + bytes([archive[at] ^ 0xFF]) + archive[at + 1 :]


def test_an_odd_entry_of_a_backup_is_skipped_and_named() -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("KRC/$config.dat", CONFIG)
        packed.writestr("log.txt", "nothing of use " * 400)
        packed.writestr("inner.zip", b"PK\x03\x04 cut off")
    whole = read_controller_files({"backup.zip": stream.getvalue()})
    odd = read_controller_files({"backup.zip": damaged(stream.getvalue(), "log.txt")})
    assert odd.tools == whole.tools
    assert len(whole.tools) == 2
    assert [row.file for row in odd.skipped if row not in whole.skipped] == ["log.txt"]
    beside = read_controller_files({"$config.dat": CONFIG.encode(), "old.zip": b"PK\x03\x04 cut off"})
    assert len(beside.tools) == 2
    assert [row.file for row in beside.skipped if row.file == "old.zip"] == ["old.zip"]


def test_zip_files_within_a_backup_are_opened_and_odd_ones_named() -> None:
    kept = zipped({"KRC/$config.dat": CONFIG.encode()})
    cut = zipped({"b.dat": CONFIG.encode()})[:-40]
    deep = zipped({"2.zip": zipped({"3.zip": zipped({"4.zip": kept})})})
    known = read_controller_files({"$config.dat": CONFIG.encode()}).tools
    for inner, odd in (
        ({"R1.zip": kept}, []),
        ({"all/R1.zip": zipped({"R1.zip": kept})}, []),
        ({"R1.zip": kept, "odd.zip": b"PK\x03\x04 cut off"}, ["odd.zip"]),
        ({"R1.zip": kept, "cut.zip": cut}, ["cut.zip"]),
        ({"R1.zip": kept, "old.zip": zipped({"cut.zip": cut})}, ["old.zip/cut.zip"]),
        ({"R1.zip": kept, "1.zip": deep}, ["1.zip/2.zip/3.zip/4.zip"]),
    ):
        read = read_controller_files({"backup.zip": zipped(inner)})
        assert [tool.pose for tool in read.tools] == [tool.pose for tool in known]
        assert [row.file for row in read.skipped if row.file and row.file.endswith(".zip")] == odd


def test_what_zip_files_hold_together_is_limited_however_deep_they_lie() -> None:
    bomb = zipped({"zeros": bytes(100_000_000)})
    with pytest.raises(InputError, match="256 MB"):
        read_controller_files(
            {"b.zip": zipped({"1.zip": bomb, "2.zip": bomb, "3.zip": bomb, "$config.dat": CONFIG.encode()})}
        )


def test_the_controllers_state_outranks_a_program_and_both_are_shown() -> None:
    state = """[*SYSTEM*]$MNUTOOL  Storage: CMOS  Access: RW  : ARRAY[2,10] OF POSITION
     [1,1] =   Group: 1   Config: N D B, 0, 0, 0
  X:    10.000   Y:    20.000   Z:   130.000
  W:      .000   P:      .000   R:      .000
"""
    sets = [f"   {k}:  PR[9,{k}]={value} ;" for k, value in enumerate((1, 2, 3, 0, 0, 0), start=1)]
    program = "\n".join(["/PROG SETUP", "/MN", *sets, "   7:  UTOOL[1]=PR[9] ;", "/POS", "/END", ""])
    read = read_controller_files({"sysframe.va": state.encode(), "SETUP.LS": program.encode()}, "fanuc")
    assert [tool.pose[:3] for tool in read.tools] == [(10.0, 20.0, 130.0)]
    assert ["1, 2, 3" in row.reason for row in read.skipped if row.file == "SETUP.LS"] == [True]


@pytest.mark.thorough
def test_a_backup_of_thousands_of_files_is_read_quickly() -> None:
    files = {f"lib/page{k}.html": (f"<p style='a'>{k}</p>" * 300).encode() for k in range(2000)}
    begun = time.process_time()
    read = read_controller_files({**files, "$config.dat": CONFIG.encode()})
    assert len(read.tools) == 2
    assert time.process_time() - begun < 2.0 * len(files) / 100


def test_what_is_compiled_is_named_with_what_to_do_unless_its_listing_stands_beside_it() -> None:
    binary = b"\x00\x01\x02\xff" * 300
    read = read_controller_files(
        {
            "A.LS": LS.encode(),
            "A.TP": binary,
            "B.TP": binary,
            "SYSVARS.VR": binary,
            "SYSVARS.VA": b"",
            "X.SV": binary,
        }
    )
    assert read.poses
    named = {skipped.file: skipped.reason for skipped in read.skipped}
    assert "export it as a listing, .ls" in named["B.TP"]
    assert ".va" in named["X.SV"]
    assert named.keys() & {"A.TP", "SYSVARS.VR"} == set()
    with pytest.raises(InputError, match=r"only the controller reads.*\.va"):
        read_controller_files({"POSREG.VR": binary})
    with pytest.raises(InputError, match=r"only the controller reads.*\.va"):
        read_controller_files({"POSREG.VR": binary, "readme.txt": b"hello\n"})


def test_a_backup_without_positions_says_so_and_one_that_is_damaged_alone_says_what_is_wrong() -> None:
    program = b".PROGRAM a()\n TYPE 1\n.END\n"
    read = read_controller_files({"a.as": program})
    assert (read.poses, read.skipped) == ((), ())
    assert "hold no position, tool or frame of Kawasaki" in str(read.notes[0])
    damaged = bytearray(zipped_plain({"a.as": program}))
    damaged[damaged.index(b"TYPE")] ^= 1
    with pytest.raises(InputError, match=r"a\.as: .*damaged ones alone: Bad CRC-32"):
        read_controller_files({"b.zip": bytes(damaged)})


def zipped_plain(files: dict[str, bytes]) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return packed.getvalue()


def test_kawasakis_dotted_names_are_read_and_can_be_written() -> None:
    """Names may have dots; one that begins with a dot is a program's own."""
    text = """.PROGRAM weld()
  TOOL grip.1
  BASE NULL
  POINT .near = TRANS(4, 5, 6, 0, 90, 0)
  LMOVE .near
  LMOVE seam.start[2]
.END
.TRANS
grip.1 0 0 120 0 0 0
seam.start[2] 7 8 9 0 90 0
.END
"""
    read = read_controller_files({"weld.as": text.encode()})
    assert {pose.name for pose in read.poses} == {".near", "seam.start[2]"}
    assert [tool.name for tool in read.tools] == ["grip.1"]
    assert {pose.tool for pose in read.poses} == {"grip.1"}
    for entry in BRANDS.get("kawasaki").exports():
        assert entry.settings.model_validate({"tool": "grip.1"}).model_dump()["tool"] == "grip.1"
