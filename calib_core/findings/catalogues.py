"""The catalogues: gettext files in `locale/`, one folder a language, one file an area; read when first asked for.

They are written by Babel (`make catalogues`), which installs thirty megabytes; reading them takes a few lines.
"""

import gettext
import json
from collections.abc import Callable, Iterator
from functools import lru_cache
from importlib.resources import files
from typing import Any, Final

from calib_core.errors import InputError
from calib_core.messages import ENGLISH, Catalogue

_JOINS: Final = {
    "de": (" und ", " oder ", ", ", "{} und {} weitere", " "),
    "zh": ("和", "或", "、", "{}等另外 {} 个", ""),
}
LANGUAGES: Final = ("en", *_JOINS)


@lru_cache(maxsize=len(LANGUAGES))
def catalogue(language: str) -> Catalogue:
    """Return a language; raises InputError where there is none of this name."""
    if language == "en":
        return ENGLISH
    if language not in LANGUAGES:
        raise InputError.unknown(language, LANGUAGES, "language")
    texts: dict[str, list[str]] = {}
    rule = "0"
    for content in _contents(language):
        for one in entries(content):
            if one["msgid"] and all(one["msgstr"]):
                texts.setdefault(one["msgid"], one["msgstr"])
            elif not one["msgid"]:
                rule = _plural_rule(one["msgstr"][0]) or rule
    form_of: Callable[[int], int] = gettext.c2py(rule)  # pyright: ignore[reportAttributeAccessIssue]
    return Catalogue(language, *_JOINS[language], form_of, texts)


def _contents(language: str) -> Iterator[str]:
    folder = files("calib_core.findings") / "locale" / language
    for file in sorted(folder.iterdir(), key=lambda one: one.name):
        if file.name.endswith(".po"):
            yield file.read_text(encoding="utf-8")


def entries(content: str) -> Iterator[dict[str, Any]]:
    """Give a gettext file's entries: `msgid`, `msgctxt` and `msgid_plural` if any, and `msgstr` by its forms."""
    one: dict[str, Any] = {"msgstr": []}
    field = ""
    for line in [*content.splitlines(), ""]:
        keyword, _, said = line.partition(" ")
        if keyword in ("msgctxt", "msgid", "msgid_plural"):
            field, one[keyword] = keyword, ""
        elif keyword.startswith("msgstr"):
            field = "msgstr"
            one["msgstr"].append("")
        elif line.startswith('"'):
            said = line
        else:
            if field == "msgstr":
                yield one
                one = {"msgstr": []}
            field = ""
            continue
        text = json.loads(said)
        if field == "msgstr":
            one["msgstr"][-1] += text
        else:
            one[field] += text


def _plural_rule(header: str) -> str:
    return header.partition("plural=")[2].partition(";")[0].partition("\n")[0].strip()
