"""The page's texts: each key stands once, is used, and is there in every language with the same places."""

import gzip
import json
import re
from collections import Counter
from importlib import import_module
from pathlib import Path
from typing import get_args, get_origin
from zipfile import ZipFile

import pytest

from calib_core.archive.archive import verify
from calib_core.errors import CalibrationError
from calib_core.findings.catalogues import LANGUAGES, catalogue, entries
from calib_core.findings.telling import told as said
from calib_core.poses.numbers import parse_pose
from calib_core.records.results import Result
from calib_core.robots.backup import read_controller_files
from server.http.page_texts import english, plural_of, served, translations

WEB = Path(__file__).resolve().parents[2] / "web"
TEXTS = WEB / "texts"
MOST_BYTES = 60_000
"""Of the page's texts in a language, compressed."""


def test_each_name_stands_once() -> None:
    names = [name for file in TEXTS.rglob("*.json") for name in json.loads(file.read_text(encoding="utf-8"))]
    assert len(names) > 400
    assert [name for name, count in Counter(names).items() if count > 1] == []


def test_each_text_is_used() -> None:
    """By its name, or by the beginning that code puts a name behind (`status.${word}`)."""
    files = [file for file in WEB.rglob("*.js") if not {"vendor", "texts"} & set(file.relative_to(WEB).parts)]
    code = "\n".join(file.read_text(encoding="utf-8") for file in files)
    begun = re.findall(r"`([a-z_]+[._][a-z_.]*)\$\{", code)
    names = english(TEXTS)
    assert [one for one in names if f'"{one}"' not in code and not any(one.startswith(by) for by in begun)] == []


SAID = re.compile(
    r"\b(warnings?|notes?|sentence|reason|to_do)\b[\w?.()\[\]]{0,20}\.(startsWith|endsWith|includes|indexOf|match|search)\("
)


def test_the_page_looks_into_no_sentence() -> None:
    """It goes by codes and records; how a folder was taken is told by a code too, which `reason` holds there."""
    files = [file for file in WEB.rglob("*.js") if not {"vendor", "texts"} & set(file.relative_to(WEB).parts)]
    lines = {(file.name, line.strip()) for file in files for line in file.read_text(encoding="utf-8").splitlines()}
    found = {name for name, line in lines if SAID.search(line) and "taken[index]?.reason" not in line}
    assert found == set()
    matched = 'if (reason.startsWith("a capture of kind ")) return', "measured.reason.includes(measured.to_do)"
    assert all(SAID.search(line) for line in matched)


@pytest.mark.parametrize("language", ["de", "zh"])
def test_every_language_has_every_text_with_its_places(language: str) -> None:
    """As the catalogue is now: a text whose English has changed is to be translated anew."""
    texts = english(TEXTS)
    found = translations(TEXTS, language)
    plurals = {plural_of(name) for name in texts} & texts.keys()
    assert found.keys() == texts.keys() - plurals, "run `make catalogues`"
    for name, forms in found.items():
        assert len(forms) == (2 if plural_of(name) in plurals and language == "de" else 1), name
        for text in forms:
            assert text.strip(), f"{name} is not translated"
            places = [sorted(re.findall(r"\{\w+\}", side)) for side in (text, texts[name])]
            assert places[0] == places[1], name
            assert language != "de" or not re.search(r"\d\.\d", text), name


@pytest.mark.parametrize("language", ["de", "zh"])
def test_what_two_names_or_page_and_core_say_alike_is_translated_once(language: str) -> None:
    """A name has an entry of its own where its words differ; an entry that serves no name has left."""
    content = (TEXTS / f"{language}.po").read_text(encoding="utf-8")
    texts, core = english(TEXTS), catalogue(language).texts
    said: dict[str, list[str]] = {}
    for one in entries(content):
        if one["msgid"]:
            assert texts[one["msgctxt"]] == one["msgid"] if "msgctxt" in one else one["msgid"] in texts.values()
            said.setdefault(one["msgid"], []).append(one["msgstr"][0])
    for text, words in said.items():
        assert len({*words, *core.get(text, ())[:1]}) == len(words) + (text in core), text


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_page_gets_all_texts_of_its_language_in_two_parts(language: str) -> None:
    said = [served(TEXTS, language, later) for later in (False, True)]
    areas = [area for half in said for area in half.items()]
    names = [f"{area}.{rest}" if rest else area for area, texts in areas for rest in texts]
    assert sorted(names) == sorted(english(TEXTS))
    assert len(gzip.compress(json.dumps(said, ensure_ascii=False).encode())) < MOST_BYTES


def test_who_says_a_later_text_waits_for_it() -> None:
    late = english(TEXTS / "later")
    assert len(late) > 400
    for file in WEB.rglob("*.js"):
        if "vendor" in file.parts or (code := file.read_text(encoding="utf-8")).count('texts/later.js";'):
            continue
        begun = tuple(re.findall(r"`([a-z_]+[._][a-z_.]*)\$\{", code))
        assert [name for name in late if f'"{name}"' in code or (begun and name.startswith(begun))] == [], file


def test_no_module_imports_itself_by_a_way_round() -> None:
    """Dynamic imports count; `state/` knows neither components nor pages."""
    imports: dict[str, set[str]] = {}
    for file in WEB.rglob("*.js"):
        if "vendor" in file.parts:
            continue
        code = re.sub(r"/\*\*.*?\*/", "", file.read_text(encoding="utf-8"), flags=re.DOTALL)
        named = re.findall(r'(?:from|import) "(\.[^"]+)"|import\("(\.[^"]+)"\)', code)
        imports[str(file)] = {str((file.parent / (a or b)).resolve()) for a, b in named}
    for file, others in imports.items():
        assert all(Path(other).is_file() for other in others), (file, others)
        if Path(file).parent.name == "state":
            assert all(Path(other).parent.name in ("state", "web") for other in others), file
    free: set[str] = set()
    while len(free) < len(imports):
        ready = {file for file, others in imports.items() if file not in free and others <= free}
        assert ready, f"these import each other: {sorted(set(imports) - free)}"
        free |= ready


BROKEN_PROGRAM = b"""DECL E6POS XP1={X 1,Y 2,Z 3}
DECL E6POS XP2={X 1,Y 2,Z 3,A 10,B 20,C ***}
DECL E6POS XP5={X 1,Y 2,Z 3,A 10,B 20,C 30}
DECL FDAT FP5={TOOL_NO 4,BASE_NO 0,IPO_FRAME #BASE}
DECL E6POS XP6={X 1,Y 2,Z 3,A 10,B 20,C 30}
DECL E6POS XP4={X 1,Y 2,Z 3,A 10,B 20,C 30
"""


def test_what_bad_files_are_refused_for_is_said(tmp_path: Path) -> None:
    """With the names and numbers of real files in it, as the server says it."""
    found = read_controller_files({"measure.dat": BROKEN_PROGRAM})
    told = [*(row.reason for row in found.skipped), *(pose.doubt for pose in found.poses if pose.doubt)]
    hostile = tmp_path / "hostile.zip"
    with ZipFile(hostile, "w") as packed:
        packed.writestr("../evil.txt", "x")
    for refuse in (
        lambda: verify(hostile),
        lambda: read_controller_files({"p.urp": b"\x1f\x8b\x08\x00abcdefgh"}),
        lambda: parse_pose("kuka", [float("nan"), 1, 2, 3, 4, 5]),
    ):
        with pytest.raises(CalibrationError) as refused:
            refuse()
        told.append(refused.value.message)
    answers = {language: said({"reason": told}, catalogue(language))["reason"] for language in ("de", "zh")}
    assert answers["de"][:2] == [
        "XP1: A, B, C fehlt: Ein Teil einer Position genügt nicht",
        "XP2: „***“ ist keine Zahl",
    ]
    assert answers["zh"][:2] == ["XP1：缺少 A, B, C：只有部分位置是不够的", "XP2：“***”不是数字"]
    assert "hostile.zip: Benötigt: Namen, die im Ordner des Archivs bleiben" in answers["de"][-3]
    left = re.compile(r"\b(the|of|and|is|are|with|need|got|which|its|a|no|not)\b")
    for text in [*answers["de"], *answers["zh"]]:
        assert not left.search(text.removeprefix(f"{tmp_path}/")), text


def test_every_figure_of_a_result_has_words_where_two_are_compared() -> None:
    """The comparison shows each number of a result by its field's name."""
    numbers = {
        name
        for record in every_result(Result)
        for name, field in record.model_fields.items()
        if {field.annotation, *get_args(field.annotation)} & {int, float}
        and get_origin(field.annotation) not in (list, tuple, dict)
    }
    assert {"method_revision", "corner_sigma_px", "chi_squared"} <= numbers
    assert {f"figure.{name}" for name in numbers} <= english(TEXTS).keys()


def every_result(record: type[Result]) -> list[type[Result]]:
    """Return a kind of result and all that are made of it, once each stage's is there."""
    for file in (WEB.parent / "calib_core/stages").glob("*/record.py"):
        import_module(f"calib_core.stages.{file.parent.name}.record")
    return [record, *(one for made in record.__subclasses__() for one in every_result(made))]
