"""Exports of a cell with several scanners: each is read back as itself, and a check move is of one of them."""

import json
from functools import cache

import numpy as np
import pytest

import calib_core as cc
from calib_core.errors import ConflictError
from calib_core.exports.answer import Answer, answer_of
from calib_core.exports.export import write_export
from calib_core.poses.numbers import parse_pose
from calib_core.review.in_controller import compared_with
from calib_core.robots.backup import read_controller_files


@cache
def solved(name: str) -> Answer:
    opened, _ = cc.simulate(name, 1)
    results = {stage: result.to_json() for stage, result in opened.run().items()}
    return answer_of(opened.record, results, ())


@pytest.mark.thorough
@pytest.mark.parametrize("brand", ["abb", "fanuc", "kuka", "ur", "staubli"])
def test_each_tool_and_user_frame_is_read_back_as_its_own(brand: str) -> None:
    answer = solved("scanners-on-flange-and-base")
    content, entry = write_export(answer, brand)
    files = {f"x{entry.suffix}": content}
    tool = compared_with(answer, files=files, brand=brand)
    assert tool.equal
    assert str(tool.words).startswith("tool0_from_laser:arm: ")
    read = read_controller_files(files, brand)
    name = str(read.frames[0].number) if read.frames else next(one.name for one in read.poses)
    gate = compared_with(answer, files=files, brand=brand, named=name)
    if not (read.tools and str(read.tools[0].number) == name):  # a number of both is the tool's
        assert gate.equal
        assert str(gate.words).startswith("base_from_laser:gate: ")


def test_numbers_are_held_against_the_nearest_scanner() -> None:
    answer = solved("two-scanners-in-turn")
    for name, (mount, _) in answer.scanners().items():
        rows = [value for row in mount.to_rows() for value in row]
        found = compared_with(answer, numbers=rows, convention="matrix")
        assert (found.equal, str(found.words).split(": ")[0]) == (True, f"tool0_from_laser:{name}")
        moved = [*rows[:3], rows[3] + 1.0, *rows[4:]]
        assert not compared_with(answer, numbers=moved, convention="matrix").equal


def test_a_check_move_is_of_the_one_scanner_on_the_flange() -> None:
    answer = solved("scanners-on-flange-and-base")
    told = json.loads(write_export(answer, "check-move")[0])
    own = {capture.id for capture in answer.session.captures if capture.scanner == "arm"}
    assert {target["capture"] for target in told["targets"]} <= own
    ball = next(one for one in answer.results["tcp"]["spheres"] if one["in"] == "base")
    assert told["sphere_center_in_base_mm"] == pytest.approx(ball["center_mm"])


def test_of_two_on_the_flange_a_check_move_asks_which() -> None:
    answer = solved("two-scanners-in-turn")
    with pytest.raises(ConflictError, match="of_scanner"):
        write_export(answer, "check-move")
    told = json.loads(write_export(answer, "check-move", settings={"of_scanner": "right"})[0])
    by_id = {capture.id: capture for capture in answer.session.captures}
    mount = answer.scanners()["right"][0]
    convention = answer.session.cell.pose_convention
    for target in told["targets"]:
        capture = by_id[target["capture"]]
        assert capture.scanner == "right"
        flange = parse_pose(convention, capture.pose or [])
        laser = parse_pose(convention, target["target"]["scanner"])
        assert np.allclose(laser.rotation, (flange @ mount).rotation, atol=1e-6)


@pytest.mark.thorough
def test_each_axis_of_a_positioner_is_read_back_as_its_own() -> None:
    answer = solved("positioner")
    content, entry = write_export(answer, "abb")
    files = {f"x{entry.suffix}": content}
    names = [str(one.number) for one in read_controller_files(files, "abb").frames]
    told = [compared_with(answer, files=files, brand="abb", named=name) for name in names]
    assert [one.equal for one in told] == [True, True]
    assert {str(one.words).split(": ")[0] for one in told} == {"base_from_turntable", "base_from_tilt"}
