"""Rows of single captures: what is measured in them, at either side of what is said."""

import json
from collections.abc import Iterable
from dataclasses import replace
from functools import cache, partial

import cv2
import numpy as np

from calib_core.captures.advice import arc_findings
from calib_core.captures.measure import measure_capture
from calib_core.captures.measure_frame import board_findings
from calib_core.findings import Finding
from calib_core.formats.points import parse_profile
from calib_core.frames import FloatArray
from calib_core.optics.board import BoardView
from calib_core.records import Capture, Measured, Session, parse_session
from calib_core.review.check import check_session
from calib_core.simulation import TcpScenario
from calib_core.simulation.frame_camera import SimulatedCamera
from calib_core.simulation.frame_cell import as_png
from calib_core.simulation.frame_surfaces import BoardSurface
from calib_core.simulation.frames import Exposure, render
from calib_core.simulation.motion import pose, turn
from calib_core.simulation.profile_cell import build_world, measure, pose_numbers
from calib_core.simulation.writing import profile_csv, session_record
from calib_core.sphere.arc import fit_arc
from server import measuring
from server.captures.measuring_queue import to_wait
from server.store.calibrations import Calibrated
from server.store.history import measured_then
from tests.every_code.made import CELL, TCP, Case, session_of, sides

BOARD = {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 9.0}


def in_metres() -> Iterable[Finding]:
    """Return what a check says of files in metres."""

    def scaled(name: str) -> bytes:
        points = parse_profile(CELL.files[name], name) / 1000
        return b"x,z\n" + b"\n".join(f"{x:.7f},{z:.7f}".encode() for x, z in points)

    return check_session(session_of(TCP), scaled)


def as_told() -> Iterable[Finding]:
    """Return what a check says of the files as they are."""
    return check_session(session_of(TCP), CELL.files.__getitem__)


def flat() -> Iterable[Finding]:
    """Return what is said of a profile of no ball."""
    rows = b"x_mm,z_mm\n" + b"\n".join(f"{x},200.0".encode() for x in range(-40, 40))
    return measure_capture(CELL.session, CELL.session.captures[0], lambda _: rows).findings


def first_seen() -> Iterable[Finding]:
    """Return what is said of a right profile."""
    return measure_capture(CELL.session, CELL.session.captures[0], CELL.files.__getitem__).findings


def arc(zone: float, extent_rad: float = 2.0) -> Case:
    """Return what is said of an arc whose circle is so large a part of the ball's, so far around."""

    def case() -> Iterable[Finding]:
        name, diameter_mm = TCP[0]["files"][0], CELL.session.cell.sphere_diameter_mm
        assert diameter_mm is not None
        points = parse_profile(CELL.files[name], name)
        fit = replace(fit_arc(points, diameter_mm), radius_mm=zone * diameter_mm / 2, extent_rad=extent_rad)
        return arc_findings(fit, points, diameter_mm)

    return case


@cache
def _exposures(movement_mm: float, apart_mm: float, count: int, step: str, blank: bool) -> Measured:
    rng = np.random.default_rng([4, 31])
    world = build_world(TcpScenario(), rng)
    commanded = world.shots[0].commanded
    along = (commanded @ world.tool0_from_laser)[:3, 0]
    numbers, files = pose_numbers(commanded), dict[str, bytes]()
    for k in range(count):
        center = world.sphere_center_in_base_mm + along * movement_mm * rng.standard_normal()
        points: FloatArray = measure("profile", world, commanded, center, rng)[2]
        files[f"captures/{k}.csv"] = b"x_mm,z_mm\n0.0,\n" if blank else profile_csv(points, 1.0)
    record = json.loads(json.dumps(session_record(world, "exposures").to_json()))
    poses = [[numbers[0] + k * apart_mm, *numbers[1:]] for k in range(count)]
    record["captures"] = [{"id": "s", "step": step, "kind": "sweep", "files": [*files], "poses": poses}]
    session = parse_session(record)
    return measure_capture(session, session.captures[0], files.__getitem__)


def sweep(
    movement_mm: float = 0.0, apart_mm: float = 0.0, count: int = 6, step: str = "tcp", blank: bool = False
) -> Case:
    """Return what is said of profiles of one ball that moved so much, from poses so far apart."""
    return lambda: _exposures(movement_mm, apart_mm, count, step, blank).findings


@cache
def image(rows: int = 6, aside: float = 0.0) -> np.ndarray:
    """Return a frame of a board whose middle stands so far aside, in parts of its distance."""
    scene = BoardSurface(pose(turn([0.2, 0.1, 0.1]), [240 * aside - 36.0, -22.0, 240.0]), 9, rows, 9.0)
    return render(SimulatedCamera(), [scene], None, Exposure(ambient=180.0), np.random.default_rng(0))


def frame(rows: int = 6, aside: float = 0.0, *, colour: bool = False) -> Case:
    """Return what is said of a frame of a board."""

    def case() -> Iterable[Finding]:
        seen = image(rows, aside)
        png = cv2.imencode(".png", np.stack([seen, seen // 2, seen], axis=2))[1].tobytes()
        told = {"id": "b01", "step": "camera", "kind": "frame", "files": ["b01.png"]}
        session = session_of([told], board={**BOARD, "rows": rows})
        return measure_capture(session, session.captures[0], lambda _: png if colour else as_png(seen)).findings

    return case


def stripe(**known: object) -> Case:
    """Return what is said of a frame of a stripe, with what is known of camera and plane of light."""

    def case() -> Iterable[Finding]:
        rng = np.random.default_rng(0)
        seen = rng.normal(8, 1, (240, 320))
        seen[118:123] += np.array([20, 120, 200, 120, 20])[:, None]
        png = as_png(np.clip(seen, 0, 255).astype(np.uint8))
        session = session_of([{**TCP[0], "kind": "frame", "files": ["s.png"]}], known=known)
        return measure_capture(session, session.captures[0], lambda _: png).findings

    return case


def view() -> BoardView:
    """Return a board's view with nothing to be said of it."""
    return BoardView(np.zeros((54, 2)), np.zeros((54, 3)), np.arange(54), (640, 480), 0.05, edge_width_px=2.0)


def measured(outdated: bool) -> Iterable[Finding]:
    """Return what is said of a right capture whose plane of light has changed since, or not."""
    right = measure_capture(CELL.session, CELL.session.captures[2], CELL.files.__getitem__)
    return Calibrated(CELL.session, (), outdated).told(right.model_copy(update={"verdict": "pass"})).findings


def by_server(how: str) -> Case:
    """Return what the server notes of a capture whose measuring gives no number, or ends in a fault."""

    def case() -> Iterable[Finding]:
        from unittest.mock import patch

        def given(session: Session, capture: Capture, read: object) -> Measured:
            if how == "fault":
                raise RuntimeError(how)
            found = measure_capture(session, capture, CELL.files.__getitem__)
            return found.model_copy(update={"rms_mm": float(how)})

        with patch("calib_core.captures.measure.measure_capture", given):
            return measuring.measure(CELL.session, CELL.session.captures[0], CELL.files.__getitem__).findings

    return case


def then(*, removed: bool) -> Case:
    """Return what is said of a capture at an earlier moment that was removed since, or is still there."""
    first = CELL.session.captures[0]
    session = CELL.session.model_copy(update={"captures": [first]})
    before = [{"kind": "capture", "capture": first.id, "removed": removed}]
    right = Measured(capture=first.id, kind="profile", verdict="pass")
    return lambda: measured_then({first.id: right}, session, before)[first.id].findings


of_view = partial(sides, board_findings, view)
KNOWN_CAMERA = {"camera_matrix": [[900.0, 0, 160], [0, 900, 120], [0, 0, 1]], "distortion": {}}
KNOWN_PLANE = {"normal": [0.0, 0.94, 0.342], "distance_mm": 100.0}

CASES: dict[str, tuple[Case, Case]] = {
    "capture-shows-nothing": (flat, first_seen),
    "file-doubtful": (in_metres, as_told),
    "stripe-through-middle": (arc(0.97), arc(0.93)),
    "stripe-grazes-sphere": (arc(0.42), arc(0.48)),
    "arc-short": (arc(0.7, 1.1), arc(0.7, 1.3)),
    "capture-not-still": (sweep(movement_mm=0.2), sweep()),
    "sweep-few-profiles": (sweep(apart_mm=0.05, count=4), sweep(apart_mm=0.05, count=5)),
    "sweep-profiles": (sweep(apart_mm=0.05, count=5), sweep(apart_mm=0.05, count=4)),
    "sweep-of-object": (sweep(step="scan"), sweep(step="scan", blank=True)),
    "sweep-empty": (sweep(step="scan", blank=True), sweep(step="scan")),
    "board-edges-soft": of_view("edge_width_px", 6.1, 5.9),
    "board-saturated": of_view("saturated", 0.26, 0.24),
    "frame-in-colour": (frame(colour=True), frame()),
    "board-corners-covered": of_view("left_out", 1, 0),
    "board-in-part": (frame(aside=0.33), frame()),
    "frame-waits-for-calibration": (stripe(), stripe(camera=KNOWN_CAMERA, laser_plane=KNOWN_PLANE)),
    "light-plane-outdated": (partial(measured, True), partial(measured, False)),
    "capture-waits": (lambda: to_wait(CELL.session.captures[0]).findings, first_seen),
    "capture-not-finite": (by_server("nan"), by_server("0.02")),
    "measuring-failed": (by_server("fault"), by_server("0.02")),
    "capture-files-removed": (then(removed=True), then(removed=False)),
}
