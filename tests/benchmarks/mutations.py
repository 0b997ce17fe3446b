"""Good files of every kind, and what becomes of them when bytes, numbers and words in them are altered by lot."""

import io
import json
import random
import re
from collections.abc import Callable
from functools import cache

import cv2
import numpy as np

from calib_core.archive.archive import pack_files
from calib_core.simulation import simulate
from tests.core.archives import entries_of, resealed
from tests.point_files import cloud_pieces

EDGES = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
WORDS = (
    *(
        b"",
        b"-1",
        b"0",
        b"1e308",
        b"1e400",
        b"nan",
        b"-inf",
        b"99999999999999999999",
        b"2147483648",
        b"4294967296",
    ),
    *(b"0x10", b"1_0", b"[[", b'"', b"\x00", b"\xff\xfe", b"null", b"{}", b"%00", b"../../etc/passwd"),
    "\u0663".encode(),
)


def altered(content: bytes, chance: random.Random) -> bytes:
    """Return content with one to four things wrong in it."""
    for _ in range(chance.randint(1, 4)):
        content = chance.choice(_WAYS)(content, chance)
    return content


def _flip(content: bytes, chance: random.Random) -> bytes:
    data = bytearray(content)
    for _ in range(chance.randint(1, 8)):
        if data:
            data[_place(data, chance)] ^= 1 << chance.randrange(8)
    return bytes(data)


def _cut(content: bytes, chance: random.Random) -> bytes:
    return content[: chance.randint(0, len(content))]


def _drop(content: bytes, chance: random.Random) -> bytes:
    start = chance.randint(0, len(content))
    return content[:start] + content[start + chance.randint(1, 200) :]


def _repeat(content: bytes, chance: random.Random) -> bytes:
    start = chance.randint(0, len(content))
    piece = content[start : start + chance.randint(1, 300)]
    return content[:start] + piece * chance.randint(2, 50) + content[start:]


def _edge(content: bytes, chance: random.Random) -> bytes:
    data = bytearray(content)
    if len(data) > 8:
        place = _place(data, chance)
        number = chance.choice(EDGES).to_bytes(4, chance.choice(("little", "big")))
        data[place : place + 4] = number
    return bytes(data)


def _word(content: bytes, chance: random.Random) -> bytes:
    head = content[:20_000]
    words = list(re.finditer(rb"[A-Za-z_]+|-?\d+\.?\d*", head))
    if not words:
        return _flip(content, chance)
    word = chance.choice(words[:40] if chance.random() < 0.5 else words)  # headers are short and matter most
    return content[: word.start()] + chance.choice(WORDS) + content[word.end() :]


def _place(data: bytearray, chance: random.Random) -> int:
    """Return a place in the content, half of the time in its head."""
    return chance.randrange(min(len(data), 200) if chance.random() < 0.5 else len(data))


_WAYS: tuple[Callable[[bytes, random.Random], bytes], ...] = (_flip, _cut, _drop, _repeat, _edge, _word, _word)


@cache
def profiles() -> dict[str, bytes]:
    """Profiles of the simulated cell in every format, by file name."""
    cell = simulate("tcp", 1)
    text = cell.files[cell.session.captures[0].files[0]]
    rows = np.genfromtxt(io.BytesIO(text), delimiter=",", skip_header=1)
    npy = io.BytesIO()
    np.save(npy, rows)
    return {"p.csv": text, "p.txt": text.replace(b",", b"\t"), "p.npy": npy.getvalue()}


@cache
def clouds() -> dict[str, bytes]:
    """A sphere's cap as a cloud in every format, by file name."""
    chance = np.random.default_rng(1)
    angle, turn = np.arccos(chance.uniform(0.2, 1, 800)), chance.uniform(0, 2 * np.pi, 800)
    across = np.column_stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), -np.cos(angle)])
    points = 20 * across + [5, 5, 200]
    npy = io.BytesIO()
    np.save(npy, points)
    lines = (
        "ply",
        "format ascii 1.0",
        "element vertex 800",
        *(f"property float {c}" for c in "xyz"),
        "end_header",
    )
    text = "\n".join(lines).encode() + b"\n"
    xyz = b"".join(cloud_pieces("c.xyz", points))
    return {
        "c.npy": npy.getvalue(),
        "c.xyz": xyz,
        "text.ply": text + xyz,
        **{f"c.{kind}": b"".join(cloud_pieces(f"c.{kind}", points)) for kind in ("ply", "pcd")},
    }


@cache
def images() -> dict[str, bytes]:
    """A frame with a bright line in every format, by file name."""
    frame = np.random.default_rng(2).normal(20, 4, (120, 160)).clip(0, 255)
    frame[58:63] += 200
    small = frame.clip(0, 255).astype(np.uint8)
    found: dict[str, bytes] = {}
    for ending in ("png", "bmp", "jpg", "tiff"):
        found[f"f.{ending}"] = cv2.imencode(f".{ending}", small)[1].tobytes()
    found["deep.png"] = cv2.imencode(".png", small.astype(np.uint16) * 257)[1].tobytes()
    found["deep.tiff"] = cv2.imencode(".tiff", small.astype(np.uint16) * 257)[1].tobytes()
    return found


@cache
def session_record() -> bytes:
    """The record of a simulated session, captures inside."""
    return json.dumps(simulate("turntable", 3).session.to_json()).encode()


@cache
def archive() -> bytes:
    """The archive of a small session."""
    cell = simulate("tcp", 5)
    few = cell.session.model_copy(update={"captures": cell.session.captures[:3]})
    payload = {"session.json": json.dumps(few.to_json()).encode()}
    payload |= {name: cell.files[name] for capture in few.captures for name in capture.files}
    out = io.BytesIO()
    pack_files(few, payload, out, "small")
    return out.getvalue()


def altered_archive(chance: random.Random) -> bytes:
    """Return an archive altered from outside, or inside with manifests that agree again."""
    if chance.random() < 0.5:
        return altered(archive(), chance)
    entries = entries_of(archive())
    place = chance.randrange(len(entries))
    info, content = entries[place]
    if chance.random() < 0.3 and not info.filename.endswith("bagit.txt"):
        info.filename = altered(info.filename.encode(), chance).decode("latin-1")[:200] or "x"
    else:
        content = altered(content, chance)
    entries[place] = (info, content)
    return resealed(entries)
