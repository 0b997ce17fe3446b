"""A simulated capture taken again: the same pose and sphere, errors of its own."""

import numpy as np
import pytest

from calib_core.errors import ConflictError
from calib_core.simulation import retake, simulate
from calib_core.sphere.arc import fit_arc
from tests.core.test_simulation import read_profile


def arc_of(content: bytes, diameter_mm: float):
    return fit_arc(read_profile(content), diameter_mm)


def test_it_sees_the_sphere_where_it_stood_with_new_errors():
    simulated = simulate("tcp", 3)
    sigmas = simulated.truth["sigmas"]
    first = simulated.session.captures[4]
    before = arc_of(simulated.files[first.files[0]], simulated.truth["sphere_diameter_mm"])
    moved = []
    for seed in range(20):
        record, files = retake(simulated, first.id, "p05-again", seed)
        assert (record.id, record.pose, record.files) == ("p05-again", first.pose, ["captures/p05-again.csv"])
        after = arc_of(files[record.files[0]], simulated.truth["sphere_diameter_mm"])
        moved.append(after.center_mm - before.center_mm)
    moved = np.array(moved)
    # The arm's error at the sphere: its position, and its orientation on a lever of about 0.4 m; both times.
    lever_mm = 400.0
    sigma_mm = np.hypot(sigmas["position_sigma_mm"], lever_mm * sigmas["orientation_sigma_rad"])
    spread = np.sqrt(np.mean(np.var(moved, axis=0)))
    assert sigmas["position_sigma_mm"] / 2 < spread < 2 * sigma_mm
    assert np.abs(moved).max() < 5 * np.sqrt(2) * sigma_mm


def test_the_same_seed_takes_the_same_and_another_seed_another():
    simulated = simulate("turntable", 1)
    one, again, other = (retake(simulated, "t03", "t03-again", seed) for seed in (5, 5, 6))
    assert one == again
    assert one[0] == other[0]
    assert one[1] != other[1]
    first = next(capture for capture in simulated.session.captures if capture.id == "t03")
    assert (one[0].table_deg, one[0].mount, one[0].step) == (first.table_deg, first.mount, "turntable")


def test_what_had_spoiled_a_capture_is_gone():
    simulated = simulate("tcp-moved-sphere", 7)
    (spoiled,) = simulated.truth["spoiled"]
    diameter_mm = simulated.truth["sphere_diameter_mm"]
    first = arc_of(simulated.files[f"captures/{spoiled}.csv"], diameter_mm)
    one, other = (
        arc_of(retake(simulated, spoiled, "again", seed)[1]["captures/again.csv"], diameter_mm) for seed in (1, 2)
    )
    apart_mm = np.linalg.norm(one.center_mm - other.center_mm)
    assert np.linalg.norm(one.center_mm - first.center_mm) > 3 * apart_mm


def test_what_is_no_capture_of_the_sphere_cannot_be_taken_again():
    with pytest.raises(ConflictError, match="Delete it"):
        retake(simulate("tcp", 1), "p99", "p99-again", 1)
    with pytest.raises(ConflictError, match="Delete it"):
        retake(simulate("tcp-sweep", 1), "s01", "s01-again", 1)
