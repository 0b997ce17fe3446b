"""Files of one content: which is the measurement, and which are copies of it."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace

from calib_core.recognition.pairing import natural
from calib_core.recognition.taken import MEASUREMENTS, GivenFile, Look, Reason


def copied(files: Sequence[GivenFile]) -> dict[int, int]:
    """Return which files are copies of which by their content, by places; the plainest name is no copy."""
    alike: dict[tuple[bytes, int | None], list[int]] = {}
    for k, file in enumerate(files):
        if file.data and (file.whole or file.digest):
            alike.setdefault((file.digest or file.data, file.size if file.digest else None), []).append(k)
    found: dict[int, int] = {}
    for some in alike.values():
        first, *others = sorted(some, key=lambda k: _plainness(files[k]))
        found |= dict.fromkeys(others, first)
    return found


def _plainness(file: GivenFile) -> tuple[object, ...]:
    return file.name.count("/"), len(file.stem), natural(file.name)


def without_copies(looks: Sequence[Look], copy_of: Mapping[int, int]) -> list[Look]:
    """Leave copies aside that are named after what they are copies of, unless a list of poses names them."""
    rows = {row.name.lower() for look in looks if look.poses for row in look.poses.rows if row.name}
    made = list(looks)
    for k, first in copy_of.items():
        file = looks[k].file
        named = {file.name.lower(), file.name.rpartition("/")[2].lower(), file.stem.lower()} & rows
        if _may_be_left(looks[k]) and (_says_copy(file, looks[first].file) and not named - _names(looks[first])):
            made[k] = _copy(looks[k], looks[first])
    return made


def with_copies(looks: Sequence[Look], copy_of: Mapping[int, int], posed: Set[int]) -> tuple[list[Look], set[int]]:
    """Leave measurements aside that have no pose while another of the same content has one; say which they are."""
    made, spare = list(looks), set[int]()
    for k, first in copy_of.items():
        own = [one for one in (first, *(c for c, of in copy_of.items() if of == first)) if one in posed]
        if own and k not in posed and _may_be_left(looks[k]) and looks[k].taken_for in MEASUREMENTS:
            made[k] = _copy(looks[k], looks[own[0]])
            spare.add(k)
    return made, spare


def _may_be_left(look: Look) -> bool:
    return look.taken_for in (*MEASUREMENTS, "poses") and look.reason.code != "told"


def _names(look: Look) -> set[str]:
    return {look.file.name.rpartition("/")[2].lower(), look.file.stem.lower()}


def _says_copy(file: GivenFile, first: GivenFile) -> bool:
    """Return whether a name holds another's with words around it: p03 - Kopie, Copy of p03, p03 (2), old/p03."""
    stem, plain = file.stem.lower(), first.stem.lower()
    before, found, behind = stem.partition(plain)
    return bool(found) and not before[-1:].isalnum() and not behind[:1].isalnum()


def _copy(look: Look, first: Look) -> Look:
    return replace(look, taken_for="nothing", reason=Reason("copy", {"other": first.file.name}), poses=None)
