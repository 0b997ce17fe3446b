"""The merge stage on session files: poses and table angles used, grids kept, what is missing named."""

import runpy
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calib_core.archive.stored_clouds import read_stored_ply
from calib_core.arms.errors import corrected_pose
from calib_core.captures.placement import Placement
from calib_core.captures.scans import read_scan, scan_groups
from calib_core.errors import CalibrationError, InputError
from calib_core.formats.points import parse_cloud
from calib_core.formats.shared.writing import write_pieces
from calib_core.frames import RigidTransform
from calib_core.fusion.overlap import move_of_pose_change
from calib_core.graph.keys import inputs_sha256
from calib_core.records import Capture, Session
from calib_core.simulation import simulate
from calib_core.stages.merge.calibration import Calibration, moves_of_scan
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.merge.solve import CLOUD_FILE, MESH_FILE
from calib_core.stages.pipeline import run

sphere_scans = SimpleNamespace(**runpy.run_path(str(Path(__file__).with_name("sphere_scans.py"))))

TOOL = RigidTransform.of([0.2, -0.3, 0.5], [30, -120, 140], "tool0", "laser")
TABLE = RigidTransform.of([0.05, -0.02, 0.4], [900, 100, 50], "base", "turntable")
ANGLES_DEG = np.arange(8) * 45.0


@lru_cache(maxsize=4)
def _scans(direction: int, kind: str) -> tuple[list[dict[str, Any]], dict[str, bytes]]:
    """Scans of the sphere on the table: the robot stands still, the table turns."""
    rng = np.random.default_rng(7)
    files: dict[str, bytes] = {}
    captures = []
    for k, degrees in enumerate(ANGLES_DEG):
        angle = direction * np.deg2rad(degrees)
        turned = RigidTransform.of([0, 0, angle], [0, 0, 0], "turntable", "turntable")
        view = sphere_scans.nominal_poses(8)[k]
        base_from_laser = TABLE @ turned @ RigidTransform(view, "turntable", "laser")
        tool0 = base_from_laser @ TOOL.inverse()
        scan = sphere_scans.scan_sphere("", view, view, 0.5, rng)
        points = scan.points_in_laser_mm
        capture = {"id": f"s{k}", "step": "scan", "kind": kind, "table_deg": float(degrees)}
        if kind == "sweep":
            poses, names = [], []
            for row, profile in enumerate(points):
                name = f"captures/s{k}-{row:02d}.csv"
                lines = [f"{x:.4f}," + ("" if np.isnan(z) else f"{z:.4f}") for x, _, z in profile]
                files[name] = ("x_mm,z_mm\n" + "\n".join(lines)).encode()
                names.append(name)
                shift = RigidTransform.of([0, 0, 0], [0, float(profile[0, 1]), 0], "laser", "laser")
                poses.append((base_from_laser @ shift @ TOOL.inverse()).matrix.ravel().tolist())
            captures.append({**capture, "files": names, "poses": poses})
        else:
            name = f"captures/s{k}.xyz"
            kept = points[np.isfinite(points[..., 2])]
            files[name] = "\n".join(" ".join(f"{v:.4f}" for v in p) for p in kept).encode()
            captures.append({**capture, "files": [name], "pose": tool0.matrix.ravel().tolist()})
    return captures, files


def session(direction: int = 1, kind: str = "sweep", **merge: object) -> tuple[Session, dict[str, bytes]]:
    """Return a session of such scans with a known tool and table."""
    captures, files = _scans(direction, kind)
    cell = {
        "pose_convention": "matrix",
        "scanner": {"point_sigma_mm": sphere_scans.POINT_SIGMA_MM},
        "turntable": {"direction": direction},
        "known": {"tool0_from_laser": TOOL.to_rows(), "base_from_turntable": TABLE.to_rows()},
        "merge": {"voxel_mm": 0.5, "mesh": "none", **merge},
    }
    record = {"format": "scancell-session/1", "cell": cell, "captures": captures}
    return Session.model_validate(record), dict(files)


def solve(given: tuple[Session, dict[str, bytes]], **options) -> MergeResult:
    result = run(given[0], given[1].__getitem__, "merge", **options)["merge"]
    assert isinstance(result, MergeResult)
    return result


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(("direction", "kind"), [(1, "sweep"), (-1, "sweep"), (1, "cloud")])
def test_scans_land_where_the_sphere_is_in_the_turntables_frame(direction: int, kind: str, tmp_path: Path):
    result = solve(session(direction, kind), store=lambda name, pieces: write_pieces(tmp_path / name, pieces))
    points = parse_cloud((tmp_path / CLOUD_FILE).read_bytes(), CLOUD_FILE)
    assert (len(points), result.frame, result.cloud) == (result.points, "turntable", CLOUD_FILE)
    distance = np.linalg.norm(points - sphere_scans.CENTER_MM, axis=1) - sphere_scans.RADIUS_MM
    assert np.sqrt(np.mean(distance**2)) < 1.5 * sphere_scans.POINT_SIGMA_MM
    assert result.overlap_rms_mm is not None
    assert result.expected_overlap_rms_mm is not None
    assert 0.5 < result.overlap_rms_mm / result.expected_overlap_rms_mm < 1.5
    assert [row.capture for row in result.residuals] == [f"s{k}" for k in range(8)]
    assert all(row.used and row.kept > 500 for row in result.residuals)
    assert result.verdict == "pass"


@pytest.mark.thorough
def test_a_mesh_is_stored_beside_the_cloud(tmp_path: Path):
    result = solve(session(mesh="poisson"), store=lambda name, pieces: write_pieces(tmp_path / name, pieces))
    assert (result.mesh, (tmp_path / MESH_FILE).is_file()) == (MESH_FILE, True)
    assert result.triangles > 1000


@pytest.mark.thorough
def test_a_wrong_table_angle_stands_out():
    given, files = session()
    captures = list(given.captures)
    captures[3] = captures[3].model_copy(update={"table_deg": 135.7})
    result = solve((given.model_copy(update={"captures": captures}), files))
    assert result.verdict == "warn"
    (told,) = result.warnings  # one cause, one line
    assert told.startswith("Far off where they overlap the others: s3 (")


@pytest.mark.thorough
def test_registration_reports_what_it_did():
    result = solve(session(registration=True))
    assert result.registered_overlap_rms_mm is not None
    assert all(row.shift_mm is not None and row.shift_mm < 0.1 for row in result.residuals)


def test_excluded_scans_stay_out_and_have_a_row():
    given, files = session()
    captures = [given.captures[0].model_copy(update={"excluded": True}), *given.captures[1:]]
    result = solve((given.model_copy(update={"captures": captures}), files))
    assert (result.residuals[0].used, result.residuals[0].reason) == (False, "excluded by the user")
    assert result.residuals[1].used


@pytest.mark.parametrize(
    ("update", "words"),
    [
        ({"table_deg": None}, r"s2: need the table's angle"),
        ({"poses": [np.eye(4).ravel().tolist()]}, r"s2: need as many poses as files"),
    ],
)
def test_what_a_scan_lacks_is_named(update: dict, words: str):
    given, files = session()
    captures = [c.model_copy(update=update) if c.id == "s2" else c for c in given.captures]
    with pytest.raises(InputError, match=words):
        solve((given.model_copy(update={"captures": captures}), files))


def test_a_profile_of_another_size_is_named():
    given, files = session()
    name = given.captures[1].files[5]
    files[name] = files[name][: files[name].rindex(b"\n")]
    with pytest.raises(InputError, match=rf"{name}: need \d+ columns, like the scan's first profile"):
        solve((given, files))


def test_a_scan_of_blanks_alone_is_named():
    given, files = session()
    for name in given.captures[1].files:
        files[name] = b"x_mm,z_mm\n" + b"\n".join(b"%d," % k for k in range(50))
    with pytest.raises(InputError, match=r"s1: need a scan with points, got \d+ blanks"):
        solve((given, files))


@pytest.mark.parametrize(
    ("known", "words"),
    [
        ({"tool0_from_laser": TOOL.to_rows()}, "need the turntable"),
        ({"base_from_turntable": TABLE.to_rows()}, "need the scanner's pose on the flange"),
    ],
)
def test_a_missing_calibration_is_named(known: dict, words: str):
    given, files = session()
    data = given.to_json()
    data["cell"]["known"] = known
    with pytest.raises(CalibrationError, match=words):
        solve((Session.model_validate(data), files))


@pytest.mark.thorough
def test_a_full_disk_is_named_and_nothing_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(_handle: int, _data: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.write", full)
    with pytest.raises(InputError, match="No space left on device"):
        solve(session(), store=lambda name, pieces: write_pieces(tmp_path / name, pieces))
    monkeypatch.undo()
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_the_result_is_stale_when_a_scan_changes():
    given, files = session()
    before = inputs_sha256(given, "merge", files.__getitem__)
    files[given.captures[0].files[0]] += b"\n"
    assert inputs_sha256(given, "merge", files.__getitem__) != before


def test_single_profiles_at_one_table_angle_are_one_scan():
    given, _ = session()
    single = [
        {"id": f"p{k}", "step": "scan", "kind": "profile", "files": ["a.csv"], "table_deg": float(k // 3)}
        for k in range(6)
    ]
    data = given.to_json()
    data["captures"] = [*single, data["captures"][0]]
    groups = scan_groups(Session.model_validate(data).captures)
    assert [group.name for group in groups] == ["p0…p2", "p3…p5", "s0"]


def test_a_table_that_turns_from_profile_to_profile_takes_them_along_in_one_scan():
    given, _ = session()
    data = given.to_json()
    turned = [0.0, 4.0, 8.0, 12.0, 90.0, 90.0, 90.0, 180.0, 180.0]
    data["captures"] = [
        {"id": f"p{k}", "step": "scan", "kind": "profile", "files": ["a.csv"], "table_deg": at}
        for k, at in enumerate(turned)
    ]
    for some, names in ((data["captures"][:4], ["p0…p3"]), (data["captures"][4:], ["p4…p6", "p7…p8"])):
        groups = scan_groups(Session.model_validate({**data, "captures": some}).captures)
        assert [group.name for group in groups] == names


def test_a_linear_axis_takes_profiles_along_in_one_scan_or_stands_still_for_each():
    given, _ = session()
    data = given.to_json()
    stood = [0.0, 0.0, 0.0, 900.0, 900.0, 901.0, 902.0]
    data["captures"] = [
        {"id": f"p{k}", "step": "scan", "kind": "profile", "files": ["a.csv"], "axes_mm": {"rail": at}}
        for k, at in enumerate(stood)
    ]
    data["cell"] = {**data["cell"], "axes": [{"name": "rail", "kind": "linear", "carries": "robot"}]}
    for some, names in ((data["captures"][:5], ["p0…p2", "p3…p4"]), (data["captures"][4:], ["p4…p6"])):
        groups = scan_groups(Session.model_validate({**data, "captures": some}).captures)
        assert [group.name for group in groups] == names


@pytest.mark.thorough
def test_scans_of_single_profiles_are_merged_as_sweeps_are(tmp_path: Path):
    given, files = session()
    record = given.to_json()
    record["captures"] = [
        {
            "id": f"{sweep.id}-{row:02d}", "step": "scan", "kind": "profile", "files": [name], "pose": pose,
            "table_deg": sweep.table_deg,
        }
        for sweep in given.captures
        for row, (name, pose) in enumerate(zip(sweep.files, sweep.poses or (), strict=True))
    ]  # fmt: skip
    single = Session.model_validate(record), files
    result = solve(single, store=lambda name, pieces: write_pieces(tmp_path / name, pieces))
    assert (result.points, result.verdict) == (solve((given, files)).points, "pass")
    assert result.scan_names == tuple(f"s{k}-00" for k in range(8))
    stored = read_stored_ply((tmp_path / CLOUD_FILE).read_bytes(), CLOUD_FILE)
    assert stored.scans is not None
    assert {*range(8)} <= {*stored.scans.tolist()} <= {*range(-1, 8)}


def test_an_organised_pcd_keeps_its_grid():
    given, _ = session()
    pose = given.captures[0].poses[0]  # type: ignore[index]
    points = np.random.default_rng(0).normal(size=(4, 5, 3)).astype("<f4")
    points[1, 2] = np.nan
    header = (
        "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 5\nHEIGHT 4\n"
        "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 20\nDATA binary\n"
    )
    data = given.to_json()
    capture = {"id": "c", "step": "scan", "kind": "cloud", "files": ["c.pcd"], "pose": pose, "table_deg": 0.0}
    data["captures"] = [capture]
    record = Session.model_validate(data)
    files = {"c.pcd": header.encode() + points.tobytes()}
    scan = read_scan(record, scan_groups(record.captures)[0], Placement(TOOL, TABLE), files.__getitem__)
    assert scan.organised
    np.testing.assert_array_equal(scan.points_in_laser_mm, points)


def test_the_moves_of_a_scan_by_tool_table_and_arm_are_those_of_finite_steps():
    rng = np.random.default_rng(3)
    pose = RigidTransform.of(rng.normal(size=3), 500 * rng.normal(size=3), "base", "tool0")
    turn = RigidTransform.of([0, 0, -0.7], [0, 0, 0], "turntable", "turntable")
    point = np.array([5.0, 0.0, 180.0])
    calibration = Calibration(Placement(TOOL, TABLE), np.zeros((15, 15)), 0.05, 2e-4, 1e-4)
    capture = Capture(id="s", step="scan", kind="cloud", files=["captures/s.ply"])
    by_arm = rng.normal(size=(6, 3))
    moves, _ = moves_of_scan(calibration, capture, turn @ TABLE.inverse(), pose, by_arm)

    def place(change: np.ndarray) -> np.ndarray:
        tool, table = TOOL.perturbed(change[:6]), TABLE.perturbed(change[6:12])
        corrected = corrected_pose(pose.rotation, pose.translation_mm, by_arm, change[12:])
        flange = RigidTransform.of(*corrected, "base", "tool0")
        return (turn @ table.inverse() @ flange @ tool).apply(point)

    here = place(np.zeros(15))
    for column in range(15):
        change = np.zeros(15)
        change[column] = 1e-6
        moved = here + np.cross(moves[:3, column], here) * 1e-6 + moves[3:, column] * 1e-6
        np.testing.assert_allclose(place(change), moved, atol=1e-8)
    assert move_of_pose_change(pose.matrix, np.zeros((6, 1))).shape == (6, 1)


@pytest.mark.thorough
def test_beyond_the_memory_allowed_the_merge_goes_by_way_of_the_disk(tmp_path: Path):
    told: list[str] = []
    clouds = {}
    for name, memory_mb in (("memory", 1000.0), ("disk", 0.5)):
        given = session(memory_mb=memory_mb, voxel_mm=0.2)
        result = solve(
            given,
            store=lambda file, pieces, name=name: write_pieces(tmp_path / name / file, pieces),
            progress=lambda _fraction, what: told.append(what),
        )
        points = parse_cloud((tmp_path / name / CLOUD_FILE).read_bytes(), CLOUD_FILE)
        assert len(points) == result.points
        clouds[name] = points[np.lexsort(np.round(points, 2).T)], result
    (whole, in_memory), (pieced, on_disk) = clouds.values()
    assert (in_memory.spills, on_disk.spills > 1) == (0, True)
    np.testing.assert_allclose(pieced, whole, atol=0.02)  # in another order where coordinates nearly agree
    assert on_disk.overlap_rms_mm == in_memory.overlap_rms_mm
    np.testing.assert_allclose(on_disk.high_mm, in_memory.high_mm, atol=1e-5)
    assert any("emptied to the disk" in what for what in told)


@pytest.mark.thorough
def test_a_mesh_that_memory_does_not_allow_is_left_out_with_the_reason():
    result = solve(session(memory_mb=0.5, voxel_mm=0.2, mesh="poisson"), store=lambda _name, pieces: list(pieces))
    assert result.mesh is None
    assert any("cell.merge.memory_mb" in warning for warning in result.warnings)


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(
    ("mistake", "words"),
    [
        (lambda data: data["cell"]["turntable"].update(direction=-1), "turned the other way round"),
        (
            lambda data: [c.update(table_deg=float(np.deg2rad(c["table_deg"]))) for c in data["captures"]],
            "multiplied by 57.3",
        ),
        (lambda data: [c.update(table_deg=30.0) for c in data["captures"]], "All scans have the table angle 30°"),
    ],
)
def test_wrong_table_angles_of_scans_are_named(mistake, words: str):
    given, files = session()
    data = given.to_json()
    mistake(data)
    result = solve((Session.model_validate(data), files))
    assert result.verdict == "fail"
    assert words in result.warnings[0]


@pytest.mark.thorough
def test_clouds_in_metres_are_named():
    given, files = session(kind="cloud")
    metres = {name: np.loadtxt(data.decode().splitlines()) / 1000 for name, data in files.items()}
    shrunk = {
        name: "\n".join(" ".join(f"{v:.7f}" for v in p) for p in table).encode() for name, table in metres.items()
    }
    result = solve((given, shrunk))
    assert any("look like metres" in warning for warning in result.warnings)


@pytest.mark.parametrize("name", ["empty.xyz", "none.ply", "none.pcd"])
def test_a_cloud_without_points_is_named(name: str):
    content = {
        "empty.xyz": b"",
        "none.ply": b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\n"
        b"property float z\nend_header\n",
        "none.pcd": b"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 0\nHEIGHT 1\n"
        b"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 0\nDATA ascii\n",
    }
    given, files = session(kind="cloud")
    captures = [c.model_copy(update={"files": [name]}) if c.id == "s1" else c for c in given.captures]
    with pytest.raises(InputError, match=f"{name}: need .*point"):
        solve((given.model_copy(update={"captures": captures}), {**files, name: content[name]}))


@pytest.mark.thorough
def test_the_cloud_says_which_scan_weighs_most_at_each_point(tmp_path: Path):
    """That is one of those which look at the surface there most squarely."""
    given = session()
    skipped = given[0].model_copy(
        update={"captures": [c.model_copy(update={"excluded": c.id == "s2"}) for c in given[0].captures]}
    )
    result = solve((skipped, given[1]), store=lambda name, pieces: write_pieces(tmp_path / name, pieces))
    assert result.scan_names == ("s0", "s1", "s3", "s4", "s5", "s6", "s7")
    stored = read_stored_ply((tmp_path / CLOUD_FILE).read_bytes(), CLOUD_FILE)
    assert stored.scans is not None
    assert stored.scans.max() == 6
    assert (stored.scans < 0).mean() < 0.02
    views = -np.array([sphere_scans.nominal_poses(8)[int(name[1:])][:3, 2] for name in result.scan_names])
    outward = (stored.points_mm - sphere_scans.CENTER_MM) / sphere_scans.RADIUS_MM
    known = stored.scans >= 0
    cosines = outward[known] @ views.T
    own = cosines[np.arange(len(cosines)), stored.scans[known]]
    assert (own > cosines.max(axis=1) - 0.2).mean() > 0.95


@pytest.mark.thorough
def test_scans_with_each_others_table_angles_are_named():
    simulated = simulate("part", 1)
    data = simulated.session.to_json()
    data["cell"]["merge"] = {"mesh": "none"}
    good = solve((Session.model_validate(data), dict(simulated.files)))
    assert (good.verdict, good.warnings) == ("pass", [])
    second, fifth = data["captures"][1], data["captures"][4]
    second["table_deg"], fifth["table_deg"] = fifth["table_deg"], second["table_deg"]
    wrong = solve((Session.model_validate(data), dict(simulated.files)))
    assert wrong.verdict == "fail"
    assert (wrong.findings[0].code, sorted(wrong.findings[0].captures)) == ("merge-swapped-scans", ["v02", "v05"])
