"""The merge stage beside a nominal: where that lies, deviations, their uncertainty, and what refuses."""

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib_core.errors import InputError
from calib_core.formats.ply import ply_pieces
from calib_core.graph.keys import inputs_sha256
from calib_core.records import parse_session
from calib_core.records.evidence import Figure, Plot
from calib_core.simulation import simulate
from calib_core.simulation.part import build_part
from calib_core.stages.merge.nominal import _extremes
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.pipeline import run
from server.render.report.report import report_html

PART = build_part()
CLOUD_FROM_REFERENCE = np.eye(4)
CLOUD_FROM_REFERENCE[:3, :3] = Rotation.from_rotvec([0.4, -1.2, 2.0]).as_matrix()
CLOUD_FROM_REFERENCE[:3, 3] = [40.0, 200.0, -30.0]


def in_reference(place: Any) -> list[float]:
    return ((np.array(place) - CLOUD_FROM_REFERENCE[:3, 3]) @ CLOUD_FROM_REFERENCE[:3, :3]).tolist()


@lru_cache(maxsize=1)
def _scanned() -> tuple[dict[str, Any], dict[str, bytes], np.ndarray]:
    simulated = simulate("part", 3)
    corners = (PART.points_mm - CLOUD_FROM_REFERENCE[:3, 3]) @ CLOUD_FROM_REFERENCE[:3, :3]
    nominal = b"".join(bytes(piece) for piece in ply_pieces(corners, triangles=PART.triangles))
    record = simulated.session.to_json()
    record["captures"] = record["captures"][::2]
    files = {**simulated.files, "nominal.ply": nominal}
    return record, files, np.array(record["cell"]["known"]["base_from_turntable"])


def merged(**merge: Any) -> MergeResult:
    record, files, _ = _scanned()
    cell = {**record["cell"], "merge": {"mesh": "none", "voxel_mm": 0.8, **merge}}
    result = run(parse_session({**record, "cell": cell}, "session"), files.__getitem__, "merge")["merge"]
    assert isinstance(result, MergeResult)
    return result


@pytest.mark.thorough
def test_the_nominal_is_laid_into_the_part_and_deviations_are_what_is_stated() -> None:
    result = merged(reference="nominal.ply", tolerance_mm=0.2)
    assert result.alignment is not None
    assert result.deviation is not None
    assert result.alignment.method == "best-fit"
    truth = _scanned()[2] @ CLOUD_FROM_REFERENCE
    found = np.array(result.alignment.base_from_reference)
    turned = Rotation.from_matrix(truth[:3, :3].T @ found[:3, :3]).as_rotvec()
    error = np.concatenate([turned, found[:3, 3] - truth[:3, 3]])
    assert error @ np.linalg.solve(np.array(result.alignment.covariance), error) < 22.5  # 99.9 % of six
    off = result.deviation
    assert off.uncertainty_mm is not None
    assert 0.7 < off.rms_mm / off.uncertainty_mm < 1.3
    assert abs(off.signed_mean_mm) < off.rms_mm < off.within_95_mm
    assert off.counted > 0.99
    assert sum(off.histogram) == off.points
    assert off.within_tolerance is not None
    assert off.within_tolerance > 0.99
    assert off.above_tolerance is not None
    assert off.below_tolerance is not None
    assert off.within_tolerance + off.above_tolerance + off.below_tolerance == pytest.approx(1.0)
    assert [section.axis for section in off.sections] == ["y", "z"]  # across its longest and its shortest side
    for section in off.sections:
        ends = np.array(section.nominal).reshape(-1, 2, 2)
        points, along = np.array(section.points), ends[:, 1] - ends[:, 0]
        apart = points[:, None] - ends[:, 0]
        share = np.clip((apart * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-9), 0, 1)
        drawn = np.linalg.norm(apart - share[..., None] * along, axis=2).min(axis=1) / section.magnified
        assert section.magnified > 5
        assert 0.2 < np.median(drawn) / np.median(np.abs(off.rms_mm)) < 2.0
    headline = [block for block in result.evidence if getattr(block, "headline", False)]
    assert any("Deviation from the nominal" in block.label for block in headline if isinstance(block, Figure))
    assert any("0.2 mm" in block.label for block in headline if isinstance(block, Figure))
    (plot,) = [block for block in result.evidence if isinstance(block, Plot) and block.id == "deviations"]
    low = np.array(plot.series[0].x)
    assert low == pytest.approx(np.linspace(-off.limit_mm, off.limit_mm, len(off.histogram) + 1)[:-1])
    assert plot.series[0].y == off.histogram
    assert {block.title for block in result.evidence} >= {
        "Against the nominal", "Farthest points", "Section across y",
    }  # fmt: skip


@pytest.mark.parametrize("count", [3, 40, 600])
def test_the_farthest_points_are_five_of_each_side_apart_from_each_other(count: int) -> None:
    rng = np.random.default_rng(count)
    points, values = rng.uniform(0, 50, (count, 3)), rng.normal(size=count)
    found = _extremes(points, values, 10.0)
    for sign, part in ((1, found[: len(found) // 2]), (-1, found[len(found) // 2 :])):
        left, expected = [int(k) for k in np.argsort(-sign * values)], []
        while left and len(expected) < 5:
            expected.append(left[0])
            left = [k for k in left if np.linalg.norm(points[k] - points[left[0]]) > 10.0]
        assert [one.deviation_mm for one in part] == values[expected].tolist()
        assert [one.point_mm for one in part] == points[expected].tolist()


@pytest.mark.thorough
def test_the_page_to_sign_has_the_deviation_and_the_report_its_sections() -> None:
    record, _, _ = _scanned()
    result = merged(reference="nominal.ply", tolerance_mm=0.2)
    html = report_html(parse_session(record, "session"), {"merge": {**result.to_json(), "stale": False}})
    first, rest = html[: html.index("<main>")], html[html.index("<main>") :]
    assert "Deviation from the nominal, RMS" in first
    assert "Points within ± 0.2 mm" in first
    assert result.deviation is not None
    for section in result.deviation.sections:
        assert f"Section across {section.axis}" in rest


@pytest.mark.thorough
def test_told_poses_take_up_nothing_and_a_part_too_large_is_told_by_its_sign() -> None:
    truth = _scanned()[2] @ CLOUD_FROM_REFERENCE
    told = {"method": "matrix", "base_from_reference": truth.tolist()}
    result = merged(reference="nominal.ply", alignment=told)
    assert result.alignment is not None
    assert result.deviation is not None
    assert np.array(result.alignment.base_from_reference) == pytest.approx(truth, abs=1e-9)
    assert result.alignment.covariance is None
    assert result.deviation.rms_mm < 0.1
    as_it_lies = merged(reference="nominal.ply", alignment="none")
    assert as_it_lies.deviation is not None
    assert as_it_lies.deviation.rms_mm > 1.0


@pytest.mark.thorough
def test_datum_features_lay_the_part_and_each_is_told() -> None:
    datums = [
        {"kind": "sphere", "center_mm": in_reference(PART.ball_center_mm), "radius_mm": 10.0},
        {"kind": "plane", "point_mm": in_reference([0.0, -32.0, 14.0]), "radius_mm": 10.0},
        {"kind": "plane", "point_mm": in_reference([48.0, 0.0, 15.0]), "radius_mm": 10.0},
    ]
    result = merged(reference="nominal.ply", alignment={"method": "datums", "datums": datums})
    assert result.alignment is not None
    assert result.deviation is not None
    truth = _scanned()[2] @ CLOUD_FROM_REFERENCE
    found = np.array(result.alignment.base_from_reference)
    turned = Rotation.from_matrix(truth[:3, :3].T @ found[:3, :3]).as_rotvec()
    error = np.concatenate([turned, found[:3, 3] - truth[:3, 3]])
    assert error @ np.linalg.solve(np.array(result.alignment.covariance), error) < 22.5  # 99.9 % of six
    assert [one.kind for one in result.alignment.datums] == ["sphere", "plane", "plane"]
    assert np.array(result.alignment.datums[0].at_mm) == pytest.approx(in_reference(PART.ball_center_mm))
    assert all(one.off_mm < 0.3 and one.rms_mm < 0.2 for one in result.alignment.datums)
    assert result.deviation.uncertainty_mm is not None
    assert 0.5 < result.deviation.rms_mm / result.deviation.uncertainty_mm < 1.5
    assert "Datums" in {block.title for block in result.evidence}
    open_part = merged(reference="nominal.ply", alignment={"method": "datums", "datums": datums[:1]})
    assert open_part.alignment is None
    assert "a turn about" in open_part.warnings[0]


def test_what_is_not_told_changes_no_key_and_a_nominal_changes_it() -> None:
    record, files, _ = _scanned()

    def key(**merge: Any) -> str:
        cell = {**record["cell"], "merge": merge}
        return inputs_sha256(parse_session({**record, "cell": cell}, "session"), "merge", files.__getitem__)

    plain = key()
    assert key(reference=None, alignment=None) == plain
    assert len({plain, key(reference="nominal.ply"), key(reference="nominal.ply", alignment="none")}) == 3


def test_a_part_larger_than_its_nominal_lies_beyond_the_upper_tolerance() -> None:
    record, files, _ = _scanned()
    truth, middle = _scanned()[2] @ CLOUD_FROM_REFERENCE, PART.points_mm.mean(axis=0)
    smaller = ply_pieces(middle + 0.97 * (PART.points_mm - middle), triangles=PART.triangles)
    alignment = {"method": "matrix", "base_from_reference": truth.tolist()}
    merge = {"mesh": "none", "voxel_mm": 1.0, "tolerance_mm": 0.2, "reference": "n.ply", "alignment": alignment}
    session = parse_session({**record, "cell": {**record["cell"], "merge": merge}}, "session")
    read = {**files, "n.ply": b"".join(bytes(piece) for piece in smaller)}.__getitem__
    result = run(session, read, "merge")["merge"]
    assert isinstance(result, MergeResult)
    off = result.deviation
    assert off is not None
    assert off.above_tolerance is not None
    assert off.below_tolerance is not None
    assert off.above_tolerance > 0.5
    assert off.above_tolerance > 5 * off.below_tolerance


def test_a_nominal_in_metres_or_missing_is_named() -> None:
    record, files, _ = _scanned()
    small = b"".join(bytes(piece) for piece in ply_pieces(PART.points_mm / 1000, triangles=PART.triangles))
    cell = {**record["cell"], "merge": {"mesh": "none", "voxel_mm": 1.0, "reference": "nominal.ply"}}
    session = parse_session({**record, "cell": cell}, "session")
    result = run(session, {**files, "nominal.ply": small}.__getitem__, "merge")["merge"]
    assert [finding.code for finding in result.findings if finding.severity == "warning"] == [
        "merge-nominal-not-found"
    ]
    assert "millimetres" in result.warnings[0]
    for wrong, words in (
        ({"method": "matrix"}, "base_from_reference"),
        ({"method": "3-2-1"}, "datum_points_mm"),
        ({"method": "datums"}, "datums"),
        ({"method": "datums", "datums": [{"kind": "plane", "radius_mm": 5.0}]}, "point_mm"),
    ):
        with pytest.raises(InputError, match=words):
            parse_session({**record, "cell": {**cell, "merge": {"alignment": wrong}}}, "session")
    with pytest.raises(InputError, match="inside the session folder"):
        parse_session({**record, "cell": {**cell, "merge": {"reference": "../part.stl"}}}, "session")
