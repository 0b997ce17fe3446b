"""Findings: one verdict, texts in every language with the same places, pages that are up to date."""

import io
import re

import pytest
from babel.messages.pofile import read_po

from calib_core.findings import (
    CODES,
    LANGUAGES,
    Code,
    Finding,
    Plural,
    as_read,
    catalogue,
    in_language,
    judgement,
    reasons_of,
    verdict_of,
)
from calib_core.findings.catalogues import entries
from calib_core.findings.code import places_of
from calib_core.findings.pages import page_of
from calib_core.messages import ENGLISH, Message, Names, message, plural
from calib_core.records import Result, RootCause
from tests.catalogues import DOCS, LOCALE, TRANSLATED, catalogue_of, texts_by_area

FAR = Code("far", "warning", text="{captures} lies {shift_mm:.1f} mm off.", to_do="Take it again.")
OPEN = Code("open", "error", text="Nothing fixes it.", fixed=True)
TOLD = Code("told", "note", text="It was told.")
FOLLOWS = Code("follows", "warning", text="So this fits nothing.", behind=("open",))
MANY = Code("many", "error", text="Many lie far off.", led_by=("far",))


@pytest.fixture
def known(monkeypatch: pytest.MonkeyPatch) -> None:
    from calib_core.findings import table

    codes = {code.name: code for code in (FAR, OPEN, TOLD, FOLLOWS, MANY)}
    monkeypatch.setattr(table, "_by_name", lambda: codes)


def result_of(*findings: Finding) -> Result:
    return Result(method="m", software="s", inputs_sha256="0", **judgement(findings))


def test_the_verdict_is_the_worst_severity() -> None:
    far, note = FAR(["p1"], shift_mm=1.0), TOLD()
    assert [verdict_of(some) for some in ([], [note], [note, far], [far, OPEN()])] == [
        "pass",
        "pass",
        "warn",
        "fail",
    ]


@pytest.mark.usefixtures("known")
def test_a_result_is_made_of_its_findings_errors_first() -> None:
    result = result_of(TOLD(), FAR(["p1", "p2", "p3"], shift_mm=1.25), FOLLOWS(), OPEN())
    assert result.verdict == "fail"
    assert result.warnings == ["Nothing fixes it.", "p1–p3 lies 1.2 mm off. Take it again."]
    assert result.notes == ["It was told."]
    assert [finding.behind for finding in result.findings if finding.code == "follows"] == ["open"]


@pytest.mark.usefixtures("known")
def test_what_happened_stands_before_the_error_that_it_brought_about() -> None:
    remedy = RootCause(id="far-p1", kind="moved-sphere", title="It moved", captures=["p1"])
    far = FAR(["p1"], shift_mm=1.0, remedy=remedy)
    order = [[one.code for one in result_of(*some).findings] for some in ([MANY(), far], [OPEN(), far])]
    assert order == [["far", "many"], ["open", "far"]]
    assert [one.code for one in result_of(MANY(), FAR(["p1"], shift_mm=1.0)).findings] == ["many", "far"]
    assert result_of(MANY(), far).verdict == "fail"


@pytest.mark.usefixtures("known")
def test_a_cell_changes_severities_as_a_result_is_read_but_none_that_is_fixed() -> None:
    stored = result_of(FAR(["p1"], shift_mm=1.0)).to_json()
    read = as_read(stored, "en", {"far": "note"})
    assert (read["verdict"], read["warnings"], len(read["notes"])) == ("pass", [], 1)
    assert as_read(stored)["verdict"] == stored["verdict"] == "warn"
    failed = as_read(result_of(OPEN()).to_json(), "en", {"open": "note"})
    assert (failed["verdict"], failed["findings"][0]["severity"]) == ("fail", "error")


def test_a_result_of_an_earlier_release_gets_findings_that_say_what_it_said() -> None:
    told = {"method": "m", "software": "s", "inputs_sha256": "0", "verdict": "fail", "tool": 1}
    read = as_read({**told, "warnings": ["Too few.", "And noisy."], "notes": ["By class."]})
    assert [one["severity"] for one in read["findings"]] == ["error", "warning", "note"]
    assert (read["verdict"], read["warnings"], read["notes"]) == (
        "fail",
        ["Too few.", "And noisy."],
        ["By class."],
    )
    assert read["tool"] == 1


def test_a_message_is_its_english_text_and_can_be_said_in_other_languages() -> None:
    german = catalogue("de")
    said = plural(
        "{count} pose in {names}", "{count} poses in {names}", by="count", count=2, names=["a", "b", "c"]
    )
    assert said == "2 poses in a, b and c"
    assert german.say(said) == "2 poses in a, b und c"  # not translated: as it is, but for the list
    assert isinstance(said, Message)
    assert message("{x:+.1f} of {y}, {z}", x=0.24, y=7, z=0.01234) == "+0.2 of 7, 0.0123"
    assert message("{names:or}", names=["a", "b"]) == "a or b"
    assert ENGLISH.captures(["p09", "p10", "p11", "p13"]) == "p09–p11 and p13"
    assert ENGLISH.captures(Names(f"c{2 * k}" for k in range(14))).endswith("c22 and 2 more")


@pytest.mark.usefixtures("known")
def test_values_that_are_messages_and_values_by_capture_are_said_in_each_language() -> None:
    why = message("one of {names}", names="x")
    code = Code("why", "warning", text="Not used: {why}.", reason="{why}, {off_mm:.1f} mm")
    found = code(["p1", "p2"], why=why, each={"p1": {"off_mm": 1.0}, "p2": {"off_mm": 2.0}})
    stored = Finding.model_validate(found.to_json())
    assert stored.text == "Not used: one of x."
    from calib_core.findings import table

    table._by_name()["why"] = code
    german = catalogue("de").say(why)
    assert german != why
    assert in_language(stored, "de").text == f"Not used: {german}."
    assert reasons_of([stored], catalogue("de")) == {"p1": f"{german}, 1.0 mm", "p2": f"{german}, 2.0 mm"}


def test_codes_are_words_with_hyphens_and_each_has_its_page() -> None:
    for name, code in CODES.items():
        assert re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", name), name
        assert code.meaning, name
        assert code.decided, name
        assert not set(code.behind) - set(CODES), name
        said = str((code.text, code.to_do, code.reason))
        assert not re.search(r"`[\w.]+`", said), name  # words are printed; fields are named where it is explained


@pytest.mark.thorough
def test_catalogues_hold_what_the_program_says_and_nothing_else_with_the_same_places() -> None:
    areas = texts_by_area()
    texts = sorted({text for texts in areas.values() for text in texts})
    for language in TRANSLATED:
        known = catalogue_of(language)
        assert set(known) == {one for one, _ in texts}, language
        assert {file.stem for file in (LOCALE / language).glob("*.po")} == set(areas), language
        for one, many in texts:
            wanted = {*places_of(one), *places_of(many)}
            for form in known[one]:
                found = set(places_of(form))
                assert found <= wanted, (one, form)
                assert found == wanted or (many and found == set(places_of(one))), (one, form)


@pytest.mark.parametrize("language", TRANSLATED)
def test_our_reader_reads_what_babel_reads(language: str) -> None:
    for file in (LOCALE / language).glob("*.po"):
        content = file.read_bytes()
        told = {one["msgid"]: tuple(one["msgstr"]) for one in entries(content.decode()) if one["msgid"]}
        wanted = {
            (one.id if isinstance(one.id, str) else one.id[0]): (
                (one.string,) if isinstance(one.string, str) else tuple(one.string or ())
            )
            for one in read_po(io.BytesIO(content), locale=language)
            if one.id
        }
        assert told == wanted
    assert catalogue(language).form_of(1) == 0
    assert set(LANGUAGES) == {"en", *TRANSLATED}


def test_the_pages_are_up_to_date() -> None:
    from calib_core.findings.pages import files

    assert {file.name: file.read_text(encoding="utf-8") for file in DOCS.glob("*.md")} == files()


@pytest.mark.parametrize("language", TRANSLATED)
def test_pages_are_in_their_language_with_texts_that_have_plural_forms(language: str) -> None:
    """`scancell findings` and the page a click away showed templates with plural forms in English."""
    for code in CODES.values():
        page, english = page_of(code, language), page_of(code)
        for field in ("text", "to_do"):
            for said, before in zip(page[field], english[field], strict=True):
                assert said != before or not re.search("[a-z]{3}", re.sub(r"\{[^}]*\}", "", before)), code.name


def test_plurals_choose_by_captures_or_a_value() -> None:
    code = Code("n", "note", text=Plural("{captures} is one.", "{captures} are several."))
    assert [code(names).text for names in (["a"], ["a", "b"])] == ["a is one.", "a and b are several."]
    by_value = Code("v", "note", text={"far": "Far.", "near": "Near."}, by="how")
    assert by_value(how="near").text == "Near."
