"""What is found of a table's angles: lost steps, factors, and the direction in which they count."""

import numpy as np
import pytest

from calib_core.causes.table import _lost_steps, _refined, _simple, angles_of, direction_findings, read_anew
from calib_core.chain.observations import SphereObservation, TableObservation
from calib_core.chain.table_frame import TableFrame
from calib_core.frames import RigidTransform
from calib_core.records import Capture, Cell
from calib_core.records.causes import TableReading

ANGLES_RAD = np.deg2rad(np.arange(0.0, 360.0, 40.0))
POSE = RigidTransform.of(np.eye(3), np.zeros(3), "base", "tool0")


def told() -> list[TableObservation]:
    empty = np.empty((0, 3))
    return [
        TableObservation(SphereObservation(f"p{k}", POSE, "center", empty, np.zeros(3), np.eye(3)), angle, "low")
        for k, angle in enumerate(ANGLES_RAD.tolist())
    ]


@pytest.mark.parametrize(("lost_deg", "said_deg"), [(10.1, 10.0), (-10.1, -10.0), (10.4, 10.4)])
def test_steps_that_a_table_lost_are_whole_degrees_where_they_nearly_are(lost_deg: float, said_deg: float) -> None:
    found = ANGLES_RAD + np.deg2rad(np.where(np.arange(9) >= 5, lost_deg, 0.0))
    ((reading, kind),) = _lost_steps(told(), found)
    assert (reading.since, kind) == ("p5", "step")
    assert reading.offset_deg == pytest.approx(said_deg)


@pytest.mark.parametrize("factor", [0.95, 1.07, 0.9 * 1.05])
def test_a_factor_of_the_angles_is_found_about_a_rough_one(factor: float) -> None:
    rough = 0.9 if factor < 0.96 else 1.0
    everything = [np.arange(9)]
    assert _refined(rough, ANGLES_RAD, factor * ANGLES_RAD + 0.7, everything) == pytest.approx(factor, abs=3e-4)


@pytest.mark.parametrize(
    "reading",
    [
        TableReading(factor=0.9),
        TableReading(offset_deg=12.5, since="p4"),
        TableReading(offset_deg=-3.0, since="p0"),
    ],
)
def test_angles_that_are_handed_back_are_those_that_fitted(reading: TableReading) -> None:
    pose = [0.0] * 6
    captures = [
        Capture.model_validate(
            {"id": o.sphere.capture, "step": "turntable", "kind": "profile", "files": ["a.csv"], "pose": pose}
            | {"table_deg": float(np.rad2deg(o.angle_rad))}
        )
        for o in told()
    ]
    patches = angles_of(reading, captures).captures
    now = [patches.get(capture.id, {}).get("table_deg", capture.table_deg) for capture in captures]
    np.testing.assert_allclose(now, np.rad2deg([o.angle_rad for o in read_anew(told(), reading)]), atol=1e-6)
    first = 4 if reading.since == "p4" else 0
    np.testing.assert_allclose(
        now, np.rad2deg(reading.factor * ANGLES_RAD) + np.where(np.arange(9) >= first, reading.offset_deg, 0.0)
    )


@pytest.mark.parametrize("ratio", [(1, 1), (2, 1), (1, 2), (9, 10), (7, 60), (3, 2), (40, 3)])
def test_a_factor_is_a_simple_fraction_where_it_nearly_is(ratio: tuple[int, int]) -> None:
    exact = ratio[0] / ratio[1]
    assert [_simple(sign * exact * off) for sign in (1, -1) for off in (0.999, 1.0, 1.001)] == [exact] * 6


@pytest.mark.parametrize(("direction", "counts"), [(1, "right"), (-1, "left")])
def test_a_direction_that_is_told_wrongly_is_said_with_the_right_hand(direction: int, counts: str) -> None:
    frame = TableFrame(RigidTransform.of(np.eye(3), np.zeros(3), "base", "turntable"), direction, np.zeros((1, 3)))

    def cell(told: int) -> Cell:
        return Cell.model_validate(
            {"pose_convention": "fanuc", "sphere_diameter_mm": 50.0, "turntable": {"direction": told}}
        )

    assert direction_findings(cell(direction), frame) == []
    (found,) = direction_findings(cell(-direction), frame)
    assert found.values["counts"] == counts
    assert found.values["direction"] == direction
