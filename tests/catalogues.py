"""Takes up new texts into the catalogues, and writes docs/findings: `make catalogues`.

A text keeps the translation that any catalogue has of it; fill what is empty.
"""

import ast
import io
import re
from collections.abc import Container, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeGuard

from babel.messages.catalog import Catalog
from babel.messages.pofile import read_po, write_po

import server.app  # noqa: F401 - it knows all kinds of errors
from calib_core.errors import CalibrationError
from calib_core.findings import pages, table
from calib_core.findings.code import Plural
from server.http.page_texts import english, plural_of


def _kinds_of(error: type[CalibrationError]) -> Iterator[type[CalibrationError]]:
    yield error
    for kind in error.__subclasses__():
        yield from _kinds_of(kind)


ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "web" / "texts"
LOCALE = ROOT / "calib_core" / "findings" / "locale"
DOCS = ROOT / "docs" / "findings"
TRANSLATED = ("de", "zh")
TEXTS = {
    "message": (0,),
    "Fault": (3, 4),
    "adding": (0,),
    "Match": (1,),
    "Registry": (0,),
    "Export": (1,),
}  # which arguments are texts; of errors the first three
Text = tuple[str, str]  # the template, and its plural or nothing
_ERRORS = {error.__name__ for error in _kinds_of(CalibrationError)}
_LABELS = {"label", "limit_label", "title", "remark", "caption", "alt", "instruction", "why", "exit"}
_LABEL = re.compile(r"[A-Z].*[a-z]|.* ")
_WORDS = re.compile("[a-z]{2}|: |^[.]$|^(PASS|WARN|FAIL)$")  # what there is to translate
_PLACE = re.compile(r"\{[^{}]*\}")
_ALWAYS = datetime(2026, 1, 1, tzinfo=UTC)  # the files change with their texts alone


def catalogue_names() -> set[str]:
    """Return the names of what is called with a text and what fills its places."""
    return {"message", "plural", *_ERRORS}


def texts_by_area() -> dict[str, set[Text]]:
    """Return all texts by the file that they stand in; one that several areas have stands in the first."""
    found: dict[str, set[Text]] = {}
    known = {text for language in TRANSLATED for text in catalogue_of(language)}
    for area, codes in table.areas().items():
        for code in codes:
            for text in code.texts():
                said = (text.one, text.many) if isinstance(text, Plural) else (text, "")
                found.setdefault(area, set()).add(said)
            found.setdefault("pages", set()).update((text, "") for text in code.page() if text)
    for top in ("calib_core", "server"):
        for file in sorted((ROOT / top).rglob("*.py")):
            room = file.relative_to(ROOT / top).parts[0].removesuffix(".py") if top == "calib_core" else "server"
            found.setdefault(room, set()).update(messages_of(file, known))
    seen: set[str] = set()
    for texts in found.values():
        texts -= {text for text in texts if text[0] in seen or not re.search(_WORDS, _PLACE.sub("", text[0]))}
        seen |= {text[0] for text in texts}
    return {area: texts for area, texts in sorted(found.items()) if texts}


def messages_of(file: Path, known: Container[str] = ()) -> Iterator[Text]:
    """Give the texts in a source file: of messages, errors, tables of templates, and labels.

    A label, or another text without places, is taken up when it is marked, `message("…")`; later its mark may go:
    a catalogue knows it.
    """
    content = file.read_text(encoding="utf-8")
    marked: set[int] = set()
    for call in ast.walk(ast.parse(content)):
        text = str(call.value) if _is_text(call) and id(call) not in marked else ""
        if text in known and _LABEL.match(text):
            yield text, ""
        if not isinstance(call, ast.Call):
            continue
        name = getattr(call.func, "id", getattr(call.func, "attr", ""))
        if name in ("message", "plural"):
            marked |= {id(part) for part in call.args}
        if name == "plural":
            one, many = (_constants(part)[0] for part in call.args)
            yield one, many
        elif name == "templates":
            yield from ((text, "") for text in _in_table(call.args[0]))
        elif name in TEXTS or name in _ERRORS:
            places = TEXTS.get(name, (0, 1, 2))
            parts = [part for place, part in enumerate(call.args) if place in places]
            parts += [one.value for one in call.keywords if one.arg in ("need", "got", "to_do")]
            yield from ((text, "") for part in parts for text in _constants(part))
        else:
            labels = [one.value for one in call.keywords if one.arg in _LABELS]
            yield from ((text, "") for part in labels for text in _constants(part) if text)


def _in_table(part: ast.expr) -> Iterator[str]:
    parts = (
        part.values if isinstance(part, ast.Dict) else part.elts if isinstance(part, ast.Tuple | ast.List) else ()
    )
    yield from _constants(part)
    for one in parts:
        yield from _in_table(one)


def _constants(part: ast.expr) -> list[str]:
    """Return the texts that an argument may be."""
    if isinstance(part, ast.IfExp):
        return [*_constants(part.body), *_constants(part.orelse)]
    if isinstance(part, ast.BoolOp):
        return [text for value in part.values for text in _constants(value)]
    return [str(part.value)] if _is_text(part) else []


def _is_text(part: ast.AST) -> TypeGuard[ast.Constant]:
    return isinstance(part, ast.Constant) and isinstance(part.value, str)


def catalogue_of(language: str) -> dict[str, tuple[str, ...]]:
    """Return what all files of a language translate."""
    found: dict[str, tuple[str, ...]] = {}
    for file in sorted((LOCALE / language).glob("*.po")):
        with file.open("rb") as stream:
            for one in read_po(stream, locale=language):
                key = one.id if isinstance(one.id, str) else one.id[0]
                forms = (one.string,) if isinstance(one.string, str) else tuple(one.string or ())
                if key and all(forms):
                    found.setdefault(key, forms)
    return found


def update() -> None:
    """Write the catalogues and the pages."""
    areas = texts_by_area()
    for language in TRANSLATED:
        known = catalogue_of(language)
        for file in (LOCALE / language).glob("*.po"):
            if file.stem not in areas:
                file.unlink()
        for area, texts in areas.items():
            content = io.BytesIO()
            write_po(content, _catalogue(language, texts, known), width=110, sort_output=True, no_location=True)
            file = LOCALE / language / f"{area}.po"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content.getvalue())
    for language in TRANSLATED:
        content = io.BytesIO()
        file = PAGE / f"{language}.po"
        write_po(content, _page_catalogue(file, language), width=110, no_location=True)
        file.write_bytes(content.getvalue())
    DOCS.mkdir(exist_ok=True)
    written = pages.files()
    for file in DOCS.glob("*.md"):
        if file.name not in written:
            file.unlink()
    for name, content in written.items():
        (DOCS / name).write_text(content, encoding="utf-8")


def _page_catalogue(file: Path, language: str) -> Catalog:
    """Return the page's texts, each once, with the translations of those whose English is as before.

    Left out is what the core's catalogues say; a name that needs other words has an entry by its name.
    """
    known: dict[tuple[str | None, str], tuple[str, ...]] = {}
    if file.exists():
        with file.open("rb") as stream:
            for one in read_po(stream, locale=language):
                key = one.id if isinstance(one.id, str) else one.id[0]
                known[one.context, key] = (one.string,) if isinstance(one.string, str) else tuple(one.string or ())
    texts, core = english(PAGE), catalogue_of(language)
    manys = {plural_of(name) for name in texts}
    made = _empty(language)
    for name, text in texts.items():
        many = texts.get(plural_of(name))
        own = name if (name, text) in known else None
        if name in manys or (own is None and text in core and (None, text) not in known):
            continue
        said = known.get((own, text), ("", "") if many else ("",))
        made.add((text, many) if many else text, said[: made.num_plurals] if many else said[0], context=own)
    return made


def _empty(language: str) -> Catalog:
    made = Catalog(
        language,
        project="scancell",
        version="0.2",
        msgid_bugs_address="issues",
        last_translator="scancell",
        language_team=language,
        creation_date=_ALWAYS,
        revision_date=_ALWAYS,
        fuzzy=False,
    )
    made.header_comment = "# Texts of scancell; made by `make catalogues`."
    return made


def _catalogue(language: str, texts: set[Text], known: dict[str, tuple[str, ...]]) -> Catalog:
    made = _empty(language)
    for one, many in texts:
        if many:
            forms = known.get(one, ("",) * made.num_plurals)
            made.add((one, many), forms[-made.num_plurals :] if len(forms) > made.num_plurals else forms)
        else:
            made.add(one, known[one][0] if one in known else "")
        made[one].flags.discard("python-format")
    return made


if __name__ == "__main__":
    update()
