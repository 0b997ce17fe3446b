"""What proved a reader or writer is told wherever one is listed, and experimental ones say so."""

from pathlib import Path

import pytest

from calib_core.exports.registry import all_exports
from calib_core.formats.points import FORMATS
from calib_core.proof import WORDS, is_experimental
from calib_core.robots.programs.registry import PROGRAMS
from calib_core.robots.registry import BRANDS
from server.cli import main

DOCS = Path(__file__).parents[2] / "docs"


def test_nothing_claims_a_controller_that_nobody_has_seen() -> None:
    proofs = [one.proof for one in (*all_exports(), *BRANDS, *FORMATS, *PROGRAMS)]
    assert set(proofs) <= {*WORDS, None}
    assert "controller" not in proofs


def test_what_moves_a_robot_is_experimental() -> None:
    moving = [export for export in all_exports() if export.name.endswith("-check-move")]
    assert moving
    assert all(is_experimental(one.proof) for one in (*moving, *PROGRAMS))


def test_a_writer_is_proved_as_its_brands_reader() -> None:
    for brand in BRANDS:
        assert {one.proof for one in brand.exports() if one.name == brand.name} <= {brand.proof}


def test_the_documents_tell_it() -> None:
    table = (DOCS / "robots" / "README.md").read_text(encoding="utf-8")
    proved = {brand.title for brand in BRANDS if brand.proof == "real files" and brand.name != "table"}
    line = next(line for line in table.splitlines() if line.startswith("| real files"))
    assert all(title in line for title in proved)


@pytest.mark.parametrize(("name", "said"), [("kuka-check-move", True), ("kuka", False), ("json", False)])
def test_the_command_says_what_is_experimental(
    name: str, said: bool, solved_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["export", str(solved_folder), "--format", name, "--allow", "fail,stale", "--out", str(tmp_path / "o")])
    assert ("is experimental" in capsys.readouterr().err) is said


def test_a_planned_program_says_that_it_is_experimental(
    solved_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    program = tmp_path / "o.src"
    main(["next", str(solved_folder), "--count", "2", "--program", "kuka", "--out", str(program)])
    assert "is experimental" in capsys.readouterr().err
    assert "EXPERIMENTAL" in program.read_text(encoding="ascii")
