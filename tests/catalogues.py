"""Takes up new texts into the catalogues, and writes docs/findings: `make catalogues`.

A text keeps the translation that any catalogue has of it; a new one is filled with what the page's old tables know
of it.
"""

import io
import re
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from babel.messages.catalog import Catalog
from babel.messages.extract import extract
from babel.messages.pofile import read_po, write_po

from calib_core.findings import pages, table
from calib_core.findings.code import Plural

ROOT = Path(__file__).resolve().parents[1]
LOCALE = ROOT / "calib_core" / "findings" / "locale"
DOCS = ROOT / "docs" / "findings"
TRANSLATED = ("de", "zh")
KEYWORDS = {"message": (1,), "plural": (1, 2)}
Text = tuple[str, str]  # the template, and its plural or nothing
_PLACE = re.compile(r"\{[^{}]*\}")
_ALWAYS = datetime(2026, 1, 1, tzinfo=UTC)  # the files change with their texts alone


def texts_by_area() -> dict[str, set[Text]]:
    """Return all texts by the file that they stand in; one that several areas have stands in the first."""
    found: dict[str, set[Text]] = {}
    for area, codes in table.areas().items():
        for code in codes:
            for text in code.texts():
                said = (text.one, text.many) if isinstance(text, Plural) else (text, "")
                found.setdefault(area, set()).add(said)
    for top in ("calib_core", "server"):
        for file in sorted((ROOT / top).rglob("*.py")):
            room = file.relative_to(ROOT / top).parts[0].removesuffix(".py") if top == "calib_core" else "server"
            found.setdefault(room, set()).update(messages_of(file))
    seen: set[str] = set()
    for texts in found.values():
        texts -= {text for text in texts if text[0] in seen or not re.search("[A-Za-z]", _PLACE.sub("", text[0]))}
        seen |= {text[0] for text in texts}
    return {area: texts for area, texts in sorted(found.items()) if texts}


def messages_of(file: Path) -> Iterator[Text]:
    """Give the texts of `message` and `plural` in a source file."""
    content = file.read_bytes()
    if b"message(" not in content and b"plural(" not in content:
        return
    for _, said, _, _ in extract("python", io.BytesIO(content), KEYWORDS):
        yield (said, "") if isinstance(said, str) else (str(said[0]), str(said[1]))


def catalogue_of(language: str) -> dict[str, tuple[str, ...]]:
    """Return what all files of a language translate."""
    found: dict[str, tuple[str, ...]] = {}
    for file in sorted((LOCALE / language).glob("*.po")):
        with file.open("rb") as stream:
            for one in read_po(stream, locale=language):
                key = one.id if isinstance(one.id, str) else one.id[0]
                forms = (one.string,) if isinstance(one.string, str) else tuple(one.string)
                if key and any(forms):
                    found.setdefault(key, forms)
    return found


def from_page(text: str, language: str) -> str:
    """Return what the page's old tables say of a text, nothing where they do not know it."""
    known = _page(language)
    whole = _seeded(text, known)
    if whole:
        return whole
    sentences = re.split(r"(?<=[.!?]) (?=[A-Z])", text)
    parts = [_seeded(sentence, known) for sentence in sentences]
    return (" " if language != "zh" else "").join(parts) if len(parts) > 1 and all(parts) else ""


def _seeded(text: str, known: dict[str, str]) -> str:
    places = _PLACE.findall(text)
    template = _PLACE.sub("{}", text)
    for wanted, stop in ((template, ""), (template.removesuffix("."), "."), (template + ".", "-")):
        if wanted in known:
            said = known[wanted]
            if stop == ".":
                said += "。" if re.search(r"[\u4e00-\u9fff]", said) else "."
            return _placed(said.rstrip(".。") if stop == "-" else said, places)
    return ""


def _placed(said: str, places: list[str]) -> str:
    following = iter(places)
    try:
        return re.sub(r"\{(\d?)\}", lambda hit: places[int(hit[1]) - 1] if hit[1] else next(following), said)
    except (StopIteration, IndexError):
        return ""


_PAGES: dict[str, dict[str, str]] = {}


def _page(language: str) -> dict[str, str]:
    if language not in _PAGES:
        _PAGES[language] = dict(_page_entries(language))
    return _PAGES[language]


def _page_entries(language: str) -> Iterator[tuple[str, str]]:
    try:
        from server.http.page_sentences import entries_of
    except ImportError:  # the old tables have gone
        return
    for file in sorted((ROOT / "web" / "texts" / "server").glob("*.js")):
        for said, words in entries_of(file):
            yield said, words[language]


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
    DOCS.mkdir(exist_ok=True)
    written = pages.files()
    for file in DOCS.glob("*.md"):
        if file.name not in written:
            file.unlink()
    for name, content in written.items():
        (DOCS / name).write_text(content, encoding="utf-8")


def _catalogue(language: str, texts: set[Text], known: dict[str, tuple[str, ...]]) -> Catalog:
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
    for one, many in texts:
        if many:
            forms = known.get(one) or tuple(from_page(text, language) for text in (one, many))
            made.add((one, many), forms[-made.num_plurals :] if len(forms) > made.num_plurals else forms)
        else:
            made.add(one, known[one][0] if one in known else from_page(one, language))
        made[one].flags.discard("python-format")
    return made


if __name__ == "__main__":
    update()
