"""The tool in the controller compared with the answer: equal, or what differs, in words."""

import math
from typing import Any

import numpy as np
import pytest

from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.robots import CONVENTIONS, to_pose
from calib_core.robots.read_back import read_back, typed_numbers

TOOL = RigidTransform.of([0.3, -1.1, 0.7], [149.6, -709.5, 487.25], "tool0", "laser")
AS_POSE = RigidTransform(TOOL.matrix, "base", "tool0")


def numbers(convention: str, pose: RigidTransform = AS_POSE) -> list[float]:
    return to_pose(convention, pose)


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_the_same_tool_is_equal_as_a_pendant_rounds_it(convention: str) -> None:
    found = read_back([float(f"{v:.7g}") for v in numbers(convention)], convention, TOOL)
    assert found.equal
    assert found.position_mm < 0.01


@pytest.mark.parametrize("convention", ["kuka", "fanuc", "staubli", "kawasaki"])
def test_what_people_mistype_is_told_in_words(convention: str) -> None:
    x, y, z, a, b, c = numbers(convention)
    names = CONVENTIONS[convention].numbers.split()
    radians = [math.radians(v) for v in (a, b, c)]
    for typed, words in (
        ([x, y, z, a, c, b], f"{names[4]} and {names[5]} are swapped"),
        ([y, x, z, a, b, c], f"{names[0]} and {names[1]} are swapped"),
        ([x, y, z, *radians], "Radians taken for degrees"),
        ([x / 1000, y / 1000, z / 1000, a, b, c], "in metres, not in millimetres"),
        ([x, y, z, a, -b, c], f"{names[4]} has the wrong sign"),
        ([x / 1000, y / 1000, z / 1000, *radians], "Radians taken for degrees. The position is in metres"),
        ([x / 1000, y / 1000, z / 1000, b, a, c], f"in metres, not in millimetres. {names[3]} and {names[4]}"),
    ):
        found = read_back(typed, convention, TOOL)
        assert not found.equal
        assert words in found.words


def test_degrees_for_radians_inverse_transposed_and_other_conventions() -> None:
    x, y, z, *turn = numbers("ur")
    assert "Degrees taken for radians" in read_back([x, y, z, *map(math.degrees, turn)], "ur", TOOL).words
    assert "in millimetres, not in metres" in read_back([1000 * x, 1000 * y, 1000 * z, *turn], "ur", TOOL).words
    inverse = RigidTransform(TOOL.inverse().matrix, "base", "tool0")
    assert "inverse" in read_back(numbers("kuka", inverse), "kuka", TOOL).words
    transposed = RigidTransform.of(TOOL.rotation.T, TOOL.translation_mm, "base", "tool0")
    assert "transposed" in read_back(numbers("kuka", transposed), "kuka", TOOL).words
    assert "written as kawasaki" in read_back(numbers("kawasaki"), "kuka", TOOL).words
    q = numbers("abb")
    swapped = read_back([*q[:3], *q[4:], q[3]], "abb", TOOL).words
    assert "another order" in swapped or "quaternion-xyzw" in swapped
    columns = np.array(numbers("matrix")).reshape(4, 4).T.ravel().tolist()
    assert "column by column" in read_back(columns, "matrix", TOOL).words


def test_another_tool_is_told_by_its_distance() -> None:
    x, y, z, a, b, c = numbers("kuka")
    found = read_back([x + 1, y, z, a, b, c], "kuka", TOOL)
    assert found.words.startswith("They are 1.000 mm and 0.0000° apart. What differs: X ")
    with pytest.raises(InputError, match="6 numbers"):
        read_back([1, 2, 3], "kuka", TOOL)
    assert "no pose" in read_back([1, 2, 3, 9, 9, 9, 9], "abb", TOOL).words


@pytest.mark.parametrize(
    "text", ["1,5 -2 3,25 4 5 6", "1,5; -2; 3,25; 4; 5; 6", "1.5, -2, 3.25, 4, 5, 6", "1.5,-2,3.25,4,5,6"]
)
def test_numbers_are_typed_with_points_or_commas(text: str) -> None:
    assert typed_numbers(text, "kuka") == [1.5, -2, 3.25, 4, 5, 6]


@pytest.mark.thorough
def test_the_command_compares_a_file_or_typed_numbers(tmp_path: Any, capsys: Any, solved_folder: Any) -> None:
    from server.cli import main

    folder = str(solved_folder)
    file = tmp_path / "tool.dat"
    assert main(["export", folder, "--format", "kuka", "--tool", "4", "--out", str(file)]) == 0
    assert main(["read-back", folder, str(file)]) == 0
    assert "Equal" in capsys.readouterr().out
    text = file.read_text()
    line = next(row for row in text.splitlines() if row.startswith("TOOL_DATA"))
    values = [part.split()[1] for part in line[line.index("{") + 1 : -1].split(",")]
    values[3], values[4] = values[4], values[3]
    assert main(["read-back", folder, "--convention", "kuka", "--numbers", " ".join(values), "--json"]) == 1
    assert "A and B are swapped" in capsys.readouterr().out
    assert main(["read-back", folder, str(file), "--tool", "9"]) == 2
    assert main(["read-back", folder]) == 2


def test_a_comparison_with_an_answer_that_is_stale_or_failed_says_so() -> None:
    same = read_back(numbers("kuka"), "kuka", TOOL)
    assert same.of_answer(()) == same
    assert same.to_json()["faults"] == []
    stale = same.of_answer(("stale",))
    assert (stale.equal, stale.faults) == (True, ("stale",))
    assert stale.words.startswith("Equal")
    assert "Solve the session again." in stale.words
    both = read_back([*numbers("kuka")[:5], 0.0], "kuka", TOOL).of_answer(("stale", "fail")).to_json()
    assert (both["equal"], both["faults"]) == (False, ["stale", "fail"])
    assert "verdict 'fail'" in both["words"]
