"""docs/figures.md is what its figures say, one short line each, and every command that it names is there."""

import re

import figures as kept

from server.cli import COMMANDS


def test_the_page_is_made_from_the_figures() -> None:
    assert kept.PAGE.read_text(encoding="utf-8") == kept.page(kept.read()), "scancell bench --write makes it"


def test_a_figure_is_one_short_line() -> None:
    found = kept.read()
    assert len(found) > 100
    for one in found:
        text = f"{one['what']} {one['target']} {one['measured']}"
        assert len(text.split()) <= kept.MOST_WORDS, text
        assert "|" not in text
        assert re.fullmatch(r"\d{4}-\d\d-\d\d", one["date"])
        assert one["command"]
        assert one.get("missed", "a reason")


def test_the_commands_are_there() -> None:
    assert "bench" in COMMANDS.names()
    for one in kept.read():
        words = one["command"].split()
        if words[:2] == ["scancell", "bench"]:
            assert (kept.ROWS.parent / f"bench_{words[2]}.py").is_file(), one
        elif words[0].startswith("tests/"):
            assert (kept.ROOT / words[0]).is_file(), one


def test_rows_measured_anew_replace_those_of_before() -> None:
    row = {"what": "a", "target": "≤ 1", "measured": "2", "holds": False}
    before = [
        {
            "section": "S",
            "what": "a",
            "target": "≤ 1",
            "measured": "1",
            "date": "2000-01-01",
            "command": "scancell bench x",
        }
    ]
    (after,) = kept.measured_anew(before, "x", [row], full=True)
    assert (after["section"], after["measured"], after["command"]) == ("S", "2", "scancell bench x --full")
    assert after["missed"]
    added = kept.measured_anew(before, "x", [row | {"what": "b", "holds": True}], full=False)
    assert [one["what"] for one in added] == ["a", "b"]
    assert "missed" not in added[1]
