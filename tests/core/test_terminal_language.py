"""What commands print in the language that is asked for, beside results, which have tests of their own."""

from pathlib import Path

import pytest

from server.cli import main


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


def test_lines_within_a_list_are_said_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert said(capsys, "update", "--data", str(tmp_path), "--lang", "de").endswith("noch keine Datenbank darin\n")
    field = ("--near-mm", "100", "--far-mm", "300", "--near-width-mm", "60")
    text = said(capsys, "plan", *field, "--lang", "de")
    assert "\n  Der Scanner soll die Kugel in " in text
    assert "the stripe" not in text
