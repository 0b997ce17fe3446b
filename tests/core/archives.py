"""Archives for the tests: a small simulated session, and zips rewritten entry by entry."""

import hashlib
import io
import warnings
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path

Entry = tuple[zipfile.ZipInfo, bytes]


def entries_of(archive: bytes) -> list[Entry]:
    with zipfile.ZipFile(io.BytesIO(archive)) as source:
        return [(info, source.read(info)) for info in source.infolist()]


def zipped(entries: Iterable[Entry]) -> bytes:
    out = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as target:
        warnings.simplefilter("ignore")  # of names that stand twice, which is what some tests want
        for info, content in entries:
            fresh = zipfile.ZipInfo(info.filename, info.date_time)
            fresh.external_attr, fresh.compress_type = info.external_attr, info.compress_type
            fresh.create_system = info.create_system
            target.writestr(fresh, content)
    return out.getvalue()


def with_entry(archive: bytes, name: str, content: bytes = b"x", attributes: int = 0o100644 << 16) -> bytes:
    """Return an archive with one more entry, which its manifests name."""
    info = zipfile.ZipInfo(name)
    info.external_attr, info.compress_type = attributes, zipfile.ZIP_DEFLATED
    return resealed([*entries_of(archive), (info, content)])


def changed(archive: bytes, name: str, change: Callable[[bytes], bytes], seal: bool = True) -> bytes:
    """Return an archive with one entry's content changed, its manifests made to agree unless told otherwise."""
    entries = [(i, change(c) if i.filename.endswith(name) else c) for i, c in entries_of(archive)]
    return resealed(entries) if seal else zipped(entries)


def without(archive: bytes, name: str, seal: bool = False) -> bytes:
    entries = [(i, c) for i, c in entries_of(archive) if not i.filename.endswith(name)]
    return resealed(entries) if seal else zipped(entries)


def resealed(entries: list[Entry]) -> bytes:
    """Return a zip whose manifests agree with its entries: what an attacker can do as well as we."""
    base = next(i.filename for i, _ in entries if i.filename.endswith("bagit.txt")).removesuffix("bagit.txt")
    kept = [(i, c) for i, c in entries if not i.filename.endswith("manifest-sha256.txt")]
    payload = [(i, c) for i, c in kept if i.filename.startswith(f"{base}data/")]
    manifest = _manifest(payload, base)
    kept.append((zipfile.ZipInfo(f"{base}manifest-sha256.txt"), manifest))
    tags = [(i, c) for i, c in kept if not i.filename.startswith(f"{base}data/")]
    kept.append((zipfile.ZipInfo(f"{base}tagmanifest-sha256.txt"), _manifest(tags, base)))
    return zipped(kept)


def _manifest(entries: list[Entry], base: str) -> bytes:
    lines = [
        f"{hashlib.sha256(c).hexdigest()}  {i.filename.removeprefix(base)}\n"
        for i, c in entries
        if not i.filename.endswith("/")
    ]
    return "".join(lines).encode()


def tree(folder: Path) -> dict[str, bytes]:
    """Return all files below a folder by name, but for what is no part of the session."""
    names = {p.relative_to(folder).as_posix(): p for p in folder.rglob("*") if p.is_file()}
    return {name: p.read_bytes() for name, p in names.items() if not name.startswith(".scancell/")}
