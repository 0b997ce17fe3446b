"""The page's own texts: English in `texts/*.json`, other languages in `texts/*.po`; one JSON each.

In a catalogue the name of a text is its context (`msgctxt`), so that two texts that English says alike may differ.
Names that end in `one` and `many` are the plural forms of one text.
"""

import json
from pathlib import Path

from calib_core.findings.catalogues import entries


def english(folder: Path) -> dict[str, str]:
    """Return the texts of a folder's files, by name."""
    return {
        name: text
        for file in sorted(folder.glob("*.json"))
        for name, text in json.loads(file.read_text(encoding="utf-8")).items()
    }


def plural_of(name: str) -> str:
    """Return the name of the many of which a name is the one; nothing where it is none."""
    return name[:-3] + "many" if name.endswith((".one", "_one")) else ""


def texts_in(folder: Path, language: str) -> dict[str, str]:
    """Return all texts by name, in English where a language lacks one."""
    said = english(folder)
    if language == "en":
        return said
    for one in entries((folder / f"{language}.po").read_text(encoding="utf-8")):
        name = one.get("msgctxt")
        if name and all(one["msgstr"]):
            said[name] = one["msgstr"][0]
            if "msgid_plural" in one:
                said[plural_of(name)] = one["msgstr"][-1]
    return said


def by_area(texts: dict[str, str]) -> dict[str, dict[str, str]]:
    """Return texts by the area that begins their names, which is then said once: a sixth less."""
    areas: dict[str, dict[str, str]] = {}
    for name, text in texts.items():
        area, _, rest = name.partition(".")
        areas.setdefault(area, {})[rest] = text
    return areas
