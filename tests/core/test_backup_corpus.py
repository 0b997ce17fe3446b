"""A corpus of backups, two a brand: real ones' oddities in many files, among what else lies in such folders."""

import io
import re
import time
import zipfile
from dataclasses import dataclass

import pytest

from calib_core.robots.backup import read_controller_files
from tests.core.robot_oddities import ODDITIES

FOREIGN = {
    "readme.html": b"<html>\n" + b"<p style='x'>1, 2, 3</p>\n" * 400,
    "Thumbs.db": b"\xd0\xcf\x11\xe0" + bytes(4000),
    "photo.jpg": b"\xff\xd8\xff\xe0" + bytes(range(256)) * 20,
    "notes.docx": b"PK\x03\x04 cut off",
    "empty.txt": b"",
}
SECONDS_A_HUNDRED = 2.0


@dataclass(frozen=True)
class Backup:
    """Its files, and of each that holds positions what they are as the controller writes them."""

    brand: str
    files: dict[str, bytes]
    written: dict[str, dict[str, tuple[float, ...]]]
    refused: dict[str, str]


def backup(brand: str, odd: bool) -> Backup:
    """The brand's oddities, a file each; `odd` puts blank runs and line ends of Windows into them."""
    name, around, pieces = ODDITIES[brand]
    stem, _, ending = name.rpartition(".")
    files = dict(FOREIGN)
    written: dict[str, dict[str, tuple[float, ...]]] = {}
    refused: dict[str, str] = {}
    for number, (body, expected) in enumerate(pieces):
        place = f"{'OLD/' if number % 3 == 2 else ''}{stem}{number}.{ending}"
        text = around(body)
        if odd:
            text = text.replace("\n", "\r\n") + "\r\n" * 3000
        files[place] = text.encode()
        if isinstance(expected, str):
            refused[place] = expected
        else:
            written[place] = expected
    return Backup(brand, files, written, refused)


CORPUS = [(brand, odd) for brand in ODDITIES for odd in (False, True)]


def test_there_are_as_many_as_are_promised() -> None:
    assert len(CORPUS) >= 15


@pytest.mark.parametrize(("brand", "odd"), CORPUS, ids=[f"{brand}{'-odd' * odd}" for brand, odd in CORPUS])
def test_no_position_of_a_backup_is_wrong_and_every_file_is_read_or_named(brand: str, odd: bool) -> None:
    made = backup(brand, odd)
    begun = time.process_time()
    found = read_controller_files(made.files, brand)
    assert time.process_time() - begun < SECONDS_A_HUNDRED * max(1.0, len(made.files) / 100) + 1.0
    for pose in found.poses:
        told = made.written.get(pose.file, {})
        if pose.pose is not None:
            assert pose.as_written == told[pose.name], (pose.file, pose.name)
    of_file = {pose.file for pose in found.poses} | {row.file for row in found.skipped}
    unnamed = [place for place in (*made.written, *made.refused) if place not in of_file]
    assert unnamed == []
    for place, reason in made.refused.items():
        assert [row for row in found.skipped if row.file == place and re.search(reason, row.reason)], place


@pytest.mark.parametrize("brand", ["kuka", "abb", "fanuc", "ur", "yaskawa"])
def test_the_same_backup_packed_with_one_damaged_file_loses_that_file_alone(brand: str) -> None:
    made = backup(brand, odd=False)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in made.files.items():
            packed.writestr(name, content)
        hurt = packed.getinfo("readme.html")
    data = bytearray(stream.getvalue())
    data[hurt.header_offset + 30 + len("readme.html") + hurt.compress_size // 2] ^= 0xFF
    whole = read_controller_files({"b.zip": stream.getvalue()}, brand)
    found = read_controller_files({"b.zip": bytes(data)}, brand)
    assert [p.as_written for p in found.poses] == [p.as_written for p in whole.poses]
    assert [row.file for row in found.skipped if row not in whole.skipped] == ["readme.html"]
