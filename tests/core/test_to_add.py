"""The table "to add …, open …" of docs/architecture.md: each thing is added by the one file or folder it names.

Done in a copy of the sources; what exists is asked of the copy in a process of its own.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PLUGIN = ROOT / "docs" / "examples" / "scancell-example-plugin" / "scancell_example_plugin"

BRAND = '''
"""Acme robots: poses as Nachi writes them, under another name."""

from dataclasses import replace

from calib_core.robots.brand import Brand
from calib_core.robots.nachi import CONVENTION as LIKE

CONVENTION = replace(LIKE, name="acme")


class Acme(Brand):
    """Acme."""

    name = "acme"
    title = "Acme"
    conventions = (CONVENTION,)
    rank = 99


BRAND = Acme()
'''

STAGE = '''
"""How many captures there are."""

from typing import ClassVar

from calib_core.records.evidence import Figure
from calib_core.stages.acme.record import AcmeResult
from calib_core.graph.stage import SOFTWARE, Stage
from calib_core.steps import CaptureStep


class Acme(Stage):
    """A count."""

    name, title, place = "acme", "Count", 900
    step = CaptureStep("acme", "Count", "sphere", "Capture anything.")
    takes: ClassVar = {"acme": ("kind",)}
    after = ()
    guided = ("acme",)
    result = AcmeResult

    def solve(self, given):
        """Return the count."""
        count = len(given.captures)
        key = given.inputs_sha256
        return AcmeResult(method="counting", software=SOFTWARE, inputs_sha256=key, verdict="pass", count=count)

    def evidence(self, session, result):
        """Return the count as a figure."""
        return [Figure(label="Counted", text=str(result.count))]


STAGE = Acme()
'''

RECORD = '''
"""The count's record."""

from typing import Literal

from calib_core.records.results import Result


class AcmeResult(Result):
    """A count."""

    stage: Literal["acme"] = "acme"
    count: int
'''

PROGRAM = '''
"""Programs for Acme robots."""

from calib_core.robots.programs.program import Program


def write(plan):
    """Return the names of the stops."""
    return {"a.txt": " ".join(stop.name for stop in plan.stops)}


PROGRAM = Program("acme-basic", "Acme BASIC", "nachi", write)
'''

COMMAND = '''
"""`scancell acme`: says hello."""

from server.console.command import Command


def _run(options):
    print("hello from acme")
    return 0


COMMAND = Command("acme", "say hello", "session", lambda parser: None, _run)
'''

MOVER = '''
"""Turns the Acme table."""

from server.movers.mover import MoverEntry


class AcmeTable:
    """Stands where it was last told to go."""

    def __init__(self):
        self.at_deg = 0.0

    def go_to(self, table_deg):
        self.at_deg = table_deg

    def stop(self):
        """It stands already."""

    def close(self):
        """It has no connection."""


MOVER = MoverEntry("acme-table", "Acme table", "Turns the Acme table.", lambda settings: AcmeTable())
'''

ASKED = """
import json
from calib_core.archive.folder import result_data
from calib_core.exports.registry import EXPORTS
from calib_core.formats.points import FORMATS
from calib_core.records import parse_session
from calib_core.robots import parse_pose
from calib_core.robots.programs.registry import PROGRAMS
from calib_core.simulation import simulate
from calib_core.graph.keys import Graph
from calib_core.stages.pipeline import run
from calib_core.steps import capture_steps, guided_steps, stage_names
from server.movers.registry import MOVERS
from server.sources.registry import SOURCES

center = {"id": "a1", "step": "acme", "kind": "center", "center_mm": [1, 2, 3], "pose": [1, 2, 3, 0, 0, 0]}
cell = {"pose_convention": "acme"}
session = parse_session({"format": "scancell-session/1", "cell": cell, "captures": [center]})
counted = run(session, dict, "acme")["acme"]
tcp = simulate("tcp", 1)
solved = run(tcp.session, tcp.files.__getitem__, "tcp")["tcp"]
stored = {"acme": result_data(counted)}
mover = MOVERS.get("acme-table")
table = mover.connect(mover.settings())
table.go_to(30.0)
moved = session.model_copy(update={"captures": [session.captures[0].model_copy(update={"excluded": True})]})
print(json.dumps({
    "names": [FORMATS.names(), EXPORTS.names(), SOURCES.names(), PROGRAMS.names(), list(stage_names())],
    "steps": [[step.name for step in capture_steps()], list(guided_steps())],
    "pose": parse_pose("acme", [1, 2, 3, 0, 0, 0]).translation_mm.tolist(),
    "count": counted.count, "text": str(counted),
    "stale": [sorted(Graph.stale_of(s, dict, stored)) for s in (session, moved)],
    "figure": str(solved),
    "movers": [MOVERS.names(), table.at_deg],
}))
"""


def write(tree: Path, place: str, text: str) -> None:
    file = tree / place
    assert not file.exists(), "it is one new file"
    file.parent.mkdir(exist_ok=True)
    file.write_text(text)


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sources with one small thing of each kind added."""
    tree = tmp_path_factory.mktemp("tree")
    for top in ("calib_core", "server"):
        shutil.copytree(ROOT / top, tree / top, copy_function=shutil.copy2)
    shutil.copy(PLUGIN / "acme_profile.py", tree / "calib_core" / "formats" / "acme.py")
    shutil.copy(PLUGIN / "acme_matrix.py", tree / "calib_core" / "exports" / "acme.py")
    shutil.copy(PLUGIN / "acme_drop.py", tree / "server" / "sources" / "acme.py")
    write(tree, "calib_core/robots/acme/__init__.py", BRAND)
    write(tree, "calib_core/stages/acme/__init__.py", STAGE)
    write(tree, "calib_core/stages/acme/record.py", RECORD)
    write(tree, "calib_core/robots/programs/acme.py", PROGRAM)
    write(tree, "server/commands/acme.py", COMMAND)
    write(tree, "server/movers/acme.py", MOVER)
    evidence = tree / "calib_core" / "stages" / "tcp" / "evidence.py"
    text = evidence.read_text()
    line = "        *workpiece_headline(places),\n"
    assert line in text
    evidence.write_text(text.replace(line, line + '        Figure(label="Answer to all", text="42"),\n', 1))
    return tree


def ran(tree: Path, *arguments: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    command = [sys.executable, *arguments]
    done = subprocess.run(
        command, cwd=tree, env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.thorough
def test_one_file_or_folder_adds_one_of_each(tree: Path) -> None:
    found = json.loads(ran(tree, "-c", ASKED).splitlines()[-1])
    formats, exports, sources, programs, stages = found["names"]
    assert "acme-profile" in formats
    assert "acme-matrix" in exports
    assert "acme-drop" in sources
    assert "acme-basic" in programs
    assert "acme" in stages
    assert all("acme" in steps for steps in found["steps"])
    assert found["pose"] == [1, 2, 3]
    assert found["count"] == 1
    assert "Counted" in found["text"]
    assert found["stale"] == [[], ["acme"]]
    assert "Answer to all" in found["figure"]
    assert "acme-table" in found["movers"][0]
    assert found["movers"][1] == 30.0


def test_one_file_adds_a_command(tree: Path) -> None:
    assert ran(tree, "-m", "server.cli", "acme") == "hello from acme\n"
    assert "say hello" in ran(tree, "-m", "server.cli", "--help")
