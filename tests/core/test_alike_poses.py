"""Many captures of nearly one pose agree with whatever answer: they count as one when a start is looked for."""

import numpy as np

from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult
from tests.trouble import all_troubles, troubled


def test_half_of_the_poses_alike_lead_to_no_far_answer() -> None:
    cell = troubled(all_troubles()["books: half of 14 poses alike"], 13)
    result = solve_stage(cell.session, "tcp", cell.files.__getitem__)
    assert isinstance(result, TcpResult)
    off = np.array(result.tool0_from_laser)[:3, 3] - cell.tool0_from_laser[:3, 3]
    assert np.linalg.norm(off) < 1.0  # 373 mm, with "swapped poses" as its cause, before
    assert result.causes == []
