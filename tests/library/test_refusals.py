"""What a program writes wrong is refused as a file or a request is: need, got, what to do."""

from collections.abc import Callable

import numpy as np
import pytest

import calib_core as cc
from calib_core.records import parse_cell

CELL = cc.Cell(pose_convention="fanuc", sphere_diameter_mm=80.0)
SCANS = [np.zeros((50, 2))] * 5
POSES = [[0.0] * 6] * 5


@pytest.mark.parametrize(
    ("write", "said"),
    [
        (lambda: cc.Cell(pose_convention="abb", sphere_diametre_mm=80.0), "Did you mean 'sphere_diameter_mm'"),  # pyright: ignore
        (lambda: cc.Cell(pose_convention="abb", sphere_diameter_mm=-80.0), "need more than 0, got -80"),
        (lambda: cc.Cell(pose_convention="fanuk"), "one of the pose conventions .*'fanuk'"),
        (lambda: cc.Robot(position_sigma=0.05), "Did you mean 'position_sigma_mm'"),  # pyright: ignore
        (lambda: cc.Robot(position_sigma_mm=float("nan")), "finite number, got nan"),
        (
            lambda: cc.make_session({"pose_convention": "abb", "sphere_diametre_mm": 80.0}, {}),
            "Did you mean 'sphere_diameter_mm'",
        ),
        (lambda: cc.calibrate_tcp(CELL, SCANS, [*POSES[:4], [float("nan")] * 6]), "pose 5: need finite numbers"),
        (lambda: cc.calibrate_tcp(CELL, SCANS, POSES[:4]), "need 5 poses, one a scan, got 4"),
    ],
)
def test_a_wrong_argument_is_refused_in_words(write: Callable[[], object], said: str) -> None:
    with pytest.raises(cc.CalibrationError, match=said):
        write()


def test_a_field_of_another_version_is_kept_where_a_file_has_it() -> None:
    cell = parse_cell({"pose_convention": "abb", "of_a_later_version": 1})
    assert cell.unknown_fields() == ["of_a_later_version"]
    assert cc.make_session(cell, {}).cell.to_json()["of_a_later_version"] == 1
