"""A cell's topology is decided in `calib_core/cell` alone."""

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from tests.core.test_import_rules import ROOT

ASKED = {"arrangement", "scanners", "spheres", "axes", "carries", "over_robot"}
"""Fields by which a topology is asked for."""
SAID = {"scanner-on-robot", "sphere-on-robot"}
CARRIERS = {"tool0", "base"}
HOME = (
    "calib_core/cell/",
    "calib_core/records/",
    "calib_core/simulation/",
    "calib_core/chain/",
    "scancell_client/",
)
"""Where it is decided, told or simulated; `chain` is the estimator, which walks the edges."""
WORDS = ("calib_core/exports/", "calib_core/robots/", "calib_core/evidence/", "server/render/", "server/commands/")
"""Words of exports, reports and commands, which name what a controller calls it."""

NAMED = 12
"""Files that may name tool0_from_laser."""


def decisions(file: Path) -> Iterator[str]:
    """Give what in a file asks for the topology of a cell, and branches by it."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute) and node.attr in ASKED and isinstance(node.ctx, ast.Load):
            owner = node.value
            if (isinstance(owner, ast.Name) and owner.id == "cell") or (
                isinstance(owner, ast.Attribute) and owner.attr == "cell"
            ):
                yield f"line {node.lineno}: .{node.attr}"
        elif isinstance(node, ast.Compare):
            constants = [one for one in ast.walk(node) if isinstance(one, ast.Constant)]
            if any(one.value in SAID | CARRIERS for one in constants if isinstance(one.value, str)):
                yield f"line {node.lineno}: compares a carrier"


def sources() -> list[Path]:
    return sorted(file for top in ("calib_core", "server") for file in (ROOT / top).rglob("*.py"))


def counted() -> dict[str, int]:
    found: Counter[str] = Counter()
    for file in sources():
        name = file.relative_to(ROOT).as_posix()
        if not name.startswith(HOME + WORDS):
            found[name] = sum(1 for _ in decisions(file))
    return {name: count for name, count in found.items() if count}


def test_no_decision_on_topology_stands_outside_the_cell() -> None:
    assert counted() == {}, "ask calib_core.cell instead"


def test_a_decision_is_seen(tmp_path: Path) -> None:
    file = tmp_path / "a.py"
    file.write_text('if session.cell.arrangement == "sphere-on-robot" or mount == "base":\n    pass\n')
    assert len(list(decisions(file))) == 3


def test_few_files_name_the_scanner_on_the_flange() -> None:
    named = [file for file in sources() if "tool0_from_laser" in file.read_text(encoding="utf-8")]
    assert len(named) <= NAMED, "frames by name are for records, exports and the page"
