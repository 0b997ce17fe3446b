"""A planned set as each brand's program: read back, it goes to the planned poses from well outside."""

import io
import re
import zipfile

import numpy as np
import pytest

from calib_core.errors import ConflictError, InputError
from calib_core.exports.planned_program import planned_program, program_brands
from calib_core.guidance.pose_list import PoseList, PoseOfSet
from calib_core.records import Session
from calib_core.robots import parse_pose, to_pose
from calib_core.robots.backup import read_controller_files
from calib_core.simulation import simulate


@pytest.fixture(scope="module")
def planned() -> tuple[Session, PoseList]:
    session = simulate("tcp", 1).session
    poses: list[PoseOfSet] = []
    for number, capture in enumerate(session.captures[:3]):
        target = parse_pose(session.cell.pose_convention, capture.pose or [])
        outside = target.to_rows()
        outside[2][3] += 150.0
        numbers = to_pose(session.cell.pose_convention, type(target).from_rounded(outside, "base", "tool0"))
        poses.append(
            PoseOfSet(
                base_from_tool0=target.to_rows(),
                numbers=capture.pose or [],
                approach_numbers=numbers,
                uncertainty_mm=0.5,
                table_deg=45.0 if number == 2 else None,
            )
        )
    convention = session.cell.pose_convention
    return session, PoseList(pose_convention=convention, speed_mm_s=50.0, poses=poses, note="")


@pytest.mark.parametrize("brand", program_brands())
def test_read_back_it_goes_to_the_planned_poses(brand: str, planned: tuple[Session, PoseList]) -> None:
    session, plan = planned
    program = planned_program(session, plan, brand)
    found = read_controller_files({program.name: program.content}, brand)
    tolerance = {"fanuc": 2e-3, "yaskawa": 2e-3}.get(brand, 1e-4)
    gone_to = [parse_pose(pose.convention, pose.pose).matrix for pose in found.poses if pose.pose]
    assert len(gone_to) == len(found.poses) >= 6
    for pose in plan.poses:
        target = np.array(pose.base_from_tool0)
        outside = target + np.array([[0] * 4, [0] * 4, [0, 0, 0, 150.0], [0] * 4])
        for wanted in (target, outside):
            apart = min(float(np.abs(one - wanted).max()) for one in gone_to)
            assert apart < tolerance, (brand, apart)
    content = program.content
    if program.name.endswith(".zip"):
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            content = b"\n".join(archive.read(file) for file in archive.namelist())
    text = content.decode("ascii")
    said = " ".join(re.sub(r"[!;'\r\n]|\d+:", " ", text).split())
    assert "reduced speed" in said
    assert "table at 45.0 deg" in said
    stops = r"\bHALT\b|\bStop;|\bPAUSE\b|\bpopup\(|\bHlt\b|\bHold \"|\bget\(\)"
    assert len(re.findall(stops, text, re.IGNORECASE)) == 9  # nothing moves that the operator has not started


def test_refused_where_nobody_should_move_by_it(planned: tuple[Session, PoseList]) -> None:
    session, plan = planned
    unsure = [pose.model_copy(update={"approach_numbers": None}) for pose in plan.poses]
    with pytest.raises(ConflictError, match="10 mm"):
        planned_program(session, plan.model_copy(update={"poses": unsure}), "kuka")
    with pytest.raises(InputError, match="brand: need one of"):
        planned_program(session, plan, "acme")
