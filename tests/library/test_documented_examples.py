"""docs/library.md at work: each example is run as it stands there, one after the other."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import calib_core as cc

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = re.findall(
    r"^```python\n(.*?)^```", (ROOT / "docs" / "library.md").read_text("utf-8"), re.MULTILINE | re.DOTALL
)


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """What each example leaves, by a word of it; they run in a folder with the scans that the text speaks of."""
    folder = tmp_path_factory.mktemp("notebook")
    session, truth = cc.simulate("tcp", 1)
    (folder / "scans").mkdir()
    for capture in session.captures:
        (folder / "scans" / f"{capture.id}.csv").write_bytes(session.read(capture.files[0]))
    lines = [" ".join(map(str, capture.pose or [])) for capture in session.captures]
    (folder / "poses.txt").write_text("\n".join(lines))
    space: dict[str, Any] = {}
    left: dict[str, dict[str, Any]] = {"truth": truth}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for example in EXAMPLES:
            exec(compile(example, "docs/library.md", "exec"), space)
            left[example.split("\n")[0]] = dict(space)
    return left


@pytest.mark.thorough
def test_ten_lines_take_profiles_and_poses_to_a_tcp_with_its_uncertainty(ran: dict[str, dict[str, Any]]) -> None:
    assert len(EXAMPLES[0].strip().splitlines()) <= 10
    result, truth = ran["from pathlib import Path"]["result"], ran["truth"]
    sigmas = np.sqrt(np.diag(np.array(result.covariance)))[3:]
    off = np.array(result.tool0_from_laser)[:3, 3] - np.array(truth["tool0_from_laser"])[:3, 3]
    assert (np.abs(off) < 4 * sigmas).all()
    assert (sigmas < 0.5).all()


def test_arrays_give_what_files_give() -> None:
    session, _ = cc.simulate("tcp", 1)
    scans = [cc.scan_points(session, capture) for capture in session.captures]
    poses = [
        cc.parse_pose(session.cell.pose_convention, capture.pose or []).matrix for capture in session.captures
    ]
    of_arrays = cc.calibrate_tcp(session.cell, scans, poses)
    of_files = session.run("tcp")["tcp"]
    np.testing.assert_allclose(of_arrays.tool0_from_laser, of_files.tool0_from_laser, atol=1e-6)


def test_table_and_chain_agree_with_the_truth(ran: dict[str, dict[str, Any]]) -> None:
    space = next(left for first, left in ran.items() if "turntable" in first)
    true = np.array(space["truth"]["tool0_from_laser"])[:3, 3]
    for result in (space["tool"], space["chain"]):
        sigmas = np.sqrt(np.diag(np.array(result.covariance)))[3:6]
        assert (np.abs(np.array(result.tool0_from_laser)[:3, 3] - true) < 4 * sigmas).all()
    direction = np.array(space["truth"]["axis_direction_in_base"])
    for result in (space["table"], space["chain"]):
        off = np.linalg.norm(np.cross(result.axis_direction_in_base, direction))
        assert np.rad2deg(off) < 4 * result.axis_direction_sigma_deg


def test_sessions_and_archives_come_round(ran: dict[str, dict[str, Any]]) -> None:
    space = next(left for first, left in ran.items() if "seed=7" in first)
    assert space["results"]["tcp"].verdict == "pass"
    assert space["facts"].results == {"tcp": "pass"}
    assert space["same"]


def test_a_result_prints_itself_and_shows_itself(ran: dict[str, dict[str, Any]]) -> None:
    result = ran["from pathlib import Path"]["result"]
    text = str(result)
    assert text.startswith("tcp: PASS")
    assert "±" in text
    html = result._repr_html_()
    assert "<svg" in html
    assert html.count("<div") == html.count("</div>")
    assert "http" not in html.replace("http://www.w3.org/2000/svg", "")  # no address is asked


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"poses": [[1.0, 2.0, 3.0]]}, "14 poses, one a scan"),
        ({"scans": [np.zeros((5, 4))] * 14}, "array of shape (5, 4)"),
        ({"scans": [np.full((5, 2), np.nan)] * 14}, "tcp"),
        ({"poses": [np.diag([2.0, 1.0, 1.0, 1.0])] * 14}, "rotation"),
        ({"cell": {"pose_convention": "fanuk"}}, "fanuc"),
        ({"scans": ["nowhere.csv"] * 14}, "no such file"),
    ],
)
def test_bad_input_is_one_clear_sentence(change: dict[str, Any], said: str) -> None:
    session, _ = cc.simulate("tcp", 1)
    given = {
        "cell": session.cell,
        "scans": [cc.scan_points(session, capture) for capture in session.captures],
        "poses": [capture.pose for capture in session.captures],
    }
    with pytest.raises(cc.CalibrationError) as refused:
        cc.calibrate_tcp(**{**given, **change})
    assert said in str(refused.value)


def test_all_that_is_listed_is_there_and_nothing_heavy_comes_first() -> None:
    import subprocess
    import sys

    assert all(getattr(cc, name) is not None for name in cc.__all__)
    assert set(cc.__all__) < set(dir(cc))
    with pytest.raises(AttributeError, match="calibrate_all"):
        _ = cc.calibrate_all  # type: ignore[attr-defined]
    code = "import sys, calib_core; print(*{'numpy', 'scipy', 'pydantic', 'numba', 'cv2'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_the_tool_goes_into_a_backup_and_is_read_back(tmp_path: Path) -> None:
    session, _ = cc.simulate("tcp", 1)
    session.run("tcp")
    backup = tmp_path / "backup"
    backup.mkdir()
    zeros = "X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0"
    (backup / "$config.dat").write_text(f"DEFDAT $CONFIG\nTOOL_DATA[3]={{{zeros}}}\nTOOL_TYPE[3]=#BASE\nENDDAT\n")
    assert not session.read_back(backup, tool="3").equal
    (backup / "$config.dat").write_bytes(session.export("kuka", {"tool": 3}, into=backup))
    assert session.read_back(backup, tool="3").equal
    assert [tool.number for tool in cc.read_poses(backup).tools] == [3]
    frames = session.record.cell.model_copy(update={"sphere_diameter_mm": 81.0})
    session.record = session.record.model_copy(update={"cell": frames})
    assert session.read_back(backup, tool="3").faults == ("stale",)
    with pytest.raises(cc.CalibrationError, match="fresh"):
        session.export("kuka")
    assert b"NOT TO BE USED" in session.export("kuka", allow=("stale",))


def test_a_file_of_the_sources_that_a_document_names_is_there() -> None:
    sources = [f"/{path.relative_to(ROOT).as_posix()}" for path in ROOT.glob("[a-z]*/**/*.py")]
    missing = [
        f"{page.name}: {name}"
        for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
        for name in re.findall(r"`([\w./-]+\.py)`", page.read_text("utf-8"))
        if not any(source.endswith(f"/{name}") for source in sources)
    ]
    assert missing == []
