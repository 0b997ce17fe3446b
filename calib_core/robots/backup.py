"""Controllers' files and whole backups: whose they are, and what stands in them together."""

from collections.abc import Mapping
from dataclasses import replace

from calib_core.errors import InputError
from calib_core.formats.shared.xml_file import unzipped
from calib_core.formats.zip_files import opened_files
from calib_core.messages import message
from calib_core.robots.brand import Brand
from calib_core.robots.compiled import compiled, is_listed
from calib_core.robots.controller_file import ControllerFile, Found, Skipped
from calib_core.robots.file_hints import NOTHING_TOLD, Told
from calib_core.robots.registry import BRANDS
from calib_core.robots.resolve import resolved
from calib_core.robots.text import decoded

_HEAD_BYTES = 65_536
_ANYBODYS = (".txt", ".py", ".csv", ".xml", ".json", ".yaml", ".yml", ".zip")


def read_controller_files(
    files: Mapping[str, bytes], brand: str | None = None, as_written: bool = False, told: Told = NOTHING_TOLD
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
    told : Told, optional
        What is said about files that do not say it themselves: tables, recordings.

    Raises
    ------
    InputError
        If no file is of a known brand, or files of several brands stand beside each other.
    """
    damaged: dict[str, str] = {}
    opened = opened_files(files, damaged)
    if not opened:
        to_do = message("Give a program, a data list or a backup.")
        for name, reason in damaged.items():
            raise InputError("a controller's file", "damaged ones alone: {reason}", to_do, name, reason=reason)
        raise InputError("a controller's file", "none", to_do)
    where = next(iter(files))
    aside = _set_aside(opened, damaged, where)
    named = brand or ("table" if told.columns or told.convention else None)
    chosen = (BRANDS.get(named, "brand") if named else brand_of(opened, where, aside)).telling(told)
    if not chosen.reads:
        need = "a brand with a reader: {readers}"
        raise InputError(need, f"'{chosen.name}'", "Name one of these.", "brand", readers=_readers())
    alone = len(opened) == 1
    found: list[Found] = []
    for name, data in sorted(opened.items()):
        if not alone and not _is_of(chosen, data, name):
            continue
        try:
            found.append(chosen.find(data, name))
        except InputError as error:
            if alone:
                raise error.at(name) from None
            damaged[name] = str(error)
    for name, reason in damaged.items():
        found.append(Found(name, skipped=[Skipped(1, reason, name)]))
    read = resolved(chosen, chosen.together(found), as_written)
    if not (read.poses or read.tools or read.frames or read.skipped):
        nothing = message(
            "These files hold no position, tool or frame of {brand}: give the whole backup.", brand=chosen.title
        )
        read = replace(read, notes=(*read.notes, nothing))
    from calib_core.robots.joint_check import asked, without_arm

    return without_arm(read) if told.arm is None else asked(read, told.arm)


def _set_aside(opened: dict[str, bytes], named: dict[str, str], where: str) -> str:
    """Take out what is compiled, and return what it is; it is named unless a listing of the same stands beside it.

    Raises
    ------
    InputError
        If nothing else is there.
    """
    names = {name.lower() for name in opened}
    said = ""
    for name, data in list(opened.items()):
        if (known := compiled(name, data)) is not None:
            said = message("{what}: {why}", what=message(known[0]), why=message(known[1]))
            del opened[name]
            if not is_listed(name, names):
                named[name] = said
    if not opened:
        raise InputError("files in text (ASCII)", "what only the controller reads", said, where)
    return said


def _is_of(brand: Brand, data: bytes, name: str) -> bool:
    """Return whether a file of a backup is the brand's: by what stands in it, or by an ending of its own."""
    text = _text(data, name)
    own = [ending for ending in brand.endings if ending not in _ANYBODYS]
    return brand.recognises(text, name) or (bool(text.strip()) and name.lower().endswith(tuple(own)))


def brand_of(files: Mapping[str, bytes], where: str, aside: str = "") -> Brand:
    """Return the brand whose files these are; `aside` says what was set aside as compiled.

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
    if not counts and aside:
        raise InputError("files in text (ASCII)", "what only the controller reads", aside, where)
    if not counts:
        to_do = message("Name the brand with --brand: {best:,}.", best=_readers())
        raise InputError("a file of a known controller", "one that no brand's reader knows", to_do, where)
    most = max(counts.values())
    best = [name for name, count in counts.items() if count == most]
    if len(best) > 1:
        to_do = message("Name the brand with --brand: {best:,}.", best=best)
        need = "files of one brand"
        raise InputError(need, "files that {best} could have written", to_do, where, best=best)
    return BRANDS.get(best[0])


def _text(data: bytes, name: str) -> str:
    """Return what brands look at, a file's beginning: nothing for a packed one that is damaged, no brand's."""
    try:
        return decoded(unzipped(data, name)[:_HEAD_BYTES])
    except InputError:
        return ""


def _readers() -> list[str]:
    return [brand.name for brand in BRANDS if brand.reads]
