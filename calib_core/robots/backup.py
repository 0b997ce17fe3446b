"""Controllers' files and whole backups: whose they are, and what stands in them together."""

import io
import zipfile
from collections.abc import Mapping

from calib_core.errors import InputError
from calib_core.robots.brand import Brand
from calib_core.robots.controller_file import ControllerFile, Found, Skipped
from calib_core.robots.conventions import BRANDS
from calib_core.robots.resolve import resolved
from calib_core.robots.text import decoded
from calib_core.robots.xml_file import unzipped

_MOST_FILES, _MOST_BYTES = 5000, 256_000_000


def read_controller_files(
    files: Mapping[str, bytes], brand: str | None = None, as_written: bool = False
) -> ControllerFile:
    """Return poses, tools and frames of a controller's files, read together.

    Parameters
    ----------
    files : mapping
        Names to contents; zip files are opened.
    brand : str, optional
        A name in `BRANDS`; found out by what stands in the files where it is left out.
    as_written : bool
        Take poses as they stand even where their tool or frame is unknown.

    Raises
    ------
    InputError
        If no file is of a known brand, or files of several brands stand beside each other.
    """
    opened = _opened(files)
    if not opened:
        raise InputError("a controller's file", "none", "Give a program, a data list or a backup.")
    where = next(iter(files))
    chosen = BRANDS.get(brand, "brand") if brand else brand_of(opened, where)
    if not chosen.reads:
        raise InputError(f"a brand with a reader: {_readers()}", f"'{chosen.name}'", "Name one of these.", "brand")
    alone = len(opened) == 1
    found: list[Found] = []
    for name, data in sorted(opened.items()):
        if not alone and not chosen.recognises(_text(data, name), name):
            continue
        try:
            found.append(chosen.find(data, name))
        except InputError as error:
            if alone:
                raise error.at(name) from None
            part = Found(name)
            part.skipped.append(Skipped(1, str(error), name))
            found.append(part)
    return resolved(chosen, found, as_written)


def brand_of(files: Mapping[str, bytes], where: str) -> Brand:
    """Return the brand whose files these are.

    Raises
    ------
    InputError
        If none knows them, or more than one does.
    """
    counts: dict[str, int] = {}
    for name, data in files.items():
        text = _text(data, name)
        know = [brand for brand in BRANDS if brand.reads and brand.recognises(text, name)]
        ending = "." + name.rsplit(".", 1)[-1].lower()
        by_ending = [brand for brand in know if ending in brand.endings]
        for brand in by_ending or know:
            counts[brand.name] = counts.get(brand.name, 0) + 1
    if not counts:
        to_do = f"Name the brand with --brand: {_readers()}."
        raise InputError("a file of a known controller", "one that no brand's reader knows", to_do, where)
    most = max(counts.values())
    best = [name for name, count in counts.items() if count == most]
    if len(best) > 1:
        to_do = f"Name the brand with --brand: {', '.join(best)}."
        raise InputError("files of one brand", f"files that {' and '.join(best)} could have written", to_do, where)
    return BRANDS.get(best[0])


def _text(data: bytes, name: str) -> str:
    """Return what brands look at: nothing for a packed file that is damaged, which is no brand's."""
    try:
        return decoded(unzipped(data, name))
    except InputError:
        return ""


def _readers() -> str:
    return ", ".join(brand.name for brand in BRANDS if brand.reads)


def _opened(files: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the files with those in zip files in their place."""
    opened: dict[str, bytes] = {}
    for name, data in files.items():
        if not data.startswith(b"PK\x03\x04"):
            opened[name] = data
            continue
        try:
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                entries = [entry for entry in archive.infolist() if not entry.is_dir()]
                if len(entries) > _MOST_FILES or sum(entry.file_size for entry in entries) > _MOST_BYTES:
                    to_do = "Give the files with programs, tools and frames alone."
                    raise InputError("a backup of at most 5000 files and 256 MB", "a larger one", to_do, name)
                opened |= {entry.filename: archive.read(entry) for entry in entries}
        except (zipfile.BadZipFile, RuntimeError, NotImplementedError, EOFError, OSError) as error:
            to_do = "Copy it from the controller again, or unpack it and give the folder."
            raise InputError("a whole zip file", str(error) or "a damaged one", to_do, name) from None
    return opened
