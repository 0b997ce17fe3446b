"""The example package of docs/examples, installed as a stranger's, adds a format, an export and a source."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
USED = """
import json
import numpy as np
from calib_core.exports.registry import export_named
from calib_core.formats.points import FORMATS, endings_of, parse_profile
from calib_core.frames import RigidTransform
from calib_core.records import parse_cell, Session
from server.sources.registry import SOURCES
from server.sources.source import Occasion
from calib_core.exports.answer import Answer
from calib_core.exports.export import write_export

source = SOURCES.get("acme-drop")
session = Session(cell=parse_cell({"pose_convention": "fanuc"}))
occasion = Occasion(session, ["a"], {}, source.settings(pose=[1, 2, 3, 0, 0, 0]))
capture, files = source.trigger(occasion)
points = parse_profile(files[capture.files[0]], capture.files[0])
export = export_named("acme-matrix")
tool = RigidTransform.of([0, 0, 0], [1, 2, 3], "tool0", "laser")
answer = Answer(session, {}, "tcp", tool, np.eye(6), stale=True)
text = export.write(answer, export.settings(digits=3))
marked = write_export(answer, "acme-matrix", ("stale",))[0].decode()
print(json.dumps({
    "ending": ".acme" in endings_of("profile"), "formats": FORMATS.names(), "points": points[:2].tolist(),
    "id": capture.id, "text": text, "marked": marked,
    "schema": sorted(export.describe()["settings"]["properties"]),
}))
"""


def test_the_example_package_adds_a_format_an_export_and_a_source(tmp_path: Path) -> None:
    source = shutil.copytree(ROOT / "docs" / "examples" / "scancell-example-plugin", tmp_path / "plugin")
    target = tmp_path / "installed"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*pip, "--target", str(target), str(source)], check=True, timeout=120, capture_output=True)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(target)])}
    done = subprocess.run(
        [sys.executable, "-c", USED],
        env=environment,
        cwd=tmp_path,
        timeout=120,
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(done.stdout)
    assert found["ending"]
    assert "acme-profile" in found["formats"]
    assert found["points"] == [[-20.0, 200.0], [-19.9, 200.0]]
    assert found["id"] == "acme-2"
    assert [float(word) for word in found["text"].split()] == [1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1]
    assert found["schema"] == ["digits"]
    assert found["marked"].startswith(
        "# NOT TO BE USED: this answer is stale\n1.0"
    )  # its writer knows of no marks
