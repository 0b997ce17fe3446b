"""Every code: something that raises it, and something near it that does not."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from io import BytesIO
from typing import Any

import cv2
import numpy as np
import pytest
from cells import GIVEN, Cell

from calib_core.archive.archive import pack_files
from calib_core.archive.bag import open_bag, write_bag
from calib_core.archive.bag_seal import SEAL_FILE
from calib_core.archive.folder import SESSION_FILE, result_data, to_json_bytes
from calib_core.captures.advice import arc_findings
from calib_core.captures.boards import frames_not_used
from calib_core.captures.measure import measure_capture
from calib_core.errors import MeasurementError
from calib_core.exports.answer import Answer
from calib_core.findings import CODES, Finding
from calib_core.findings.codes.faults import FAULT_CODES
from calib_core.findings.reading import as_read
from calib_core.formats.points import parse_profile
from calib_core.frames import RigidTransform
from calib_core.optics.board_refusal import CELL_BOARD, board_words
from calib_core.optics.camera_evidence import coverage_findings
from calib_core.records import LimitChange, Session, Verification, parse_session
from calib_core.review.check import check_session
from calib_core.review.provenance import HISTORY_FILE, verify
from calib_core.review.replay import replay
from calib_core.simulation import simulate
from calib_core.simulation.frame_camera import SimulatedCamera
from calib_core.simulation.frame_cell import as_png
from calib_core.simulation.frame_surfaces import BoardSurface
from calib_core.simulation.frames import Exposure, render
from calib_core.simulation.motion import pose, turn
from calib_core.sphere.arc import fit_arc
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.verdict import doubts_about_two_steps
from calib_core.stages.verify.decision import Estimate, checked, decision_findings
from calib_core.stages.verify.flatness import Plate
from calib_core.stages.verify.limits import limit_findings
from tests.arm_cell import simulate_arm
from tests.plates import Simulated, reflected, told_plate
from tests.trouble import all_table_troubles, all_troubles, troubled, troubled_table
from tests.verified import brought_tool

CELL = simulate("turntable", 2)
TCP = [c for c in CELL.session.to_json()["captures"] if c["step"] == "tcp"]
TABLE = [c for c in CELL.session.to_json()["captures"] if c["step"] == "turntable"]
Case = Callable[[], Iterable[Finding]]


def session_of(captures: list[dict[str, Any]], **cell: Any) -> Session:
    data = CELL.session.to_json()
    return parse_session({**data, "cell": {**data["cell"], **cell}, "captures": captures})


@cache
def of_the_cell() -> list[Finding]:
    return check_session(session_of(TCP), CELL.files.__getitem__)


def check(captures: list[dict[str, Any]] | None = None, **cell: Any) -> Case:
    if captures is None and not cell:
        return of_the_cell
    given = TCP if captures is None else captures
    return lambda: check_session(session_of(given, **cell), CELL.files.__getitem__)


def due(day: str) -> dict[str, Any]:
    return {"kind": "sphere", "serial": "S-1", "certificate": {"number": "K-1", "due": day}}


def filed(name: str) -> dict[str, Any]:
    return {"kind": "sphere", "certificate": {"number": "K-1", "file": name}}


def changed(at: int, **fields: Any) -> list[dict[str, Any]]:
    return [{**c, **fields} if k == at else c for k, c in enumerate(TCP)]


def again(**fields: Any) -> list[dict[str, Any]]:
    return [*TCP, {**TCP[2], "id": "again", **fields}]


def three_balls(shifted_mm: float) -> Case:
    """Return what a plate's captures say, the fourth of them by a pose that is wrong by so much."""

    def case() -> Iterable[Finding]:
        made = simulate("plate", 2)
        data = made.session.to_json()
        pose = data["captures"][3]["pose"]
        data["captures"][3]["pose"] = [pose[0] + shifted_mm, pose[1] - shifted_mm, *pose[2:]]
        return solve_stage(parse_session(data), "tcp", made.files.__getitem__).findings

    return case


def of_scenario(scenario: str) -> Case:
    made = simulate(scenario, 1)
    return tcp_of((made.session, made.files, {}))


def tcp_of(simulated: Simulated) -> Case:
    session, files, _ = simulated
    return lambda: solve_stage(session, "tcp", files.__getitem__).findings


def between(pair: str, mm: float) -> dict[str, Any]:
    return {"sphere_distances": [{"between": [*pair], "mm": mm, "sigma_mm": 0.01}]}


def turned_alike() -> list[dict[str, Any]]:
    """Return captures with the orientation of the first."""
    first = np.array(TCP[0]["pose"][3:])
    return [c for c in TCP if np.allclose(c["pose"][3:], first, atol=1e-3)]


def turned_each() -> list[dict[str, Any]]:
    alike = {c["id"] for c in turned_alike()[1:]}
    return [c for c in TCP if c["id"] not in alike]


def boards() -> Iterable[Finding]:
    def blank(name: str) -> bytes:
        return cv2.imencode(".png", np.full((80, 120), 90 + int(name[-5]), np.uint8))[1].tobytes()

    frames = [{"id": f"f{k}", "step": "camera", "kind": "frame", "files": [f"f{k}.png"]} for k in range(4)]
    board = {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 25.0}
    return check_session(session_of(frames, board=board), blank)


def not_weak() -> Iterable[Finding]:
    weak = {n for f in check()() if f.code == "captures-weak" for n in f.captures}
    return check([c for c in TCP if c["id"] not in weak])()


def in_metres() -> Iterable[Finding]:
    def scaled(name: str) -> bytes:
        points = parse_profile(CELL.files[name], name) / 1000
        return b"x,z\n" + b"\n".join(f"{x:.7f},{z:.7f}".encode() for x, z in points)

    return check_session(session_of(TCP), scaled)


def flat() -> Iterable[Finding]:
    capture = CELL.session.captures[0]
    rows = b"x_mm,z_mm\n" + b"\n".join(f"{x},200.0".encode() for x in range(-40, 40))
    return measure_capture(CELL.session, capture, lambda _: rows).findings


def board_at(aside: float) -> Case:
    """Return what is seen of a board whose middle stands so far aside, in parts of its distance."""

    def case() -> Iterable[Finding]:
        scene = BoardSurface(pose(turn([0.2, 0.1, 0.1]), [240 * aside - 36.0, -22.0, 240.0]), 9, 6, 9.0)
        frame = render(SimulatedCamera(), [scene], None, Exposure(ambient=180.0), np.random.default_rng(0))
        told = {"id": "b01", "step": "camera", "kind": "frame", "files": ["b01.png"]}
        session = session_of([told], board={"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 9.0})
        return measure_capture(session, session.captures[0], lambda _: as_png(frame)).findings

    return case


def other_boards(used: int) -> Case:
    """Return what is said of a frame that shows another board, beside others that are used."""
    need, got = board_words("chessboard", 9, 6), board_words("chessboard", 8, 6)
    failed = {"b01": MeasurementError(need, got, "Correct cell.board.", CELL_BOARD)}
    return lambda: frames_not_used(failed, used)


def first_seen() -> Iterable[Finding]:
    return measure_capture(CELL.session, CELL.session.captures[0], CELL.files.__getitem__).findings


def arc(zone: float, extent_rad: float = 2.0) -> Case:
    def case() -> Iterable[Finding]:
        name, diameter_mm = TCP[0]["files"][0], CELL.session.cell.sphere_diameter_mm
        assert diameter_mm is not None
        points = parse_profile(CELL.files[name], name)
        fit = fit_arc(points, diameter_mm)
        return arc_findings(
            replace(fit, radius_mm=zone * diameter_mm / 2, extent_rad=extent_rad), points, diameter_mm
        )

    return case


def answer(**fields: Any) -> Case:
    tool = RigidTransform.of([0, 0, 0], [1, 2, 3], "tool0", "laser")
    results = {"tcp": {"verdict": "pass"}}
    return lambda: Answer(CELL.session, results, "tcp", tool, np.eye(6), **fields).findings


def decision(value_mm: float, uncertainty_mm: float = 0.1, count: int = 10) -> Case:
    figure = checked("form", Estimate(value_mm, uncertainty_mm), 1.0, count)
    return lambda: decision_findings([figure], count)


def limit(after_mm: float) -> Case:
    change = LimitChange(
        at="2026-01-01T00:00:00Z", who="x", field="tool_mm", before_mm=1.0, after_mm=after_mm, captures=4
    )
    return lambda: limit_findings(Verification(tool_mm=after_mm, changes=[change]))


def plate(turned_deg: float = 30.0, left_out: int = 0) -> Case:
    form = Estimate(0.1, 0.01)
    return lambda: Plate(form, form, [], left_out=left_out, turned_deg=turned_deg).findings


def archived(past: list[Any] | None = None, *, sealed: bool = True) -> Case:
    """Verify an archive, with or without its seal, whose past was edited."""

    def case() -> Iterable[Finding]:
        payload = {**CELL.files, SESSION_FILE: to_json_bytes(CELL.session.to_json()), HISTORY_FILE: b"{}\n"}
        whole, edited = BytesIO(), BytesIO()
        pack_files(CELL.session, payload, whole, "cell")
        with open_bag(whole) as bag:
            seal = b"".join(bag.chunks(SEAL_FILE))
        if past is not None:
            payload[HISTORY_FILE] = to_json_bytes({"results": past})
        write_bag(edited, "cell", payload, {}, lambda _: {SEAL_FILE: seal} if sealed else {})
        return verify(edited).findings

    return case


@cache
def solved() -> Any:
    return solve_stage(CELL.session, "tcp", CELL.files.__getitem__)


def came(provenance: str) -> Case:
    return lambda: map(
        Finding.model_validate, as_read({**result_data(solved()), "provenance": provenance})["findings"]
    )


@cache
def replayed(**fields: Any) -> list[Finding]:
    stored = {"tcp": {**result_data(solved()), **fields}}
    found = replay(CELL.session, CELL.files.__getitem__, stored).stages
    return [stage.finding for stage in found if stage.finding is not None]


def after_replay(**fields: Any) -> Case:
    return lambda: replayed(**fields)


def with_axis(*readings: dict[str, float]) -> Case:
    first = [{**c, "axes_deg": {"tilt": 10.0 * k}} for k, c in enumerate(TCP[: 5 - len(readings)])]
    more = [{**c, **({"axes_deg": read} if read else {})} for c, read in zip(TCP[5:], readings, strict=False)]
    return check([*first, *more], axes=[{"name": "tilt", "kind": "rotary"}])


@cache
def chain_of(trouble: str) -> list[Finding]:
    cell = troubled_table(all_table_troubles()[trouble], 0)
    return solve_stage(cell.session, "chain", cell.files.__getitem__).findings


def moved(trouble: str) -> tuple[Case, Case]:
    return lambda: chain_of(trouble), lambda: chain_of("clean")


def verification(off_mm: float, *, shuffled: bool = False, seed: int = 5, some: Iterable[int] = range(15)) -> Case:
    def case() -> Iterable[Finding]:
        cell = brought_tool(seed, off_mm, shuffled)
        captures = [cell.session.captures[k] for k in some]
        session = cell.session.model_copy(update={"captures": captures})
        return solve_stage(session, "verify", cell.files.__getitem__).findings

    return case


@cache
def tool_of(trouble: str) -> Case:
    @cache
    def case() -> Iterable[Finding]:
        cell = troubled(all_troubles()[trouble], 0)
        return solve_stage(cell.session, "tcp", cell.files.__getitem__).findings

    return case


def two_steps(times: float) -> Case:
    """The paper's two steps off a right answer by so many times its ±, known to a micrometre."""

    def case() -> Iterable[Finding]:
        right = Cell.of("tcp-centers", 1).solve(GIVEN)
        shift = np.array([0, 0, 0, times * right.stated_mm, 0, 0])
        off = replace(right.joint, mount_from_laser=right.joint.mount_from_laser.perturbed(shift))
        return doubts_about_two_steps(replace(right, two_step=off, two_step_covariance=1e-6 * np.eye(6)))

    return case


MOMENT = ("drift", "overdue", "equipment-changed", "verify-undecided")


def of_arm(size: float = 1.0, errors: str | None = None, turned: bool = False) -> Case:
    """What is found of an arm before a tracker; `turned`: its second joint is counted the other way."""

    def found() -> Iterable[Finding]:
        told = simulate_arm("small", 1, 15, size=size, errors=errors, held=0).session.to_json()
        for capture in told["captures"] if turned else []:
            capture["joints_deg"][1] *= -1
        return solve_stage(Session.model_validate(told), "tcp", lambda _name: b"").findings

    return found


CASES: dict[str, tuple[Case, Case]] = {
    "unknown-field": (check(spere_class="G100"), check()),
    "no-tcp-captures": (check(TABLE), check()),
    "no-tcp-captures-yet": (boards, check()),
    "captures-show-nothing": (boards, check()),
    "stage-brought": (check(known={"tool0_from_laser": np.eye(4).tolist()}), check()),
    "sphere-sigma-assumed": (check(sphere_diameter_sigma_mm=None), check(sphere_diameter_sigma_mm=0.002)),
    "captures-too-few": (check(TCP[:3]), check()),
    "captures-weak": (check(), not_weak),
    "capture-duplicate": (check(again()), check(again(files=TCP[3]["files"], pose=TCP[3]["pose"])[:-1])),
    "capture-of-no-ball": (three_balls(35.0), three_balls(0.0)),
    "capture-with-reflection": (tcp_of(reflected(5)), tcp_of(reflected())),
    "spheres-not-all-seen": (tcp_of(told_plate("abcd")), tcp_of(told_plate("abc"))),
    "spheres-more-than-told": (tcp_of(told_plate("ab")), tcp_of(told_plate("abc"))),
    "sphere-distances-not-used": (tcp_of(told_plate("abc", **between("ab", 80.0))), tcp_of(told_plate("abc"))),
    "spheres-named-either-way": (
        tcp_of(told_plate("ab", 2, **between("ab", 61.984))),
        tcp_of(told_plate("ab", 2)),
    ),
    "tool-position-without-turns": (of_scenario("gantry"), of_scenario("tcp")),
    "capture-file-repeated": (check(again(pose=TCP[3]["pose"])), check(again())),
    "pose-convention-likely": (check(pose_convention="quaternion-xyzw"), check()),
    "tilts-too-few": (check(turned_alike()), check()),
    "shifts-few": (check(turned_each()), check()),
    "captures-counted": (check(), check(TABLE)),
    "certificate-file": (check(TCP, equipment=[filed("none.pdf")]), check(TCP, equipment=[due("2999-01-01")])),
    "certificate-overdue": (check(TCP, equipment=[due("2026-01-01")]), check(TCP, equipment=[due("2999-01-01")])),
    "capture-while-moving": (check(changed(0, moving=True)), check(changed(0, moving=False))),
    "capture-of-other-setting": (
        check([{**c, "active_tool": 1 + (k == 0)} for k, c in enumerate(TCP)]),
        check([{**c, "active_tool": 1} for c in TCP]),
    ),
    "input-not-usable": (check(sphere_diameter_mm=None), check()),
    "file-doubtful": (in_metres, check()),
    "capture-shows-nothing": (flat, first_seen),
    "image-not-covered": (lambda: coverage_findings(0.8, 3.1), lambda: coverage_findings(0.8, 2.9)),
    "image-covered-in-part": (lambda: coverage_findings(0.5, 2.9), lambda: coverage_findings(0.61, 2.9)),
    "board-in-part": (board_at(0.33), board_at(0.0)),
    "board-not-as-told": (other_boards(2), other_boards(20)),
    "stripe-through-middle": (arc(0.97), arc(0.93)),
    "stripe-grazes-sphere": (arc(0.42), arc(0.48)),
    "arc-short": (arc(0.7, 1.1), arc(0.7, 1.3)),
    "answer-stale": (answer(stale=True), answer()),
    "answer-failed": (answer(verdict="fail"), answer(verdict="warn")),
    "answer-not-confirmed": (answer(decision="conditional-fail"), answer(decision="conditional-pass")),
    **{FAULT_CODES[name].name: (answer(of_moment=(name,)), answer()) for name in MOMENT},
    "verify-fail": (decision(1.2), decision(1.05)),
    "verify-conditional-fail": (decision(1.05), decision(0.95)),
    "verify-conditional-pass": (decision(0.95), decision(0.85)),
    "verify-undecided": (decision(0.5, count=3), decision(0.5)),
    "verify-limit-eased": (limit(2.0), limit(0.5)),
    "verify-limit-changed": (limit(0.5), limit(2.0)),
    "verify-points-off-ball": (verification(0.3, shuffled=True), verification(1.6)),
    "verify-sides-open": (verification(0.3, seed=6, some=(3, 7)), verification(0.3, seed=6)),
    "plate-not-turned": (plate(turned_deg=8.0), plate(turned_deg=12.0)),
    "points-beside-plate": (plate(left_out=3), plate()),
    "capture-without-axis-reading": (with_axis({}), with_axis({"tilt": 5.0})),
    "table-pushed": moved("pushed by 0.3 mm between the mountings"),
    "table-creeps": moved("creeps by 0.3 mm"),
    "sphere-reseated": moved("sphere slips by 0.5 mm"),
    "clamp-gives": moved("a clamp gives by 0.5 mm"),
    "sheet-bent": (
        tool_of("scanner: sheet of light bent by 0.4 mm, 60 captures"),
        tool_of("scanner: bow of 0.05 mm"),
    ),
    "poses-lag": (tool_of("arms: lags by 0.3 mm along its path"), tool_of("arms: lag of 0.2 mm, any direction")),
    "not-signed": (archived(sealed=False), archived()),
    "seal-broken": (archived([]), archived([], sealed=False)),
    "archive-disagrees": (archived([{"stage": "tcp"}], sealed=False), archived([], sealed=False)),
    "not-replayed": (came("imported"), came("replayed")),
    "replay-differs": (after_replay(verdict="none"), after_replay()),
    "arm-errors-worth-it": (of_arm(), of_arm(size=0.0)),
    "arm-errors-applied": (of_arm(errors="apply"), of_arm(size=0.0, errors="apply")),
    "arm-errors-not-better": (of_arm(size=0.0, errors="apply"), of_arm(errors="apply")),
    "joints-read-otherwise": (of_arm(turned=True), of_arm()),
    "scanner-shear": (tool_of("scanner: shear of 2 %"), tool_of("arms: clean")),
    "scanner-scale-off": (tool_of("scanner: x 1 % too long"), tool_of("arms: clean")),
    "arm-lengths-off": (tool_of("arms: poses 0.5 % too long"), tool_of("arms: clean")),
    "swapped-poses": (tool_of("books: two poses swapped"), tool_of("arms: clean")),
    "moved-sphere": (tool_of("sphere: moved by 5 mm for good"), tool_of("arms: clean")),
    "captures-contradict": (tool_of("sphere: moved by 3 mm in one capture"), tool_of("arms: clean")),
    "shifted-poses": (tool_of("books: poses shifted by one"), tool_of("arms: clean")),
    "drift-covered": (tool_of("sphere: drifts by 0.3 mm"), tool_of("arms: clean")),
    "many-captures-contradict": (tool_of("books: tool changed midway by 2 mm, 1°"), tool_of("arms: clean")),
    "tool-rotation-weak": (tool_of("scanner: shear of 2 %"), tool_of("arms: clean")),
    "two-steps-differ": (two_steps(1.1), two_steps(0.9)),
    "replayed-other-revision": (after_replay(verdict="none", method_revision=0), after_replay(verdict="none")),
}
WITHOUT_A_ROW = """
angles-look-like-radians answer-differs answer-not-replayed arm-lags arm-less-true-than-told axis-direction-weak
axis-mirrored axis-place-undetermined axis-tilt-undetermined axis-wobbles balls-not-told-apart
board-and-sphere-differ board-bent board-corners-covered board-edges-soft board-lines-close
board-looks-the-same-turned board-mirroring-not-seen board-pitch-by-robot board-pitch-doubtful
board-pitch-not-checked board-pitches-differ board-saturated board-shape-solved boards-not-tilted
calibration-changed calibration-holds camera-by-robot-differs camera-model-chosen camera-not-converged
camera-not-refined camera-on-flange-weak capture-files-removed capture-joints-apart capture-not-finite
capture-not-measured capture-not-still capture-of-unknown-scanner capture-waits captures-count-less
chain-table-differs chain-tool-differs changed-tool corners-far-off corners-left-out corners-off-prediction
distortion-folds distortion-terms-at-zero drift-in-session encoder-eccentric encoder-scale expansion-unknown
few-boards-carry-plane few-captures few-poses-repeated few-views focal-length-unsure frame-in-colour
frame-not-used frame-waits-for-calibration frames-in-colour joints-contradict-poses
lag-not-checked length-at-temperature light-plane-outdated line-off-plane many-table-captures-contradict
measuring-failed merge-calibration-failed merge-inside-out merge-no-mesh merge-no-overlap
merge-no-self-calibration merge-nominal-alike merge-nominal-far merge-nominal-not-found merge-one-table-angle
merge-outside-doubtful merge-pose-reading merge-pose-scatter merge-scan-elsewhere merge-scans-alone
merge-scans-apart merge-scans-do-not-fit merge-scans-far-off merge-scans-in-metres merge-swapped-scans
merge-table-direction merge-table-steps most-frames-not-used most-lines-off-plane no-line-on-board one-height
optics-by-tool-alone plane-normal-open plane-normal-weak plane-not-determined plane-through-camera plate-alone
plate-without-limit play-not-checked point-noise-differs point-unit pose-columns-swapped pose-list-order
pose-not-repeated pose-reading poses-do-not-fit poses-not-of-the-flange poses-repeat poses-scatter scaled-profile
scan-of-no-use scanner-bow scatter-beyond-told sphere-diameter sphere-diameter-told sphere-remounted
sphere-side-open stage-not-supported stored-error stored-note stored-warning stripe-beyond-distortion sweep-empty
sweep-few-profiles sweep-of-object sweep-profiles table-angles table-angles-do-not-fit table-angles-not-read
table-angles-repeat table-angles-scatter table-captures-contradict table-direction table-play
table-scatter-beyond-told tcp-doubtful-before tcp-failed-before tilt-and-centre-correlated tool-mirrored
tool-position-undetermined tool-position-weak tool-rotation-about-travel tool-rotation-undetermined
tool-seen-elsewhere-on-table verify-captures-disagree verify-limit-not-checked verify-not-held-out
verify-of-failed-answer verify-scatter-fails verify-scatter-large verify-tool-without-uncertainty view-not-used
"""
"""Codes that have no row here yet; it only shrinks."""


@pytest.mark.parametrize("code", CASES)
def test_a_code_is_raised_and_what_is_near_does_not_raise_it(code: str) -> None:
    raises, near = CASES[code]
    assert code in {finding.code for finding in raises()}
    assert code not in {finding.code for finding in near()}


def test_codes_without_a_row_become_fewer() -> None:
    assert set(CASES) <= set(CODES)
    assert set(CODES) - set(CASES) == set(WITHOUT_A_ROW.split())
