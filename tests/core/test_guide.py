"""The guide: the next step follows from the captures alone, and following it ends with a solvable session."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib_core.captures.measure import measure_capture
from calib_core.frames import RigidTransform, rotation_from_vector, vector_from_rotation
from calib_core.graph.keys import Graph
from calib_core.records import Guide, Measured, Session
from calib_core.robots import parse_pose, to_pose
from calib_core.simulation import simulate
from calib_core.stages.guide import guide
from calib_core.stages.tcp.guide import _seen
from calib_core.stages.tcp.motion import nearest_turn_rad

HOME = RigidTransform.of(
    Rotation.from_euler("xyz", [170, 5, 30], degrees=True).as_matrix(), [900, 100, 800], "base", "tool0"
)


def session_of(poses: list[RigidTransform], **cell: Any) -> Session:
    captures = [
        {
            "id": f"p{k + 1:02d}",
            "step": "tcp",
            "kind": "profile",
            "files": [f"captures/p{k + 1:02d}.csv"],
            "pose": to_pose("kuka", p),
        }
        for k, p in enumerate(poses)
    ]
    base = {"pose_convention": "kuka", "sphere_diameter_mm": 40.0, "scanner": {"kind": "profile"}}
    return Session.model_validate({"format": "scancell-session/1", "cell": base | cell, "captures": captures})


def good(session: Session) -> list[Measured]:
    return [Measured(capture=c.id, kind=c.kind, verdict="pass") for c in session.captures]


def guided(session: Session, results: dict[str, Any] | None = None) -> Guide:
    return guide(session, good(session), results or {}, Graph(session, str).stale(results or {}))


def shifted(*offset_mm: float) -> RigidTransform:
    return HOME.perturbed([0, 0, 0, *offset_mm])


def turned(*degrees: float) -> RigidTransform:
    return HOME.perturbed([*np.radians(degrees), 3, -2, 5])


def result_of(session: Session, **more: Any) -> dict[str, Any]:
    rows = [{"capture": c.id, "used": True, "reason": None} for c in session.captures if c.step == "tcp"]
    key = Graph(session, str).key("tcp")
    base = {
        "stage": "tcp",
        "inputs_sha256": key,
        "verdict": "pass",
        "warnings": [],
        "undetermined": [],
        "residuals": rows,
    }
    return base | {"sphere_center_in_base_mm": [900.0, 120.0, 400.0]} | more


SHIFTS = [shifted(40, 0, 0), shifted(0, 40, 0), shifted(0, 0, 40)]
TURNS = [turned(*t) for t in ([20, 0, 0], [0, 20, 0], [0, 0, 25], [-20, 0, 0], [0, -20, 0], [0, 0, -25])]


def test_following_the_suggested_poses_ends_with_solve() -> None:
    poses = [HOME]
    stages: list[str] = []
    for _ in range(20):
        now = guided(session_of(poses)).current
        stages.append(now.drawing)
        if now.action == "solve":
            break
        assert now.suggested_pose is not None
        assert now.suggested_pose_numbers is not None
        pose = RigidTransform(np.array(now.suggested_pose), "base", "tool0")
        from_numbers = parse_pose("kuka", now.suggested_pose_numbers)
        np.testing.assert_allclose(from_numbers.matrix, pose.matrix, atol=1e-4)
        poses.append(pose)
    assert stages == ["tcp-shift"] * 3 + ["tcp-turn"] * 6 + ["tcp-solve"]
    shifts = np.array([HOME.rotation.T @ (p.translation_mm - HOME.translation_mm) for p in poses[1:4]])
    np.testing.assert_allclose(
        np.abs(np.linalg.det(shifts / np.linalg.norm(shifts, axis=1)[:, None])), 1, atol=1e-9
    )
    lengths = np.linalg.norm(shifts, axis=1)
    assert ((lengths >= 30 - 1e-9) & (lengths <= 80)).all()


def test_the_simulated_session_needs_less_with_every_capture() -> None:
    session = simulate("tcp", 4).session
    needed, actions = [], []
    for count in range(len(session.captures) + 1):
        now = guided(session.model_copy(update={"captures": session.captures[:count]})).current
        needed.append(now.still_needed)
        actions.append(now.action)
    assert needed[:5] == [10, 3, 2, 1, 6]
    assert needed[4:11] == [6, 5, 4, 3, 2, 1, 0]
    assert actions == ["capture"] * 10 + ["solve"] * 5


PARALLEL = [shifted(40, 0, 0), shifted(60, 2, 0), shifted(-40, 0, 0)]
ONE_AXIS = [turned(a, 0, 0) for a in (10, 20, 30, -10, -20, -30)]


@pytest.mark.parametrize(
    ("poses", "drawing", "progress", "words"),
    [
        ([], "tcp-first", "0 of 10 captures", "stripe over the sphere"),
        ([HOME], "tcp-shift", "0 of 3 shifts", "Keep its orientation"),
        ([HOME, shifted(5, 0, 0)], "tcp-shift", "0 of 3 shifts", "Shift the scanner 30–80 mm"),
        ([HOME, *PARALLEL], "tcp-shift", "3 of 3 shifts", "parallel"),
        ([HOME, *SHIFTS], "tcp-turn", "0 of 6 turns", "Turn the flange"),
        ([HOME, *SHIFTS, turned(2, 0, 0)], "tcp-turn", "0 of 6 turns", "Turn the flange"),
        ([HOME, *SHIFTS, *ONE_AXIS], "tcp-turn", "6 of 6 turns", "one axis"),
        ([HOME, *SHIFTS, turned(20, 0, 0), turned(20.1, 0, 0)], "tcp-turn", "1 of 6 turns", "Turn the flange"),
        ([HOME, *SHIFTS, *TURNS], "tcp-solve", "enough captures", "Solve"),
        ([*TURNS, *SHIFTS, HOME], "tcp-solve", "enough captures", "Solve"),
    ],
)  # fmt: skip
def test_what_is_asked_follows_from_the_poses(
    poses: list[RigidTransform], drawing: str, progress: str, words: str
) -> None:
    now = guided(session_of(poses)).current
    assert (now.drawing, now.progress) == (drawing, progress)
    assert words in now.instruction
    assert now.why
    assert now.exit
    assert (now.still_needed > 0) == (now.action == "capture")


def test_many_orientations_do_without_shifts() -> None:
    rng = np.random.default_rng(3)
    poses = [turned(*rng.uniform(-30, 30, 3)) for _ in range(12)]
    assert guided(session_of(poses[:11])).current.drawing == "tcp-shift"
    assert guided(session_of(poses)).current.action == "solve"


def test_captures_without_the_sphere_do_not_count_and_excluded_ones_neither() -> None:
    session = session_of([HOME, *SHIFTS])
    measured = good(session)
    measured[3] = Measured(
        capture="p04", kind="profile", verdict="fail", reason="No arc is seen.", to_do="Move it into range."
    )
    found = guide(session, measured, {})
    assert found.current.progress == "2 of 3 shifts"
    assert found.last_capture is not None
    assert (found.last_capture.reason, found.last_capture.to_do) == ("No arc is seen.", "Move it into range.")
    captures = [c.model_copy(update={"excluded": c.id == "p02"}) for c in session.captures]
    assert guided(session.model_copy(update={"captures": captures})).current.progress == "2 of 3 shifts"


def test_a_missing_or_unreadable_pose_comes_first() -> None:
    session = session_of([HOME, *SHIFTS])
    for pose, words in ((None, "It has none"), ([1.0, 2.0], "got 2 numbers")):
        captures = [c.model_copy(update={"pose": pose}) if c.id == "p03" else c for c in session.captures]
        now = guided(session.model_copy(update={"captures": captures})).current
        assert "p03" in now.instruction
        assert words in now.why


def test_statuses_on_the_way() -> None:
    def statuses(session: Session, results: dict[str, Any] | None = None) -> dict[str, str]:
        return {s.step: s.status for s in guided(session, results).steps}

    empty, full = session_of([]), session_of([HOME, *SHIFTS, *TURNS])
    assert statuses(empty) == {
        "camera": "not-needed", "laser-plane": "not-needed", "tcp": "todo",
        "turntable": "not-needed", "verify": "later", "scan": "later", "merge": "later",
    }  # fmt: skip
    assert statuses(full)["tcp"] == "working"
    after = statuses(full, {"tcp": result_of(full)})
    wanted = ("done", "not-needed", "todo", "later")
    assert (after["tcp"], after["turntable"], after["verify"], after["merge"]) == wanted
    assert statuses(full, {"tcp": result_of(full, verdict="fail")})["tcp"] == "failing"
    assert statuses(full, {"tcp": result_of(full, stale=True)})["tcp"] == "stale"
    fewer = session_of([HOME, *SHIFTS, *TURNS[:-1]])
    assert statuses(full, {"tcp": result_of(fewer)})["tcp"] == "stale"
    known = session_of([], known={"tool0_from_laser": np.eye(4).tolist()})
    assert statuses(known)["tcp"] == "known"
    assert guided(known).current.step == "verify"
    frames = session_of([], scanner={"kind": "frame"})
    assert (statuses(frames)["camera"], statuses(frames)["tcp"]) == ("todo", "later")
    assert guided(frames).current.step == "camera"


def test_after_solving_the_result_decides() -> None:
    session = session_of([HOME, *SHIFTS, *TURNS])

    def now(**more: Any) -> Any:
        return guided(session, {"tcp": result_of(session, **more)}).current

    assert (now().action, now().drawing) == ("review", "tcp-done")
    assert now(stale=True).action == "solve"
    assert "again" in now(stale=True).instruction
    open_direction = [{"direction": [0, 1, 0, 0, 0, 0], "description": "the scanner's rotation about y: tilt it"}]
    assert now(undetermined=open_direction).action == "capture"
    assert "rotation about y: tilt it" in now(undetermined=open_direction).instruction
    assert "not use" in now(verdict="fail", warnings=["The residuals are too large"]).instruction
    assert now(verdict="fail", warnings=["The residuals are too large"]).why == "The residuals are too large."
    rows = [{"capture": c.id, "used": c.id not in ("p02", "p05")} for c in session.captures]
    assert "why p02 and p05 were left out" in now(residuals=rows).instruction


def test_turns_are_suggested_about_the_sphere_once_it_is_known() -> None:
    center = np.array([900.0, 120.0, 400.0])
    session = session_of([HOME, *SHIFTS])
    stale = result_of(session, stale=True, sphere_center_in_base_mm=center.tolist())
    now = guided(session, {"tcp": stale}).current
    assert now.suggested_pose is not None
    suggested = RigidTransform(np.array(now.suggested_pose), "base", "tool0")
    np.testing.assert_allclose(suggested.inverse().apply(center), HOME.inverse().apply(center), atol=1e-6)
    blind = guided(session).current
    assert blind.suggested_pose is not None
    np.testing.assert_allclose(np.array(blind.suggested_pose)[:3, 3], HOME.translation_mm, atol=1e-6)


def test_no_opinion_on_the_last_capture_before_it_is_measured() -> None:
    session = session_of([HOME])
    assert guide(session, [], {}).last_capture is None
    assert guide(session_of([]), [], {}).last_capture is None


def test_the_nearest_of_many_turns_is_the_smallest_angle_between_them() -> None:
    rng = np.random.default_rng(3)
    turn, *others = rng.uniform(-1, 1, (9, 3))
    one_by_one = [vector_from_rotation(rotation_from_vector(turn).T @ rotation_from_vector(o)) for o in others]
    assert nearest_turn_rad(turn, others) == pytest.approx(min(np.linalg.norm(v) for v in one_by_one), abs=1e-9)
    assert nearest_turn_rad(turn, []) == np.pi


@pytest.mark.thorough(keep=2)
@pytest.mark.parametrize("scenario", ["tcp-centers", "tcp-mixed"])
def test_captures_of_every_kind_are_guided(scenario: str) -> None:
    cell = simulate(scenario, 1)
    measured = [
        measure_capture(cell.session, capture, cell.files.__getitem__) for capture in cell.session.captures
    ]
    for count in (0, 3, 7):
        first = cell.session.model_copy(update={"captures": cell.session.captures[:count]})
        assert guide(first, measured[:count], {}).current.action == "capture"
    assert guide(cell.session, measured, {}).current.action == "solve"


def test_a_profiles_centre_stands_as_far_beside_its_plane_as_its_circle_leaves() -> None:
    session = simulate("tcp", 4).session
    pose = RigidTransform.of(np.eye(3), np.zeros(3), "base", "tool0")
    radius_mm = (session.cell.sphere_diameter_mm or 0.0) / 2

    def center(center_mm: list[float], circle_mm: float | None) -> list[float]:
        seen = Measured(capture="p1", kind="profile", verdict="pass", center_mm=center_mm, radius_mm=circle_mm)
        found = _seen(session.cell, pose, seen)
        assert found is not None
        return found.center_mm.tolist()

    for angle in (0.0, 0.4, 1.2):
        height = radius_mm * np.sin(angle)
        assert center([3.0, 200.0], float(radius_mm * np.cos(angle))) == pytest.approx([3.0, height, 200.0])
    assert center([3.0, 200.0], None) == [3.0, 0.0, 200.0]
    assert center([3.0, 200.0], radius_mm + 1) == [3.0, 0.0, 200.0]
    assert center([3.0, 5.0, 200.0], None) == [3.0, 5.0, 200.0]
