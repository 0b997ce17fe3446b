"""Archives made to do harm: refused with the reason, and nothing is left behind."""

import io
import json
import re
import stat
import struct
import tempfile
import zipfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from calib_core.archive.archive import unpack, verify
from calib_core.archive.bag_names import MAX_DEPTH, folded, require_distinct_names, require_safe_name
from calib_core.archive.bag_zip import ArchiveLimits
from calib_core.errors import CalibrationError, InputError, TooLargeError
from server.cli import main
from tests.core.archives import changed, entries_of, resealed, tree, with_entry, without, zipped

BASE = "simulated-tcp-spoiled-seed-7"


def refused(archive: bytes, around: Path, kind: type[CalibrationError] = InputError) -> str:
    """Return why an archive is refused, having seen that nothing was written near it, three folders up."""
    folder = around / "three" / "two" / "one"
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "archive.zip"
    file.write_bytes(archive)
    with pytest.raises(kind) as raised:
        unpack(file, folder / "deep" / "out")
    assert tree(around) == {"three/two/one/archive.zip": archive}
    assert [p.name for p in folder.iterdir()] == ["archive.zip"]
    file.unlink()
    message = str(raised.value)
    assert "archive.zip" in message
    return message


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("data/../../../../evil", "another folder"),
        ("data/./x", "another folder"),
        ("../evil", "another folder"),
        ("data/..", "another folder"),
        ("data//x", "an empty part"),
        ("data/x\\..\\..\\evil", "backslash"),
        ("data/C:/evil", "colon"),
        ("data/x:stream", "colon"),
        ("data/x\n", "control characters"),
        ("data/x\x1b[2J", "control characters"),
        ("data/x ", "ends with a space"),
        ("data/x./y", "ends with a space or a full stop"),
        ("data/" + "x" * 300, "bytes long"),
        ("data/" + "x/" * 40 + "x", "folders deep"),
        ("data/" + "日本語/" * 30 + "x" * 800, "bytes long"),
        ("data/session.json", "twice"),
        ("data/Session.json", "Session.json"),
        ("data/CAPTURES/x", "the folders"),
        ("data/captures/P01.csv", "P01.csv"),
        ("data/captures", "as both"),
        ("data/session.json/x", "as both"),
        ("data/results/", "a folder by a file's name"),
    ],
)
def test_names_that_lead_elsewhere_or_collide(packed, tmp_path, name, reason):
    assert reason in refused(with_entry(packed, f"{BASE}/{name}"), tmp_path)


@pytest.mark.parametrize("name", ["/etc/evil", "//server/share", "\\\\server\\share", "C:\\evil", "other/x", "x"])
def test_names_outside_of_the_bag(packed, tmp_path, name):
    message = refused(with_entry(packed, name), tmp_path)
    assert any(reason in message for reason in ("absolute", "backslash", "outside of"))


def test_unicode_forms_of_one_name(packed, tmp_path):
    archive = with_entry(with_entry(packed, f"{BASE}/data/caf\u00e9"), f"{BASE}/data/cafe\u0301")
    assert "Unicode form" in refused(archive, tmp_path)


@pytest.mark.parametrize(
    ("mode", "reason"),
    [
        (stat.S_IFLNK, "a link"),
        (stat.S_IFBLK, "a device"),
        (stat.S_IFCHR, "a device"),
        (stat.S_IFIFO, "a device, a pipe"),
        (stat.S_IFSOCK, "a device"),
        (stat.S_IFDIR, "a folder by a file's name"),
    ],
)
def test_links_and_devices(packed, tmp_path, mode, reason):
    archive = with_entry(packed, f"{BASE}/data/x", b"/etc/passwd", (mode | 0o777) << 16)
    assert reason in refused(archive, tmp_path)


def test_a_link_that_later_entries_go_through(packed, tmp_path):
    archive = with_entry(packed, f"{BASE}/data/x", b"/tmp", (stat.S_IFLNK | 0o777) << 16)
    assert "a link" in refused(with_entry(archive, f"{BASE}/data/x/evil"), tmp_path)


def test_altered_missing_and_extra_files(packed, tmp_path):
    flip = lambda content: bytes([content[0] ^ 1]) + content[1:]  # noqa: E731
    for name in ("p01.csv", "session.json", "tcp.json", "bag-info.txt", "bagit.txt", "report.html", "truth.json"):
        assert name in refused(changed(packed, name, flip, seal=False), tmp_path)
    for name in ("p01.csv", "bag-info.txt", "/manifest-sha256.txt", "truth.json"):
        assert name.lstrip("/") in refused(without(packed, name), tmp_path)
    for name in ("data/y", "x.txt", "data/captures/.hidden"):
        extra = zipped([*entries_of(packed), (zipfile.ZipInfo(f"{BASE}/{name}"), b"x")])
        assert name in refused(extra, tmp_path)


@pytest.mark.parametrize(
    ("name", "change", "reason"),
    [
        ("bagit.txt", lambda c: c.replace(b"1.0", b"9.9"), "version"),
        ("bagit.txt", lambda c: c.replace(b"UTF-8", b"UTF-16"), "encoding"),
        ("session.json", lambda c: c[:-3], "ends too early"),
        ("session.json", lambda _: b"[" * 100_000, "ordinary depth"),
        ("session.json", lambda _: b"[" * 90 + b"]" * 90, "levels of nesting"),
        (
            "session.json",
            lambda c: c.replace(b'"captures/p01.csv"', b'"../../p01.csv"'),
            "inside the session folder",
        ),
        ("session.json", lambda c: c.replace(b'"captures/p01.csv"', b'"captures/p99.csv"'), "p99.csv"),
        ("session.json", lambda c: c.replace(b"scancell-session/1", b"scancell-session/9"), "scancell-session/1"),
        ("tcp.json", lambda c: c.replace(b'"stage": "tcp"', b'"stage": "camera"'), "stage 'tcp'"),
        ("tcp.json", lambda c: c.replace(b'"verdict": "', b'"verdict": "x'), "verdict"),
        ("tcp.json", lambda _: b'{"stage": "tcp", "x": NaN}', "finite"),
        ("tcp.json", lambda _: b'{"stage": "tcp", "x": ' + b"9" * 400 + b"}", "63 bits"),
        ("tcp.json", lambda _: b'{"stage": "tcp", "x": "\\ud800"}', "surrogate"),
    ],
)
def test_sealed_but_no_session(packed, tmp_path, name, change, reason):
    assert reason in refused(changed(packed, name, change), tmp_path)


def test_manifests_that_say_too_much_or_nonsense(packed, tmp_path):
    def with_manifest(change):
        entries = [(i, change(c) if "/manifest" in i.filename else c) for i, c in entries_of(packed)]
        return zipped([(i, c) for i, c in entries if "tagmanifest" not in i.filename])

    digest = "0" * 64
    for line, reason in [
        (f"{digest}  data/ghost\n", "'data/ghost' missing"),
        (f"{digest}  ../../etc/passwd\n", "passwd"),
        (f"{digest[:40]}  data/session.json\n", "a SHA-256 and a name"),
        (f"{digest}\n", "a SHA-256 and a name"),
        (f"{digest}  data/session.json\n", "twice"),
    ]:
        assert reason in refused(with_manifest(lambda c, line=line: c + line.encode()), tmp_path)
    assert "no text" in refused(with_manifest(lambda c: c + b"\xff\xfe"), tmp_path)
    upper = with_manifest(lambda c: b"".join(row[:64].upper() + row[64:] for row in c.splitlines(keepends=True)))
    assert verify(io.BytesIO(upper), "upper").captures == 14


def test_files_that_must_be_fetched(packed, tmp_path):
    archive = with_entry(packed, f"{BASE}/fetch.txt", b"http://example.org/x 10 data/x\n")
    assert "fetch.txt" in refused(archive, tmp_path)


@pytest.mark.parametrize(
    ("limits", "reason"),
    [
        (ArchiveLimits(entries=10), "at most 10 entries"),
        (ArchiveLimits(total_bytes=20_000, ratio=2000), "MB unpacked"),
        (ArchiveLimits(ratio=200), "a bomb"),
    ],
)
def test_bombs(packed, limits, reason):
    bomb = with_entry(packed, f"{BASE}/data/bomb", b"\0" * 10_000_000)
    with pytest.raises(TooLargeError, match=reason):
        verify(io.BytesIO(bomb), "bomb", limits)


def test_a_bomb_of_entries_is_refused_before_they_are_read():
    directory = struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 65535, 65535, 200_000_000, 4, 0)
    with pytest.raises(TooLargeError, match="entries"):
        verify(io.BytesIO(b"PK\3\4" + directory), "bomb")
    end_64 = struct.pack("<4sQ2H2L4Q", b"PK\6\6", 44, 45, 45, 0, 0, 10**12, 10**12, 10**14, 4)
    locator = struct.pack("<4sLQL", b"PK\6\7", 0, 4, 1)
    with pytest.raises(TooLargeError, match="entries"):
        verify(io.BytesIO(b"PK\3\4" + end_64 + locator + directory), "bomb")


def test_entries_that_share_their_bytes(packed, tmp_path):
    """Many names for one packed piece: the trick of small bombs without much of a ratio."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as file:
        file.writestr("x/bagit.txt", b"x" * 1000)
        info = file.infolist()[0]
        for number in range(50):
            double = zipfile.ZipInfo(f"x/data/{number}")
            double.header_offset, double.CRC = info.header_offset, info.CRC
            double.file_size, double.compress_size = info.file_size, info.compress_size
            file.filelist.append(double)
    assert "overlap" in refused(out.getvalue(), tmp_path)


def test_a_size_that_lies(packed, tmp_path):
    """An entry that says it is small: no more than it says is unpacked, and it is damaged."""
    at = packed.rindex(b"PK\1\2", 0, packed.rindex(b"session.json"))
    size = int.from_bytes(packed[at + 24 : at + 28], "little")
    lying = packed[: at + 24] + (size // 2).to_bytes(4, "little") + packed[at + 28 :]
    assert "session.json" in refused(lying, tmp_path)


def test_encrypted_and_exotic_entries(packed, tmp_path):
    at = packed.rindex(b"PK\1\2", 0, packed.rindex(b"session.json"))
    encrypted = packed[: at + 8] + b"\1\0" + packed[at + 10 :]
    assert "encrypted" in refused(encrypted, tmp_path)
    lzma = packed[: at + 10] + b"\x0e\0" + packed[at + 12 :]
    assert "stored or deflated" in refused(lzma, tmp_path)


@pytest.mark.parametrize("name", [b"", b"/", b"\0", b"\0/evil"])
def test_entries_without_a_name(packed, tmp_path, name):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as file:
        file.writestr("x" * max(len(name), 1), b"")
    archive = out.getvalue()
    if name:
        archive = archive.replace(b"x" * len(name), name)
    else:  # lengths of names stand at 26 in the local header and at 28 in the directory's
        at = archive.index(b"PK\1\2")
        local = archive[:26] + b"\0\0" + archive[28:30]
        directory = archive[at : at + 28] + b"\0\0" + archive[at + 30 : at + 46]
        archive = local + directory + struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 1, 1, len(directory), len(local), 0)
    message = refused(archive, tmp_path)
    assert any(reason in message for reason in ("an empty part", "an absolute path", "control characters"))


@pytest.mark.parametrize("cut", [0, 1, 3, 21, 22, 500, -22, -10, -1])
def test_cut_off(packed, tmp_path, cut):
    message = refused(packed[:cut], tmp_path)
    assert any(reason in message for reason in ("empty file", "something else", "cut off"))


@pytest.mark.parametrize(("before", "behind"), [(b"#!/bin/sh\n", b""), (b"", b"more"), (b"PK\3\4", b"")])
def test_something_around_the_zip(packed, tmp_path, before, behind):
    message = refused(before + packed + behind, tmp_path)
    assert any(reason in message for reason in ("before", "something else", "undamaged"))


def test_the_command_says_it_in_one_sentence(packed, tmp_path, capsys):
    file = tmp_path / "evil.zip"
    file.write_bytes(with_entry(packed, f"{BASE}/data/../../../evil\x1b[31m"))
    for arguments in (["archive", "verify"], ["archive", "replay"], ["run"], ["check"]):
        assert main([*arguments, str(file)]) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.count("\n") == 1
        assert "\x1b" not in err
        assert str(file) in err


NAMES = st.text(st.characters(codec="utf-8"), min_size=1, max_size=12)


@given(name=NAMES)
@example("con/..")
@example("\u0000")
def test_a_safe_name_stays_inside_whatever_the_system(name):
    try:
        require_safe_name(name, "x")
    except InputError:
        return
    from pathlib import PurePosixPath, PureWindowsPath

    for path in (PurePosixPath(name), PureWindowsPath(name)):
        assert not path.is_absolute()
        assert not path.drive
        assert ".." not in path.parts
        assert len(path.parts) <= MAX_DEPTH
        assert path.as_posix() == name


@given(names=st.lists(st.sampled_from(["a", "A", "a/b", "A/b", "b", "é", "é", "É", "ß", "ss", "b/a"]), max_size=4))
def test_distinct_names_are_distinct_on_every_file_system(names):
    def fits() -> bool:
        places: dict[str, str] = {}
        for name in names:
            parts = name.split("/")
            for depth in range(1, len(parts) + 1):
                part = "/".join(parts[:depth])
                kind = part + ("/" if depth < len(parts) else "")
                if places.setdefault(folded(part), kind) != kind or (kind == name and names.count(name) > 1):
                    return False
        return True

    try:
        require_distinct_names(names, "x")
        accepted = True
    except InputError:
        accepted = False
    assert accepted == fits()


MUTATIONS = 100


@pytest.mark.thorough
@settings(max_examples=MUTATIONS, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_mutated_archives_are_refused_or_whole(packed, tmp_path, data):
    """Whatever is altered: no error but ours, nothing written outside, and what is accepted is what was packed."""
    folder = Path(tempfile.mkdtemp(dir=tmp_path))
    archive = _mutated(packed, data)
    (folder / "a.zip").write_bytes(archive)
    try:
        unpack(folder / "a.zip", folder / "out", ArchiveLimits(entries=200, total_bytes=5_000_000))
        reason = ""
    except CalibrationError as error:
        reason = str(error)
    if reason:
        assert "a.zip" in reason
        assert sorted(tree(folder)) == ["a.zip"]
    else:
        assert tree(folder / "out" / "data") == _payload(packed)


def _payload(packed: bytes) -> dict[str, bytes]:
    prefix = f"{BASE}/data/"
    return {i.filename.removeprefix(prefix): c for i, c in entries_of(packed) if i.filename.startswith(prefix)}


def _mutated(packed: bytes, data: st.DataObject) -> bytes:
    """Return an archive with bytes changed, cut, doubled or moved, most of them in its headers."""
    archive = bytearray(packed)
    heads = [found.start() for found in re.finditer(rb"PK[\x01\x03\x05]", packed)]
    for _ in range(data.draw(st.integers(1, 4))):
        kind = data.draw(st.sampled_from(["flip", "header", "cut", "double", "remove", "insert"]))
        if kind == "header":
            at = min(data.draw(st.sampled_from(heads)) + data.draw(st.integers(0, 60)), len(archive) - 1)
        else:
            at = data.draw(st.integers(0, len(archive) - 1))
        length = data.draw(st.integers(1, 64))
        if kind in ("flip", "header"):
            archive[at] = data.draw(st.sampled_from([0, 1, 0x2E, 0x2F, 0x5C, 0x7F, 0x80, 0xFF, archive[at] ^ 1]))
        elif kind == "cut":
            del archive[at + 1 :]
        elif kind == "double":
            archive[at:at] = archive[at : at + length]
        elif kind == "remove":
            del archive[at : at + length]
        else:
            archive[at:at] = data.draw(st.binary(min_size=1, max_size=16))
        if not archive:
            break
    return bytes(archive)


def test_a_second_session_in_the_bag_is_no_session(packed, tmp_path):
    record = {"format": "scancell-session/1", "cell": {"pose_convention": "ur"}}
    archive = with_entry(
        without(packed, "data/session.json", seal=True), f"{BASE}/data/x.json", json.dumps(record).encode()
    )
    assert "data/session.json" in refused(archive, tmp_path)


def test_the_tool_of_these_tests_seals_well(packed):
    assert verify(io.BytesIO(resealed(entries_of(packed))), "again").captures == 14
