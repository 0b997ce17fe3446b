import json
import shutil

import numpy as np
import pytest

import calib_core.chain.tcp
from calib_core.archive.folder import load_session, write_result
from calib_core.errors import ConflictError, InputError, MeasurementError
from calib_core.exports.export import export
from calib_core.frames import RigidTransform
from calib_core.graph.keys import inputs_sha256
from calib_core.records import Session, parse_session
from calib_core.review.check import check_session
from calib_core.robots import CONVENTIONS, parse_pose
from calib_core.simulation import simulate
from calib_core.stages.pipeline import run, solve_stage
from server.cli import main


@pytest.fixture(scope="module")
def simulated():
    return simulate("tcp", 5)


@pytest.fixture(scope="module")
def result(simulated):
    return solve_stage(simulated.session, "tcp", simulated.files.__getitem__)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("pipeline") / "cell"
    assert main(["simulate", "tcp", "--seed", "5", "--out", str(path)]) == 0
    return path


def changed(session: Session, index, **fields):
    data = session.to_json()
    data["captures"][index] |= fields
    return parse_session(data)


def errors_in_sigmas(result, truth):
    true = RigidTransform.from_rounded(truth["tool0_from_laser"], "tool0", "laser")
    found = RigidTransform.from_rounded(result.tool0_from_laser, "tool0", "laser")
    xi = found.difference(true)
    return float(xi @ np.linalg.solve(np.array(result.covariance), xi))


def test_the_truth_lies_within_the_stated_uncertainty(simulated, result):
    assert errors_in_sigmas(result, simulated.truth) < 22.5  # χ² of 6 at 0.1 %
    assert result.verdict == "pass"
    assert [row.capture for row in result.residuals] == [c.id for c in simulated.session.captures]
    assert all(row.used for row in result.residuals)


def test_captures_that_count_less_are_named_with_their_weights(simulated, result):
    pose = simulated.session.captures[11].pose
    session = changed(simulated.session, 11, pose=[pose[0] + 0.5, *pose[1:]])
    off = solve_stage(session, "tcp", simulated.files.__getitem__)
    light = {row.capture: row.weight for row in off.residuals if row.used and row.weight < 0.5}
    assert session.captures[11].id in light
    (note,) = [one for one in off.findings if one.code == "captures-count-less"]
    assert note.captures == list(light)
    assert note.values["weights"] == ", ".join(f"{name} ({weight:.0%})" for name, weight in light.items())
    assert not [one for one in result.findings if one.code == "captures-count-less"]


def test_progress_rises_to_the_end(simulated):
    told = []
    solve_stage(
        simulated.session, "tcp", simulated.files.__getitem__, lambda part, message: told.append((part, message))
    )
    parts = [part for part, _ in told]
    assert parts == sorted(parts)
    assert parts[0] == 0
    assert 0.9 < parts[-1] <= 1
    assert all(message for _, message in told)


def test_what_is_not_used_has_a_row_and_a_reason(simulated):
    session = changed(simulated.session, 8, excluded=True)
    flat = "".join(f"{x / 10},{200 + (x % 7) / 500}\n" for x in range(-300, 300)).encode()
    files = {**simulated.files, "captures/p06.csv": flat}
    result = solve_stage(session, "tcp", files.__getitem__)
    rows = {row.capture: row for row in result.residuals}
    assert list(rows) == [c.id for c in session.captures]
    assert (rows["p09"].used, rows["p09"].reason) == (False, "excluded by the user")
    assert rows["p06"].used is False
    assert "arc" in rows["p06"].reason
    assert result.verdict == "warn"
    assert any(warning.startswith("p06 is not used: ") for warning in result.warnings)
    assert not any(warning.startswith("p09") for warning in result.warnings)
    assert errors_in_sigmas(result, simulated.truth) < 22.5


def test_a_duplicate_capture_counts_once(simulated, result):
    data = simulated.session.to_json()
    data["captures"].append(data["captures"][2] | {"id": "p03-again"})
    session = parse_session(data)
    doubled = solve_stage(session, "tcp", simulated.files.__getitem__)
    row = doubled.residuals[-1]
    assert (row.capture, row.used) == ("p03-again", False)
    assert row.reason.startswith("a duplicate of p03")
    np.testing.assert_allclose(doubled.tool0_from_laser, result.tool0_from_laser, atol=1e-9)
    found = [f for f in check_session(session, simulated.files.__getitem__) if f.captures == ["p03-again"]]
    assert ["duplicate of p03" in finding.text for finding in found if finding.severity == "warning"] == [True]


def test_a_wrong_pose_is_rejected_by_the_solver():
    spoiled = simulate("tcp-wrong-pose", 5)
    result = solve_stage(spoiled.session, "tcp", spoiled.files.__getitem__)
    rejected = {row.capture for row in result.residuals if not row.used}
    assert rejected == set(spoiled.truth["spoiled"])
    assert all(row.reason for row in result.residuals if not row.used)


def test_most_captures_without_the_sphere_blame_the_cell(simulated):
    data = simulated.session.to_json()
    data["cell"]["sphere_diameter_mm"] = 15.0
    with pytest.raises(MeasurementError, match="captures do not show the sphere"):
        solve_stage(parse_session(data), "tcp", simulated.files.__getitem__)


def test_all_solves_nothing_that_the_user_brings(simulated, result):
    data = simulated.session.to_json()
    data["cell"]["known"] = {"tool0_from_laser": result.tool0_from_laser}
    session = parse_session(data)
    assert run(session, simulated.files.__getitem__) == {}
    with pytest.raises(InputError, match=r"cell\.known"):
        run(session, simulated.files.__getitem__, "tcp")


def test_the_inputs_hash_follows_what_the_result_depends_on(simulated, result):
    session, files = simulated.session, simulated.files

    def hashed(session=session, files=files):
        return inputs_sha256(session, "tcp", files.__getitem__)

    assert hashed() == result.inputs_sha256
    renamed = session.model_copy(update={"name": "another name"})
    assert hashed(renamed) == hashed()
    assert hashed(changed(session, 0, note="seen by me")) == hashed()
    assert hashed(changed(session, 0, side=1)) != hashed()
    assert hashed(changed(session, 0, excluded=True)) != hashed()
    assert hashed(files={**files, "captures/p02.csv": files["captures/p02.csv"] + b"\n"}) != hashed()
    again = parse_session(json.loads(json.dumps(session.to_json())))
    assert hashed(again) == hashed()
    scan = [*session.to_json()["captures"], {"id": "s1", "step": "scan", "kind": "cloud", "files": ["s.ply"]}]
    assert hashed(parse_session(session.to_json() | {"captures": scan})) == hashed()  # another stage's capture


def test_every_convention_of_the_export_is_the_same_frame(simulated, result):
    text, entry = export(simulated.session, {"tcp": result}, "json")
    assert entry.media_type == "application/json"
    data = json.loads(text)
    assert data["conventions"].keys() == CONVENTIONS.keys()
    for name, numbers in data["conventions"].items():
        again = parse_pose(name, numbers["numbers"])
        np.testing.assert_allclose(again.matrix, result.tool0_from_laser, atol=1e-9)
        assert len(numbers["names"]) == len(numbers["numbers"]) == len(numbers["standard_deviations"])
    sigmas = np.sqrt(np.diag(np.array(result.covariance)))
    np.testing.assert_allclose(data["conventions"]["fanuc"]["standard_deviations"][:3], sigmas[3:], rtol=1e-6)
    np.testing.assert_allclose(data["conventions"]["ur"]["standard_deviations"][:3], sigmas[3:] / 1000, rtol=1e-6)
    stored = json.loads(result.model_dump_json())
    assert export(simulated.session, {"tcp": stored}, "json")[0] == text


def test_export_says_what_it_needs(simulated, result):
    with pytest.raises(ConflictError, match="Solve the session first"):
        export(simulated.session, {}, "json")
    with pytest.raises(InputError, match="json"):
        export(simulated.session, {"tcp": result}, "robodk")


def test_run_prints_one_json_object_and_stores_the_result(folder, capsys, result):
    assert main(["run", str(folder), "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    printed = json.loads(out)
    assert printed.keys() == {"session", "results"}
    stored = json.loads((folder / "results" / "tcp.json").read_text())
    assert stored["seal"]["provenance"] == "solved"
    assert printed["results"] == {"tcp": {**stored, "seal": None}}  # only what is stored is sealed
    np.testing.assert_allclose(stored["tool0_from_laser"], result.tool0_from_laser, atol=1e-9)
    assert stored["inputs_sha256"] == result.inputs_sha256


def test_run_writes_elsewhere_when_asked(folder, tmp_path, capsys):
    copy = shutil.copytree(folder, tmp_path / "cell", ignore=shutil.ignore_patterns("results"))
    assert main(["run", str(copy), "--stage", "tcp", "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out" / "results" / "tcp.json").is_file()
    assert not (copy / "results").exists()
    out = capsys.readouterr().out
    for words in ("tcp: PASS", "14 of 14", " ± ", "two steps", "Noise", "At the workpiece"):
        assert words in out


def test_export_refuses_a_stored_result_that_is_not_current(folder, result, tmp_path, capsys):
    copy = shutil.copytree(folder, tmp_path / "cell", ignore=shutil.ignore_patterns("results"))
    assert main(["export", str(copy), "--format", "json"]) == 0
    capsys.readouterr()
    assert not (copy / "results").exists()
    session = load_session(copy)[0]
    write_result(copy, "tcp", result.model_copy(update={"inputs_sha256": "0" * 64}), session)
    assert main(["export", str(copy), "--format", "json"]) == 1
    assert "stale" in capsys.readouterr().err
    assert main(["export", str(copy), "--format", "json", "--allow", "stale"]) == 0
    assert json.loads(capsys.readouterr().out)
    assert main(["export", str(copy), "--format", "robodk"]) == 2
    assert "format: need one of " in capsys.readouterr().err


def test_all_stages_solve_nothing_twice_and_answer_as_each_alone(monkeypatch):
    simulated = simulate("turntable", 7)
    read = simulated.files.__getitem__
    solves = []
    solve_tcp = calib_core.chain.tcp.solve_tcp
    monkeypatch.setattr("calib_core.chain.tcp.solve_tcp", lambda *args: solves.append(1) or solve_tcp(*args))
    together = run(simulated.session, read)
    assert (list(together), len(solves)) == (["tcp", "turntable", "chain"], 1)
    alone = run(simulated.session, read, "chain")["chain"]
    assert together["chain"].model_dump_json() == alone.model_dump_json()
