"""The turntable's solver: against truth, against its own covariance, against derivatives."""

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.chain.circles import paper_axis
from calib_core.chain.table import TableReadings, TableState
from calib_core.chain.table_frame import frame_by_rule, frame_covariance
from calib_core.frames import RigidTransform, rotation_from_vector
from calib_core.records import parse_session
from calib_core.simulation import TABLE_SCENARIOS, simulate
from calib_core.stages.pipeline import run
from tests.chain_bound import chain_bound

_CHI2_5_RARE = 20.5  # 99.9 %


@lru_cache
def simulated(name, seed=3):
    return simulate(name, seed)


@lru_cache
def solved(name, seed=3):
    cell = simulated(name, seed)
    return run(cell.session, cell.files.__getitem__, "turntable")["turntable"]


def squared_error(result, truth):
    """The error of base_from_turntable in standard deviations; T's rotation about z follows from the tilts."""
    found = RigidTransform.from_rounded(result.base_from_turntable, "base", "turntable")
    true = RigidTransform.from_rounded(truth["base_from_turntable"], "base", "turntable")
    free = [0, 1, 3, 4, 5]
    xi = found.difference(true)[free]
    return float(xi @ np.linalg.solve(np.array(result.covariance)[np.ix_(free, free)], xi))


def axis_error_deg(result, truth):
    return float(
        np.rad2deg(np.linalg.norm(np.cross(result.axis_direction_in_base, truth["axis_direction_in_base"])))
    )


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(
    "name",
    [
        "turntable",
        "turntable-unknown-sigmas",
        "turntable-one-height",
        "turntable-partial",
        "turntable-reversed",
        "turntable-clouds",
        "turntable-centers",
    ],
)
def test_the_truth_lies_within_the_stated_uncertainty(name):
    result, truth = solved(name), simulated(name).truth
    assert squared_error(result, truth) < _CHI2_5_RARE
    assert axis_error_deg(result, truth) < 3.5 * result.axis_direction_sigma_deg
    assert result.direction == truth["direction"]
    for mount in result.mounts:
        true = np.array(truth["mounts_in_turntable_mm"][mount.mount])
        assert np.linalg.norm(np.array(mount.center_in_turntable_mm) - true) < 0.6
    assert sum(row.used for row in result.residuals) >= len(result.residuals) - 1


def test_an_area_scanner_without_errors_is_found_to_have_none_and_passes():
    """A point's own noise in the shape of its error made the sphere 0.1 mm larger and moved the tool 7 mm."""
    cell = simulated("turntable-clouds")
    assert {capture.kind for capture in cell.session.captures} == {"cloud"}
    results = run(cell.session, cell.files.__getitem__, "chain")
    assert results["chain"].verdict == solved("turntable-clouds").verdict == "pass"
    scanner = run(cell.session, cell.files.__getitem__, "tcp")["tcp"].scanner
    assert np.abs(np.array(scanner.values) / scanner.sigmas).max() < 4


def test_stated_uncertainty_is_near_the_bound():
    bound = np.rad2deg(np.sqrt(np.trace(chain_bound(simulated("turntable")).axis_direction)))
    # The tool is held: a little is lost against all captures together, nothing can be gained.
    assert bound * 0.98 < solved("turntable").axis_direction_sigma_deg < 1.35 * bound


def test_one_height_says_where_the_axis_is_weak():
    result = solved("turntable-one-height")
    assert result.verdict == "warn"
    assert result.warnings[0].startswith("One height only")
    two = solved("turntable").axis_direction_sigma_deg
    assert result.axis_direction_sigma_deg > 1.5 * two


def test_residuals_are_of_the_size_of_the_noise_and_have_their_angle():
    result = solved("turntable")
    assert result.angle_rms_deg == pytest.approx(np.rad2deg(0.12 / 90), rel=0.7)
    assert result.radial_rms_mm < 0.5
    for row, capture in zip(
        result.residuals,
        [c for c in simulated("turntable").session.captures if c.table_deg is not None],
        strict=True,
    ):
        assert row.capture == capture.id
        assert row.table_deg == pytest.approx(capture.table_deg)
        parts = np.array([row.radial_mm, row.tangential_mm, row.axial_mm])
        assert np.linalg.norm(parts) == pytest.approx(row.center_distance_mm, rel=1e-9)
        assert np.deg2rad(row.angle_deg) * 90 == pytest.approx(row.tangential_mm, rel=0.02, abs=1e-4)


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(
    "name", ["turntable", "turntable-one-height", "turntable-partial", "turntable-centers", "turntable-reversed"]
)
def test_angles_that_nobody_read_are_found_and_what_is_weak_is_said(name):
    cell = simulated(name)
    data = cell.session.to_json()
    for capture in data["captures"]:
        capture.pop("table_deg", None)
    direction = cell.truth["direction"]
    data["cell"]["turntable"] = {"angles": "unknown", "direction": direction}
    results = run(parse_session(data), cell.files.__getitem__)
    for stage in ("turntable", "chain"):
        result = results[stage]
        assert (result.verdict, result.direction) == ("warn", direction)
        assert any("were not read" in w and "weakest towards" in w for w in result.warnings)
        rows = result.covariance if stage == "turntable" else result.turntable_covariance
        assert squared_error(result.model_copy(update={"covariance": rows}), cell.truth) < _CHI2_5_RARE
        # Without angles less is known than with them.
        assert result.axis_direction_sigma_deg > 0.95 * solved(name).axis_direction_sigma_deg
        assert all(row.used for row in result.residuals)
    read = {c.id: c.table_deg for c in cell.session.captures if c.mount == "low"}
    found = {row.capture: row.table_deg for row in results["turntable"].residuals}
    first = next(iter(read))
    for capture, degrees in read.items():  # 1° is 1.6 mm along the circle
        assert abs((found[capture] - (degrees - read[first]) + 180) % 360 - 180) < 1.0


@pytest.mark.thorough
def test_wobble_is_told():
    assert solved("turntable-wobble").verdict == "warn"


def with_encoder(encoder, stage):
    cell = simulated("turntable-encoder-scale")
    data = cell.session.to_json()
    if encoder is not None:
        data["cell"].setdefault("turntable", {})["encoder"] = encoder
    return run(parse_session(data), cell.files.__getitem__, stage)[stage], cell.truth


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("stage", ["turntable", "chain"])
@pytest.mark.parametrize("encoder", [None, "scale", "exact"])
def test_an_encoder_that_counts_wrongly_is_told_and_costs_no_capture(encoder, stage):
    result, truth = with_encoder(encoder, stage)
    found = result.encoder_scale
    assert found.error == pytest.approx(1 / truth["encoder_scale"] - 1, abs=4 * found.sigma)
    assert found.applied == (encoder != "exact")
    assert all(row.used for row in result.residuals)
    told = [warning for warning in result.warnings if "more than its angles say" in warning]
    assert len(told) == (encoder != "scale")
    if found.applied:
        covariance = np.array(result.covariance if stage == "turntable" else result.turntable_covariance)
        assert squared_error(result.model_copy(update={"covariance": covariance.tolist()}), truth) < _CHI2_5_RARE


def test_a_known_tool_needs_no_tcp_captures():
    cell = simulated("turntable")
    data = cell.session.to_json()
    data["cell"]["known"] = {"tool0_from_laser": cell.truth["tool0_from_laser"]}
    data["captures"] = [c for c in data["captures"] if c["step"] == "turntable"]
    results = run(parse_session(data), cell.files.__getitem__)
    assert list(results) == ["turntable"]
    assert squared_error(results["turntable"], cell.truth) < _CHI2_5_RARE


def test_all_scenarios_are_simulated_by_seed_alone():
    for name in TABLE_SCENARIOS:
        again = simulate(name, 3)
        assert again.session == simulated(name).session
        assert again.files == simulated(name).files


def tables():
    numbers = st.floats(-1.0, 1.0)
    return st.tuples(st.lists(numbers, min_size=20, max_size=20), st.integers(1, 3))


def table_of(values, mounts):
    places = 60 * np.resize(values[6:], (mounts, 3)) + [90.0, 20.0, 5.0]
    return TableState(rotation_from_vector(values[:3]), 500 * np.array(values[3:6]), places, 1 + 0.01 * values[6])


@given(tables())
@settings(max_examples=30, deadline=None)
def test_the_frame_by_rule_puts_every_sphere_where_the_state_does(drawn):
    values, mounts = drawn
    state = table_of(values, mounts)
    angles = np.linspace(-2, 3, mounts)
    readings = TableReadings(angles, np.arange(mounts), mounts)
    frame = frame_by_rule(state)
    for mount, angle in enumerate(angles):
        turned = rotation_from_vector([0, 0, frame.direction * state.scale * angle]) @ frame.mounts_mm[mount]
        where = frame.base_from_turntable.apply(turned)
        assert where == pytest.approx(state.centers(readings)[mount], abs=1e-8)
    assert frame.mounts_mm[0, 2] == pytest.approx(0, abs=1e-9)
    assert (
        frame.base_from_turntable.rotation[1, 0]
        == pytest.approx(-frame.axis[0] * frame.axis[1] / np.sqrt(1 - frame.axis[0] ** 2), abs=1e-9)
        or abs(frame.axis[0]) > 0.9
    )
    covariance = frame_covariance(state, np.diag(np.full(5 + 3 * mounts, 1e-6)))
    assert np.linalg.matrix_rank(covariance.pose, tol=1e-12) <= 5


def test_the_papers_way_finds_clean_circles():
    table = RigidTransform.of([0.02, -0.03, 0.4], [900.0, -200.0, 300.0], "base", "turntable")
    angle = np.deg2rad([0, 40, 95, 170, 250, 310])
    ring = np.column_stack([90 * np.cos(angle), 90 * np.sin(angle), np.zeros(6)])
    centers = table.apply(np.concatenate([ring, ring + np.array([0, 0, 160.0])]))
    found = paper_axis(centers, np.repeat([0, 1], 6), np.ones(12, dtype=bool))
    assert found.direction == pytest.approx(table.rotation[:, 2], abs=1e-9)
    assert found.point == pytest.approx(table.translation_mm, abs=1e-7)
    assert [circle.radius_mm for circle in found.circles] == pytest.approx([90.0, 90.0], abs=1e-7)
