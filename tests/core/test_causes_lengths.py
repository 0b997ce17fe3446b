"""Root causes: lengths, the sphere's diameter and the table's angles told wrongly are named, and Apply repairs."""

from dataclasses import replace

import numpy as np
import pytest
from wrong_lengths import ANGLES, scaled_files, told_angles

from calib_core.captures.content import sphere_of
from calib_core.captures.observe import observe_capture
from calib_core.causes.apply import applied, changes_for
from calib_core.causes.scales import SeenArcs, scale_causes
from calib_core.causes.session import session_causes
from calib_core.causes.table import table_causes
from calib_core.chain.observations import SphereObservation, SphereSize, TableObservation
from calib_core.findings import causes_of
from calib_core.frames import RigidTransform
from calib_core.records import RootCause, Session
from calib_core.simulation import SimulatedSession, simulate
from calib_core.sphere.arc import fit_arc
from calib_core.stages.pipeline import run, solve_stage
from calib_core.stages.turntable.verdict import angles_that_do_not_fit
from tests.every_code.turntable import whole
from tests.trouble import all_troubles, troubled


@pytest.fixture(scope="module")
def still() -> SimulatedSession:
    return simulate("tcp", 11)


@pytest.fixture(scope="module")
def table() -> SimulatedSession:
    return simulate("turntable", 5)


@pytest.fixture(scope="module")
def spheres(table: SimulatedSession) -> dict[str, SphereObservation]:
    turned = [c for c in table.session.captures if c.step == "turntable"]
    return {c.id: observe_capture(table.session, c, table.files.__getitem__) for c in turned}


def causes_of_table(
    session: Session, table: SimulatedSession, spheres: dict[str, SphereObservation]
) -> list[RootCause]:
    tool = RigidTransform(np.array(table.truth["tool0_from_laser"]), "tool0", "laser")
    turned = [c for c in session.captures if c.step == "turntable"]
    told = [TableObservation(spheres[c.id], float(np.deg2rad(c.table_deg or 0.0)), c.mount or "") for c in turned]
    return causes_of(table_causes(session.captures, told, SphereSize(40.0), tool))


@pytest.mark.thorough(keep=3)
@pytest.mark.parametrize("name", ANGLES)
def test_wrong_angles_of_the_table_are_named_and_applying_repairs_them(
    table: SimulatedSession, spheres: dict[str, SphereObservation], name: str
) -> None:
    session = told_angles(table.session, ANGLES[name])
    (cause,) = causes_of_table(session, table, spheres)
    assert cause.kind == "table-angles"
    figure = cause.evidence[0]
    assert figure.after is not None
    assert figure.before is None or figure.after < figure.before / 10
    mended, undo = applied(session, changes_for(session, cause))
    right = [c.table_deg for c in table.session.captures if c.step == "turntable"]
    given = np.array([c.table_deg for c in mended.captures if c.step == "turntable"], dtype=float)
    sense = -1 if "other way" in name else 1
    # The table's zero is its own: a lost step leaves every mounting its own as well.
    assert np.ptp(given - sense * np.array(right, dtype=float)) % 360 == pytest.approx(0, abs=1e-6)
    assert applied(mended, undo)[0] == session
    assert causes_of_table(mended, table, spheres) == []


def test_right_angles_are_not_doubted(table: SimulatedSession, spheres: dict[str, SphereObservation]) -> None:
    assert causes_of_table(table.session, table, spheres) == []
    assert causes_of_table(told_angles(table.session, lambda a: [-one for one in a]), table, spheres) == []


def test_angles_in_radians_have_their_card_though_nothing_was_solved(table: SimulatedSession) -> None:
    session = told_angles(table.session, ANGLES["in radians"])
    assert session_causes(session, table.files.__getitem__, {})[0].title == "Table angles are in radians"


@pytest.mark.parametrize(("x", "z"), [(1.05, 1.0), (1.0, 0.5), (1.1, 1.1)])
def test_scaled_profiles_are_named_and_read_rightly_once_it_is_applied(
    still: SimulatedSession, x: float, z: float
) -> None:
    files = scaled_files(still.files, x, z)
    told = sphere_of(still.session.cell, [])
    causes = causes_of(scale_causes(still.session, still.session.captures, files.__getitem__, told))
    scatters = [
        one.after for cause in causes for one in cause.evidence if one.after is not None and one.unit == "mm"
    ]
    assert len(scatters) == len(causes)
    assert max(scatters) < 2.3 * min(scatters)  # what fits much worse than another is not told beside it
    cause = causes[0]
    assert cause.kind == "scaled-profile"
    assert cause.point_settings.get("x_scale", 1.0) * x == pytest.approx(1, abs=0.006)
    assert cause.point_settings.get("z_scale", 1.0) * z == pytest.approx(1, abs=0.006)
    mended, undo = applied(still.session, changes_for(still.session, cause))
    assert applied(mended, undo)[0] == still.session


def test_another_diameter_is_named(still: SimulatedSession) -> None:
    read, captures = still.files.__getitem__, still.session.captures
    cause = causes_of(scale_causes(still.session, captures, read, SphereSize(44.0)))[0]
    assert cause.changes is not None
    assert cause.changes.cell == {"sphere_diameter_mm": 40.0}
    assert causes_of(scale_causes(still.session, captures, read, SphereSize(40.0))) == []


@pytest.mark.thorough
def test_the_stage_says_first_that_its_profiles_are_scaled(still: SimulatedSession) -> None:
    files = scaled_files(still.files, 0.8, 1.0)
    result = run(still.session, files.__getitem__, "tcp")["tcp"]
    assert result.verdict == "fail"
    assert "multiplied by x × 1.25" in result.warnings[0]
    mended, _ = applied(still.session, changes_for(still.session, result.causes[0]))
    again = run(mended, files.__getitem__, "tcp")["tcp"]
    assert again.verdict != "fail"
    assert again.causes == []


def test_two_poses_that_seem_swapped_do_not_hide_profiles_that_are_scaled() -> None:
    cell = troubled(all_troubles()["arms: clean"], 7017)
    read = scaled_files(cell.files, 0.8, 1.0).__getitem__
    found = [one for one in solve_stage(cell.session, "tcp", read).findings if one.severity != "note"]
    assert found[0].code == "scaled-profile"
    assert "swapped-poses" not in {one.code for one in found}


@pytest.mark.thorough
def test_captures_that_turn_alone_are_not_called_too_large() -> None:
    """Any scale fits them: made smaller they scatter less, and that says nothing."""
    cell = simulate("tcp-rotation-only", 1)
    result = run(cell.session, cell.files.__getitem__, "tcp")["tcp"]
    found = {finding.code for finding in result.findings}
    assert "scaled-profile" not in found
    assert "tool-rotation-undetermined" in found


def test_the_chain_does_not_bend_tool_and_poses_until_angles_in_gon_fit() -> None:
    table = simulate("turntable", 2)
    session = told_angles(table.session, lambda angles: [one / 0.9 for one in angles])
    found = run(session, table.files.__getitem__, "chain")["chain"]
    assert found.verdict == "fail"
    assert {"table-angles-do-not-fit", "table-angles"} <= {finding.code for finding in found.findings}


def test_angles_that_others_beat_by_a_million_do_not_fit_on_a_small_circle() -> None:
    """1.5 mm off a circle of 15 mm: no fixed length tells a wrong unit from a table that is worn."""
    table = whole()[0].turntable
    off = table.residuals.expected_in_base + np.array([1.5, 0.0, 0.0])
    small = replace(table, residuals=replace(table.residuals, centers_in_base=off))
    assert angles_that_do_not_fit(small) == []
    assert angles_that_do_not_fit(small, otherwise_mm=1.2) == []
    assert [one.code for one in angles_that_do_not_fit(small, otherwise_mm=0.1)] == ["table-angles-do-not-fit"]


def test_a_capture_of_nothing_keeps_no_moved_sphere_from_being_named() -> None:
    """Nothing came back in the last capture: no lengths can be told by it, and the others are judged."""
    cell = troubled(all_troubles()["sphere: moved by 5 mm for good"], 7005)
    found = solve_stage(cell.session, "tcp", cell.files.__getitem__).findings
    assert found[0].code == "moved-sphere"
    assert "p014" not in found[0].captures


def test_circles_are_searched_by_their_algebraic_centres_whatever_the_scales() -> None:
    """What sums of powers give at once is what a linear least-squares fit of each scaled arc gives."""
    rng = np.random.default_rng(3)
    angles = np.linspace(0.3, 2.2, 60)
    arcs = [
        rng.uniform(-30, 30, 2)
        + 40 * np.column_stack([np.cos(angles), np.sin(angles)])
        + rng.normal(0, 0.1, (60, 2))
        for _ in range(3)
    ]
    fit = fit_arc(arcs[0], 80.0)
    told = SeenArcs(simulate("tcp", 1).session.cell, [], [(points, fit) for points in arcs], [])
    scales = np.array([[1.0, 1.0], [25.4, 25.4], [1.0, 1.08], [0.9, 1.1]])
    found = told.circle_centers(scales)
    assert np.all(found[:, :, 1] == 0.0)
    for k, points in enumerate(arcs):
        for n, scale in enumerate(scales):
            scaled = points * scale
            system = np.column_stack([2 * scaled, np.ones(len(scaled))])
            center = np.linalg.lstsq(system, (scaled**2).sum(axis=1), rcond=None)[0][:2]
            np.testing.assert_allclose(found[n, k, [0, 2]], center, rtol=1e-6)
