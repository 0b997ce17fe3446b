"""Messages: what a text was made of is found again by its English words, and an empty text by nothing."""

from calib_core.findings.catalogues import catalogue
from calib_core.findings.telling import block_in
from calib_core.messages import Names, made_lately, message, sentences
from calib_core.records.evidence import Column, Row, Table


def test_a_message_is_found_by_its_english_text() -> None:
    said = message("moved by {shift_mm:.1f} mm", shift_mm=0.25)
    found = made_lately(str(said))
    assert found is not None
    assert (found.template, found.values) == (said.template, said.values)


def test_an_empty_text_is_nobodys() -> None:
    """Results would say other things of a process that had once joined no sentences."""
    assert sentences(["", ""]) == ""
    assert made_lately("") is None


def test_what_somebody_named_is_said_as_it_stands() -> None:
    """A name that is also a word of the catalogue is a name: an axis `one`, a scanner `camera`, a capture `no`."""
    german = catalogue("de")
    said = [
        german.say(message("Scanner {scanner} on {carrier}", scanner="camera", carrier="linear")),
        german.say(message("the axes {axes}", axes=["one", "Turntable"])),
        german.say(message("{captures} contradict", captures=Names(["no"]))),
        german.say(message("By {who}, reason: {why}.", who="Robot", why=message("none given"))),
    ]
    table = Table(
        columns=[Column(label="Axis", own=True), Column(label="Kind")], rows=[Row(cells=["linear", "linear"])]
    )
    told = block_in(table, german)
    words = ("camera", "linear", "one", "Turntable", "Robot")
    assert {word for word in words if any(word in text for text in said)} == set(words)
    assert said[2].startswith("no ")
    assert "none given" not in said[3]  # of ours, where nobody gave one
    assert told.rows[0].cells == ["linear", german.say("linear")]
    assert told.columns[0].label == german.say("Axis") != "Axis"


def test_chinese_keeps_latin_names_apart() -> None:
    said = catalogue("zh")
    assert said.captures(["p03", "p05"]) == "p03 和 p05"
    assert said.listed(["p03", "球"]) == "p03和球"
