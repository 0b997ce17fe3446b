"""What the product of 2026-11 stored: it opens, stays fresh, and solving anew gives the same numbers."""

import json
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import calib_core as cc
from calib_core.archive.archive import verify
from calib_core.archive.folder import load_session
from calib_core.archive.stored_results import stored_results
from calib_core.graph.keys import Graph
from calib_core.graph.registry import STAGES
from calib_core.library.archives import replay
from calib_core.stages.guide import guide

STORED = Path(__file__).resolve().parents[1] / "releases" / "2026-11"
ARCHIVES = sorted(path.stem for path in (STORED / "archives").iterdir())
FRAMES = {
    "tcp": {"tool0_from_laser": "covariance"},
    "turntable": {"base_from_turntable": "covariance"},
    "chain": {"tool0_from_laser": "covariance", "base_from_turntable": "turntable_covariance"},
}
SIGMAS = 1e-3


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("stored")
    with zipfile.ZipFile(STORED / "folders.zip") as stored:
        stored.extractall(place)
    return place


@pytest.fixture(params=[name for name in ARCHIVES if name != "frames"])
def folder(request: pytest.FixtureRequest, folders: Path) -> Path:
    return folders / request.param


def rows(result: dict[str, Any]) -> Iterator[tuple[str, bool]]:
    return ((row["capture"], row["used"]) for row in result["residuals"])


def test_every_archive_is_whole() -> None:
    assert len(ARCHIVES) == 12
    for name in ARCHIVES:
        assert verify(STORED / "archives" / f"{name}.zip").captures > 0


@pytest.mark.thorough(keep=5)
def test_a_folder_is_fresh_and_solved_anew_gives_the_same(folder: Path) -> None:
    session, read = load_session(folder)
    stored = stored_results(folder)
    assert stored
    assert Graph.stale_of(session, read, stored) == frozenset()
    solved = cc.load(folder).run()
    assert set(solved) == set(stored)
    for stage, before in stored.items():
        now = json.loads(solved[stage].model_dump_json())
        if folder.name == "turntable-wobble":  # said by longer odds since revision 8: it lies well within the ±
            before |= {"verdict": "pass", "warnings": []}
        assert now["verdict"] == before["verdict"], stage
        # Of a failed one a false cause was said, which hid what is not determined; scans as coarse as those of the
        # stored merge are compared since its revision 6, before it was said that none overlap.
        if now["verdict"] != "fail":
            expected = 2 if stage == "merge" else len(before["warnings"])
            assert len(now["warnings"]) == expected, (stage, now["warnings"])
        assert now["method_revision"] == STAGES.get(stage).method_revision >= before.get("method_revision", 1)
        if "residuals" in before:
            assert list(rows(now)) == list(rows(before)), stage
        for name, covariance in FRAMES.get(stage, {}).items():
            # What is not determined may lie anywhere within its ±: since revision 2 of tcp it lies elsewhere.
            limit = SIGMAS if now["verdict"] != "fail" else 3.0
            if folder.name == "tcp-mixed":  # noise of its clouds was taken for their scanner's error by a quarter
                limit = 0.3
            assert apart(before[name], now[name], before[covariance]) < limit, (stage, name)


def apart(before: Any, now: Any, covariance: Any) -> float:
    """Return by how many sigmas two frames differ at most."""
    sigmas, one, other = np.sqrt(np.diag(covariance)), np.array(before), np.array(now)
    turned = one[:3, :3].T @ other[:3, :3]
    vector = 0.5 * np.array(
        [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
    )
    return float(np.abs(np.concatenate([vector, other[:3, 3] - one[:3, 3]]) / sigmas).max())


@pytest.mark.thorough(keep=3)
def test_an_answer_of_before_is_exported_and_reported(folder: Path) -> None:
    opened = cc.load(folder)
    failed = [name for name, result in opened.results.items() if result.verdict == "fail"]
    if failed:
        with pytest.raises(cc.CalibrationError, match="fail"):
            opened.export("json")
    else:
        answer = json.loads(opened.export("json"))
        last = opened.results.get("chain") or opened.results["tcp"]
        assert np.allclose(answer["tool0_from_laser"], last.tool0_from_laser)


@pytest.mark.thorough
def test_frames_of_before_replay_to_the_same_numbers(tmp_path: Path) -> None:
    archive = STORED / "archives" / "frames.zip"
    replayed = {stage.stage: stage for stage in replay(archive).stages}
    assert set(replayed) == {"camera", "laser-plane", "tcp"}
    # Since revision 5 of the camera light that falls off to the border draws no corner any more, and since its
    # revision 10 a slight bend is allowed for.  Lines count otherwise since revisions 3, 11 and 12 of the plane:
    # it moved by more than a sigma, from 2.7 to 1.6 sigmas off the truth.
    with zipfile.ZipFile(archive) as stored:
        stored.extractall(tmp_path)
    folder = tmp_path / "frames" / "data"
    before, now = stored_results(folder), cc.load(folder).run()
    truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    old_lens, new_lens, true_lens = map(pinhole, (before["camera"], now["camera"].to_json(), truth["camera"]))
    places = [before["camera"]["parameters"].index(name) for name in ("fx", "fy", "cx", "cy")]
    lens = np.array(before["camera"]["covariance"])[np.ix_(places, places)]
    assert squared(new_lens - old_lens, lens) < 0.5**2  # half a sigma all together
    assert squared(new_lens - true_lens, lens) < 18.5  # of four degrees of freedom: once in a thousand beyond
    old_plane, new_plane, true_plane = map(plane_of, (before["laser-plane"], now["laser-plane"].to_json(), truth))
    spread = np.array(before["laser-plane"]["plane_covariance"])
    assert squared(new_plane - true_plane, spread) < min(16.3, squared(old_plane - true_plane, spread))
    old = before["tcp"]
    assert apart(old["tool0_from_laser"], now["tcp"].tool0_from_laser, old["covariance"]) < 0.5


def pinhole(camera: dict[str, Any]) -> np.ndarray:
    return np.array(camera["camera_matrix"])[[0, 1, 0, 1], [0, 1, 2, 2]]


def plane_of(told: dict[str, Any]) -> np.ndarray:
    plane = told["plane_in_camera"]
    return np.array([*plane["normal"], plane["distance_mm"]])


def squared(step: np.ndarray, covariance: np.ndarray) -> float:
    """Return a step's square in its standard deviations; of a plane's four numbers three are free."""
    return float(step @ np.linalg.pinv(covariance, rcond=1e-10, hermitian=True) @ step)


def test_an_answer_of_an_older_revision_stays_fresh_and_solving_anew_is_offered(
    folders: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session, read = load_session(folders / "tcp")
    stored = stored_results(folders / "tcp")
    assert "method_revision" not in stored["tcp"]
    with monkeypatch.context() as then:
        then.setattr(type(STAGES.get("tcp")), "method_revision", 1)
        assert not any("revised" in (step.note or "") for step in guide(session, [], stored).steps)
    assert Graph.stale_of(session, read, stored) == frozenset()
    (step,) = [step for step in guide(session, [], stored).steps if step.step == "tcp"]
    assert step.status == "done"
    assert "solve anew" in str(step.note)
    (replayed,) = replay(folders / "tcp").stages
    assert replayed.provenance == "replayed"
    # Since revision 4 of tcp the ± at the workpiece is in base as the arm tells it, since 15 the covariance of the
    # two steps holds what the scanner's files err by; nothing else has moved.
    moved = {".".join(one.path.replace("[", ".").split(".")[:2]) for one in replayed.differences}
    assert {one.split(".")[0] for one in moved} == {"workpiece", "two_step"}
    assert "two_step.covariance" in moved
    assert not [one for one in moved if one.startswith("two_step") and one != "two_step.covariance"]
    assert cc.load(folders / "tcp").run()["tcp"].method_revision == STAGES.get("tcp").method_revision
