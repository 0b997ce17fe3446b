"""The page's own texts: English in `texts/*.json`, other languages in `texts/*.po`; two JSON each.

What no first look at a page needs stands in `texts/later`, and comes with the parts that say it.

A catalogue says each English text once, for all names that have it, and nothing that the core's catalogues say.
Where a name needs other words than its English has elsewhere, it is the context of its own entry (`msgctxt`).
Names that end in `one` and `many` are the plural forms of one text.
"""

import json
from collections.abc import Sequence
from pathlib import Path

from calib_core.findings.catalogues import catalogue, entries


def english(folder: Path) -> dict[str, str]:
    """Return the texts of a folder's files, by name."""
    return {
        name: text
        for file in sorted(folder.rglob("*.json"), key=lambda file: (file.name, len(file.parts)))
        for name, text in json.loads(file.read_text(encoding="utf-8")).items()
    }


def plural_of(name: str) -> str:
    """Return the name of the many of which a name is the one; nothing where it is none."""
    return name[:-3] + "many" if name.endswith((".one", "_one")) else ""


def texts_in(folder: Path, language: str) -> dict[str, str]:
    """Return all texts by name, in English where a language lacks one."""
    said = english(folder)
    for name, forms in translations(folder, language).items():
        said[name] = forms[0]
        if plural_of(name) in said:
            said[plural_of(name)] = forms[-1]
    return said


def translations(folder: Path, language: str) -> dict[str, Sequence[str]]:
    """Return a language's words by name: one, or as many forms as it has plurals."""
    if language == "en":
        return {}
    content = (folder / f"{language}.po").read_text(encoding="utf-8")
    own = {(one.get("msgctxt"), one["msgid"]): one["msgstr"] for one in entries(content) if all(one["msgstr"])}
    core = catalogue(language).texts
    texts = english(folder)
    manys = {plural_of(name) for name in texts}
    found = {
        name: own.get((name, text)) or own.get((None, text)) or core.get(text)
        for name, text in texts.items()
        if name not in manys
    }
    return {name: forms for name, forms in found.items() if forms}


def served(folder: Path, language: str, later: bool) -> dict[str, dict[str, str]]:
    """Return the first texts, or the later ones, by the area that begins their names and is then said once."""
    late = english(folder / "later")
    areas: dict[str, dict[str, str]] = {}
    for name, text in texts_in(folder, language).items():
        if (name in late) == later:
            area, _, rest = name.partition(".")
            areas.setdefault(area, {})[rest] = text
    return areas
