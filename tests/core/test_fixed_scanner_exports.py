"""A scanner that stands still in every brand's own syntax: a user frame of the base, read back by our readers."""

import json
from typing import Any

import numpy as np
import pytest

from calib_core.errors import ConflictError, InputError
from calib_core.exports.answer import answer_of
from calib_core.exports.export import export
from calib_core.exports.writing import NumberedSettings
from calib_core.frames import RigidTransform
from calib_core.review.answer import answer_record
from calib_core.robots import parse_pose
from calib_core.robots.backup import read_controller_files
from tests.core.robot_dialects import AS, CONFIG, DTX, RAPID, UFRAME_CND, VA
from tests.core.test_robot_exports import COVARIANCE, SESSION, TABLE, near, results

FIXED = RigidTransform.of([0.3, -1.1, 0.7], [1300.125, -150.5, 700.25], "base", "laser")
FRAMES = ("kuka", "abb", "fanuc", "ur", "yaskawa", "kawasaki", "staubli", "denso", "epson", "comau")


def fixed(table: bool = False) -> dict[str, Any]:
    told = results()
    told["tcp"] |= {"base_from_laser": FIXED.to_rows(), "sphere_center_in_tool0_mm": [25.0, -40.0, 130.0]}
    del told["tcp"]["tool0_from_laser"], told["tcp"]["sphere_center_in_base_mm"]
    told["turntable"] |= {"base_from_laser": FIXED.to_rows(), "tool0_from_laser": None}
    return told if table else {"tcp": told["tcp"]}


def frames_in(content: bytes, suffix: str, brand: str) -> list[RigidTransform]:
    found = read_controller_files({f"x{suffix}": content}, brand)
    assert list(found.tools) == []
    return [parse_pose(frame.convention, frame.pose) for frame in found.frames]


@pytest.mark.parametrize("brand", FRAMES)
def test_it_is_written_as_a_user_frame_and_read_back(brand: str) -> None:
    content, entry = export(SESSION, fixed(), brand, date="2026-11-24")
    if brand == "ur":  # a variable of a program: readers of programs know no features
        numbers = next(line for line in content.decode().splitlines() if line.startswith("global scanner=p["))
        pose = parse_pose("ur", [float(text) for text in numbers.split("p[")[1].rstrip("]").split(",")])
        near(pose, FIXED, brand)
        return
    (frame,) = frames_in(content, entry.suffix, brand)
    near(frame, FIXED, brand)


@pytest.mark.parametrize("brand", [name for name in FRAMES if name not in ("ur", "comau")])
def test_beside_a_table_each_has_a_frame_of_its_own(brand: str) -> None:
    content, entry = export(SESSION, fixed(table=True), brand)
    scanner, table = frames_in(content, entry.suffix, brand)
    near(scanner, FIXED, brand)
    near(table, TABLE, brand)


@pytest.mark.parametrize(
    ("brand", "backup", "chosen"),
    [
        ("kuka", CONFIG, {"frame": 1}), ("fanuc", VA.replace("MNUTOOL ", "MNUFRAME "), {"frame": 1}),
        ("yaskawa", UFRAME_CND, {"frame": 2}),
        ("kawasaki", AS, {"frame": "t1"}), ("staubli", DTX, {"scanner_frame": "fTable"}),
        ("denso", "Tool 1, P(1,2,3,4,5,6)\nWork 3, P(7,7,7,0,0,0)\n", {"scanner_frame": 3}),
        ("comau", "PROGRAM a NOHOLD\nBEGIN\n  $UFRAME := POS(1,2,3,4,5,6,'')\nEND a\n", {}),
    ],
)  # fmt: skip
def test_a_backup_is_patched_in_its_frame_alone(brand: str, backup: str, chosen: dict[str, Any]) -> None:
    content, _ = export(SESSION, fixed(), brand, settings=chosen, backup=backup.encode())
    before, after = backup.encode().split(b"\n"), content.split(b"\n")
    assert len(before) == len(after)
    assert 1 <= sum(one != other for one, other in zip(before, after, strict=True)) <= 2
    found = read_controller_files({"b": content}, brand)
    placed = [parse_pose(one.convention, one.pose) for one in (*found.frames, *found.tools)]
    closest = min(placed, key=lambda pose: float(np.linalg.norm(pose.translation_mm - FIXED.translation_mm)))
    near(closest, FIXED, "fanuc" if brand == "kawasaki" else brand)


def test_a_work_object_of_a_backup_takes_it() -> None:
    module = RAPID + '\nPERS wobjdata wGate:=[FALSE,TRUE,"",[[1,2,3],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n'
    content, _ = export(SESSION, fixed(), "abb", settings={"frame": "wGate"}, backup=module.encode())
    found = {str(one.number): one for one in read_controller_files({"b.mod": content}, "abb").frames}
    near(parse_pose("abb", found["wGate"].pose), FIXED, "abb")


@pytest.mark.parametrize(
    ("brand", "told", "sentence"),
    [
        (
            "mitsubishi",
            fixed(),
            r"need a scanner on the flange, got one that stands still. Set the work coordinate",
        ),
        ("comau", fixed(table=True), r"one \$UFRAME, for the scanner or for the turntable"),
        ("ur-check-move", fixed(), r"need a scanner on the flange"),
    ],
)
def test_what_a_brand_has_no_syntax_for_is_refused(brand: str, told: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ConflictError, match=sentence):
        export(SESSION, told, brand)


@pytest.mark.parametrize("name", ["csv", "urdf", "ros2-yaml", "ros2-launch", "moveit", "opencv"])
def test_formats_of_no_brand_have_it_in_base(name: str) -> None:
    text = export(SESSION, fixed(), name)[0].decode()
    assert "tool0_from_laser" not in text
    assert "base" in text
    assert ("eye_to_hand" in text) == (name == "moveit")
    told = json.loads(export(SESSION, fixed(), "json")[0])
    assert np.allclose(told["base_from_laser"], FIXED.matrix)
    assert "tool0_from_laser" not in told


def test_of_several_scanners_one_is_chosen_and_all_are_frames() -> None:
    told = results()
    left, gate = results()["tcp"]["tool0_from_laser"], FIXED.to_rows()
    told["tcp"]["frames"] = [
        {"into": "tool0", "outof": "laser", "scanner": "left", "matrix": left, "covariance": COVARIANCE},
        {"into": "base", "outof": "laser", "scanner": "gate", "matrix": gate, "covariance": COVARIANCE},
        {"into": "base", "outof": "tilt", "scanner": None, "matrix": TABLE.to_rows(), "covariance": None},
    ]
    content, entry = export(SESSION, {"tcp": told["tcp"]}, "kuka", settings={"of_scanner": "gate"})
    (frame,) = frames_in(content, entry.suffix, "kuka")
    near(frame, FIXED, "kuka")
    rows = export(SESSION, {"tcp": told["tcp"]}, "csv")[0].decode().splitlines()
    assert [line.split(",")[:2] for line in rows if line.startswith(("base", "tool0"))] == [
        ["tool0", "laser_left"], ["base", "laser_gate"], ["base", "tilt"],
    ]  # fmt: skip
    with pytest.raises(InputError, match=r"a scanner that was solved, got 'right'. Name one of these: left, gate"):
        export(SESSION, {"tcp": told["tcp"]}, "kuka", settings={"of_scanner": "right"})


@pytest.mark.parametrize(
    ("brand", "backup"),
    [
        ("kuka", CONFIG), ("denso", "Tool 1, P(1,2,3,4,5,6)\n"), ("ur", "set_tcp(p[0.1,0.2,0.3,0,0,0])\n"),
        ("comau", "PROGRAM a NOHOLD\nBEGIN\n  $TOOL := POS(1,2,3,4,5,6,'')\nEND a\n"),
        ("mitsubishi", "10 Tool (1,2,3,4,5,6)\n"),
    ],
)  # fmt: skip
def test_a_backups_one_tool_is_that_of_a_named_scanner(brand: str, backup: str) -> None:
    told = results()["tcp"]
    other = RigidTransform.of([0.3, -1.1, 0.7], [30.0, -150.0, 70.0], "tool0", "laser")
    told["frames"] = [
        {"into": "tool0", "outof": "laser", "scanner": name, "matrix": matrix, "covariance": COVARIANCE}
        for name, matrix in (("left", told["tool0_from_laser"]), ("right", other.to_rows()))
    ]
    with pytest.raises(ConflictError, match="the name of one scanner in `of_scanner`"):
        export(SESSION, {"tcp": told}, brand, backup=backup.encode())
    chosen = {"of_scanner": "right"}
    content, _ = export(SESSION, {"tcp": told}, brand, settings=chosen, backup=backup.encode())
    tools = read_controller_files({"b.script" if brand == "ur" else "b": content}, brand).tools
    found = [parse_pose(one.convention, one.pose) for one in tools]
    near(
        min(found, key=lambda one: float(np.linalg.norm(one.translation_mm - other.translation_mm))), other, brand
    )


def test_scanners_are_told_by_the_stage_that_answers_whatever_was_solved_first() -> None:
    shown = [results()["tcp"], results()["tcp"]]
    for result, right in zip(shown, (FIXED, TABLE), strict=True):
        frames = [("left", "tool0", result["tool0_from_laser"]), ("right", "base", right.to_rows())]
        result["frames"] = [
            {"into": into, "outof": "laser", "scanner": name, "matrix": matrix, "covariance": COVARIANCE}
            for name, into, matrix in frames
        ]
    chain = {
        **results()["turntable"],
        **shown[1],
        "stage": "chain",
        "turntable_covariance": COVARIANCE,
        "cross_covariance": COVARIANCE,
    }
    both = {"tcp": shown[0], "chain": chain}
    content, entry = export(SESSION, both, "kuka", settings={"of_scanner": "right"})
    near(frames_in(content, entry.suffix, "kuka")[0], TABLE, "kuka")
    cell = SESSION.cell.model_copy(update={"scanners": {"left": {}, "right": {"on": "base"}}})
    told = answer_record(answer_of(SESSION.model_copy(update={"cell": cell}), both)).to_json()
    assert [frame["matrix"] for frame in told["frames"]] == [frame["matrix"] for frame in chain["frames"]]


def test_each_of_several_scanners_that_stand_still_has_a_user_frame_of_its_own() -> None:
    settings = NumberedSettings(frame=3)
    numbers = [settings.of_one(k, name).of_fixed_scanner(1 + k).frame for k, name in enumerate(("left", "right"))]
    assert numbers == [4, 5]
    told = settings.model_copy(update={"scanner_frame": 7})
    assert [told.of_one(k, "x").of_fixed_scanner(1 + k).frame for k in (0, 1)] == [7, 8]
