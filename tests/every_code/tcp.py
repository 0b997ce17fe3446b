"""Rows of the tool: a solved session with a figure at either side of its limit, or sessions with a trouble."""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np
from cells import GIVEN, Cell

from calib_core.captures.pitch import suspected_pitch
from calib_core.chain.held import ScannerError
from calib_core.chain.tcp_solution import TcpSolution
from calib_core.chain.undetermined import open_directions
from calib_core.chain.warm_up import WarmUp
from calib_core.findings import Finding
from calib_core.formats.points import parse_profile
from calib_core.records import Capture, Session
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.verdict import doubts_about_two_steps, tcp_findings
from calib_core.stages.tcp.warm_up import drift_findings
from tests.every_code.made import CELL, TCP, Case, made, result_of, session_of, sides, tool_of

PLANE = {"normal": [0.0, 1.0, 0.0], "distance_mm": 100.0}


def right() -> TcpSolution:
    """Return the solution of a right session."""
    return Cell.of("tcp", 1).solve(GIVEN)


def of_spread(direction: int, sigma: float, tolerance: float = 1.0, field: str = "undetermined") -> Case:
    """Return what is said of an answer that is open by so much along a direction."""
    covariance = 1e-8 * np.eye(6)
    covariance[direction, direction] = sigma**2
    found = {field: open_directions(covariance, tolerance)}
    return lambda: tcp_findings(replace(right(), left_open=replace(right().left_open, **found)))


def scattered(solution: TcpSolution, **values: float) -> TcpSolution:
    """Return a solution whose poses scatter so."""
    noise = solution.noise
    return replace(solution, noise=replace(noise, sigmas=replace(noise.sigmas, **values)))


def of_sigmas(**values: float) -> Case:
    """Return what is said of an answer whose poses scatter so."""
    return lambda: tcp_findings(scattered(right(), **values))


def of_error(name: str) -> Case:
    """Return what is said of an answer whose scanner or arm has such an error."""

    def case() -> Iterable[Finding]:
        found = right()
        error = ScannerError(name, 0.01, 0.001)
        return tcp_findings(replace(found, held=replace(found.held, errors=(error,))))

    return case


def of_weight(weight: float) -> Case:
    """Return what is said where one capture counts so much."""

    def case() -> Iterable[Finding]:
        weights = right().each.weights.copy()
        weights[np.flatnonzero(right().each.used)[0]] = weight
        return tcp_findings(replace(right(), each=replace(right().each, weights=weights)))

    return case


def of_captures(count: int) -> Case:
    """Return what is said of an answer from so many captures."""

    def case() -> Iterable[Finding]:
        found = right()
        names, weights = found.each.ids[:count], found.each.weights[:count]
        few = replace(found.each, ids=names, weights=weights, used=np.ones(count, bool))
        return tcp_findings(replace(found, each=few))

    return case


def two_steps(times: float) -> Case:
    """The paper's two steps off a right answer by so many times its ±, known to a micrometre."""

    def case() -> Iterable[Finding]:
        found = Cell.of("tcp-centers", 1).solve(GIVEN)
        shift = np.array([0, 0, 0, times * found.in_view.stated_mm, 0, 0])
        off = replace(found.joint, mount_from_laser=found.joint.mount_from_laser.perturbed(shift))
        two_steps = replace(found.by_two_steps, answer=off, beside_joint=1e-6 * np.eye(6))
        return doubts_about_two_steps(replace(found, by_two_steps=two_steps))

    return case


def drift(times: float) -> Case:
    """Return what is said of a drift whose least size is so many times what the answer has room for."""

    def case() -> Iterable[Finding]:
        size = times * 2 * right().in_view.stated_mm
        none = np.zeros(0)
        found = WarmUp(
            "scanner", size, 0.0, True, True, False, 0.2, ("p01",), ("p01",), none, none, none, none, 1e-9
        )
        return drift_findings(replace(right(), beside=replace(right().beside, warm_up=found)))

    return case


def pitch(times: float, known: dict[str, Any]) -> Case:
    """Return what frames of the ball say of a board's pitch that makes all lengths so many times too large."""

    def seen(_session: Session, capture: Capture, _read: object) -> np.ndarray:
        return times * parse_profile(CELL.files[capture.files[0]], capture.files[0])

    def case() -> Iterable[Finding]:
        board = {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 9.0}
        session = session_of([{**c, "kind": "frame"} for c in TCP], board=board, known=known)
        with patch("calib_core.captures.pitch.read_profile_frame", seen):
            found = suspected_pitch(session, session.captures, CELL.files.__getitem__)
        return [] if found is None else [found]

    return case


def untold(*, side: str | None = None) -> Case:
    """Return what the tcp stage says of one line of profiles, of whose captures one may tell its side."""

    def case() -> Iterable[Finding]:
        simulated = made("linear-turntable")
        captures = [one.model_copy(update={"side": None}) for one in simulated.session.captures]
        captures[0] = simulated.session.captures[0] if side else captures[0]
        session = simulated.session.model_copy(update={"captures": captures})
        return solve_stage(session, "tcp", simulated.files.__getitem__).findings

    return case


verdict = partial(sides, tcp_findings, right)

CASES: dict[str, tuple[Case, Case]] = {
    "poses-do-not-fit": (of_sigmas(position_mm=2.6), of_sigmas(position_mm=2.4)),
    "tool-rotation-undetermined": (of_spread(0, np.deg2rad(2.1)), of_spread(0, np.deg2rad(1.9))),
    "tool-rotation-about-travel": (result_of("linear-turntable"), result_of("gantry")),
    "tool-mirrored": (untold(), untold(side="told")),
    "tool-position-undetermined": (of_spread(3, 5.1), of_spread(3, 4.9)),
    "tool-rotation-weak": (tool_of("scanner: shear of 2 %"), tool_of("arms: clean")),
    "tool-position-without-turns": (result_of("gantry"), result_of("tcp")),
    "tool-place-not-needed": (result_of("gantry-turntable", "chain"), result_of("gantry")),
    "tool-position-weak": (of_spread(3, 1.1, 0.2, "weak"), of_spread(3, 0.9, 0.2, "weak")),
    "captures-contradict": (tool_of("sphere: moved by 3 mm in one capture"), tool_of("arms: clean")),
    "many-captures-contradict": (tool_of("books: tool changed midway by 2 mm, 1°"), tool_of("arms: clean")),
    "sphere-side-open": verdict("each.side_choice.log_odds", 4.9, 5.1),
    "few-captures": (of_captures(5), of_captures(6)),
    "two-steps-differ": (two_steps(1.1), two_steps(0.9)),
    "scatter-beyond-told": verdict("beside.excess", 1.5, 1.0),
    "point-noise-differs": verdict("noise.measured_point_sigma_mm", 0.041, 0.039),
    "poses-scatter": (of_sigmas(position_mm=1.1), of_sigmas(position_mm=0.9)),
    "scanner-bow": (of_error("bow"), of_error("shear")),
    "scanner-shear": (tool_of("scanner: shear of 2 %"), tool_of("arms: clean")),
    "scanner-scale-off": (tool_of("scanner: x 1 % too long"), tool_of("scanner: rim of a cheap sensor", 1)),
    "sphere-diameter-told": (result_of("tcp"), result_of("tcp-centers")),
    "captures-count-less": (of_weight(0.49), of_weight(0.51)),
    "sheet-bent": (
        tool_of("scanner: sheet of light bent by 0.4 mm, 60 captures"),
        tool_of("scanner: bow of 0.05 mm"),
    ),
    "drift-in-session": (drift(1.1), drift(0.9)),
    "drift-covered": (drift(0.9), drift(1.1)),
    "board-pitch-doubtful": (pitch(1.1, {}), pitch(1.1, {"laser_plane": PLANE})),
}
