"""Units that files state: inches are converted or refused, never read as millimetres; what is assumed is said."""

import numpy as np
import pytest

from calib_core.errors import InputError
from calib_core.exports.answer import answer_of
from calib_core.exports.backups import write_into
from calib_core.robots.backup import read_controller_files
from tests.core.robot_dialects import DTX, DTX_6, LS, VA
from tests.core.test_robot_exports import SESSION, results

_PJX = '<Project xmlns="ProjectNameSpace"><Parameters version="s7.5.3" millimeterUnit="{}"/></Project>'
_IN_FLANGE_MM = np.array([-5.972, 209.431, 55.323])


def pjx(is_mm: bool) -> bytes:
    return _PJX.format("true" if is_mm else "false").encode()


@pytest.mark.parametrize("data", [DTX, DTX_6], ids=["version 7", "version 6"])
@pytest.mark.parametrize("named", ["app/app", "app/other"])
def test_val3_lengths_are_read_in_the_unit_of_the_project_beside_them(data: str, named: str) -> None:
    both = {"app/app.dtx": data.encode()}
    in_mm = read_controller_files(both | {f"{named}.pjx": pjx(True)})
    inches = read_controller_files(both | {f"{named}.pjx": pjx(False)})
    assert not in_mm.notes
    np.testing.assert_allclose(in_mm.tools[0].pose, [*_IN_FLANGE_MM, 0, 0, 90])
    np.testing.assert_allclose(inches.tools[0].pose, [*25.4 * _IN_FLANGE_MM, 0, 0, 90])
    placed, in_inches = (next(p.pose for p in f.poses if p.name == "pA[0]") for f in (in_mm, inches))
    assert placed
    np.testing.assert_allclose(in_inches, [*25.4 * np.array(placed[:3]), *placed[3:]])
    assert "inches" in inches.notes[0]


def test_val3_data_without_their_project_say_what_was_assumed() -> None:
    alone = read_controller_files({"app.dtx": DTX.encode(), "other/app.pjx": pjx(False)})
    np.testing.assert_allclose(alone.tools[0].pose[:3], _IN_FLANGE_MM)
    assert "millimetres are taken" in alone.notes[0]


def test_val3_projects_that_contradict_each_other_are_asked_about() -> None:
    files = {"b.dtx": DTX.encode(), "a.pjx": pjx(True), "c.pjx": pjx(False)}
    with pytest.raises(InputError, match="one unit"):
        read_controller_files(files)
    own = read_controller_files(files | {"b.pjx": pjx(False)})
    np.testing.assert_allclose(own.tools[0].pose[:3], 25.4 * _IN_FLANGE_MM)


def test_no_tool_is_put_into_an_application_in_inches() -> None:
    answer = answer_of(SESSION, results())
    backup = {"app.dtx": DTX.encode(), "app.pjx": pjx(False)}
    with pytest.raises(InputError, match="application in millimetres"):
        write_into(backup, answer, "staubli", settings={"tool": "tTool[0]"})
    name, written = write_into(backup | {"app.pjx": pjx(True)}, answer, "staubli", settings={"tool": "tTool[0]"})
    assert name == "app.dtx"
    assert written != DTX.encode()


@pytest.mark.parametrize("unit", ["in", "inch", "cm", "m"])
@pytest.mark.parametrize(("name", "data", "at"), [("a.ls", LS, "mm"), ("sysframe.va", VA, " 150.000")])
def test_fanuc_lengths_in_another_unit_are_refused_aloud(name: str, data: str, at: str, unit: str) -> None:
    altered = data.replace(at, f"{unit}" if at == "mm" else f"{at} {unit}")
    before, found = (read_controller_files({name: text.encode()}) for text in (data, altered))
    assert len(found.poses) + len(found.tools) < len(before.poses) + len(before.tools)
    assert any(f"'{unit}'" in row.reason for row in found.skipped)


@pytest.mark.parametrize(
    ("unit", "mm"),
    [("_mm", 1), (" [m]", 1000), ("_in", 25.4), (" (inch)", 25.4), ("_cm", 10), ("_µm", 0.001)],
)
def test_a_table_is_read_in_the_unit_of_its_header(unit: str, mm: float) -> None:
    head = ",".join([f"{axis}{unit}" for axis in "xyz"] + ["qx", "qy", "qz", "qw"])
    rows = "".join(f"{v / mm:.9g},{300 / mm:.9g},{500 / mm:.9g},0,0,0,1\n" for v in (100, 200))
    found = read_controller_files({"poses.csv": f"{head}\n{rows}".encode()}, "table")
    np.testing.assert_allclose([p.pose[:3] for p in found.poses if p.pose], [[100, 300, 500], [200, 300, 500]])


def test_a_table_in_a_unit_that_is_not_known_is_asked_for() -> None:
    with pytest.raises(InputError, match="one unit"):
        read_controller_files({"poses.csv": b"x_ft,y_ft,z_ft,qx,qy,qz,qw\n1,2,3,0,0,0,1\n"}, "table")
