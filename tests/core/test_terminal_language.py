"""What commands print in the language that is asked for, beside results, which have tests of their own."""

from pathlib import Path
from unicodedata import east_asian_width

import pytest

from calib_core.counted import captures
from calib_core.findings.catalogues import catalogue
from calib_core.messages import message
from server.cli import COMMANDS, main
from server.commands.demo.sheet import Sheet


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(list(words)) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("language", "words"), [("en", "glue it flat"), ("de", "kleben Sie sie eben auf"), ("zh", "平整粘贴")]
)
def test_a_board_says_how_to_print_it(
    language: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = said(capsys, "board", str(tmp_path / "board.svg"), "--lang", language)
    assert words in text.splitlines()[0]
    assert '"pitch_mm": 20.0' in text.splitlines()[-1]


@pytest.mark.thorough
def test_lines_within_a_list_are_said_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert said(capsys, "update", "--data", str(tmp_path), "--lang", "de").endswith("noch keine Datenbank darin\n")
    field = ("--near-mm", "100", "--far-mm", "300", "--near-width-mm", "60")
    text = said(capsys, "plan", *field, "--lang", "de")
    assert "\n  Der Scanner soll die Kugel in " in text
    assert "the stripe" not in text


def test_the_frames_of_a_cell_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = str(tmp_path / "cell")
    said(capsys, "simulate", "tcp", "--seed", "1", "--out", folder)
    assert said(capsys, "frames", folder, "--lang", "de").splitlines() == [
        "base_from_tool0: mit jeder Aufnahme gemessen",
        "tool0_from_laser: noch nicht berechnet, das tut tcp",
    ]


@pytest.mark.parametrize(("language", "words"), [("en", "note     "), ("de", "Hinweis  "), ("zh", "提示     ")])
def test_severities_are_said(
    language: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = str(tmp_path / "cell")
    said(capsys, "simulate", "tcp", "--seed", "1", "--out", folder)
    assert said(capsys, "check", folder, "--lang", language).startswith(words)
    assert words in said(capsys, "findings", "--lang", language)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["run", "--lang", "de"], "Diese Argumente fehlen: SESSION. Siehe scancell run --help.\n"),
        (["run", "x", "--lang=zh", "--stages"], "无法识别的参数：--stages（您是指 --stage 吗？）"),
        (["simulate", "tcp", "--seed", "x", "--lang", "de"], "--seed: ungültiger Wert vom Typ int: 'x'"),
        (["run"], "the following arguments are required: SESSION. See scancell run --help.\n"),
    ],
)
def test_usage_errors_are_said(arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize("language", ["de", "zh"])
def test_help_says_what_each_command_is_for(language: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    english = set(capsys.readouterr().out.splitlines())
    assert main(["--help", "--lang", language]) == 0
    said = capsys.readouterr().out.splitlines()
    assert [line for line in said if line.strip() and line in english] == []
    for command in COMMANDS:
        assert main([command.name, "--help", "--lang", language]) == 0
        about = capsys.readouterr().out.split("\n\n")[1]
        assert command.help[1:] not in about
        assert about.endswith("。" if language == "zh" else ".")


@pytest.mark.parametrize(("count", "words"), [(1, "1 Aufnahme"), (2, "2 Aufnahmen")])
def test_one_is_said_otherwise_than_several(count: int, words: str) -> None:
    assert catalogue("de").say(captures(count)) == words


def test_what_the_demo_found_stands_in_columns_in_every_language() -> None:
    widths: set[int] = set()
    for language in ("en", "de", "zh"):
        sheet = Sheet(catalogue(language))
        sheet.heads(message("found ± 95 %"))
        sheet.numbers(message("ball, diameter, mm"), "30.012 ± 0.020", 30.012, 30.0)
        sheet.line(
            message("tool, error"),
            message("{turned_deg:.3f}° and {moved_mm:.3f} mm", turned_deg=0.1, moved_mm=0.2),
        )
        widths |= {len(line) + sum(east_asian_width(one) in "WF" for one in line) for line in sheet.lines}
        assert sheet.lines[1].split()[-2:] == ["30.000", "0.012"]
        assert ("deviation" in sheet.lines[0]) == (language == "en")
    assert len(widths) == 1
