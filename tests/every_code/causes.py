"""Rows of causes: poses, lengths and angles that are told wrongly, beside those that are right."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache

import numpy as np
from wrong_lengths import ANGLES, scaled_files, told_angles
from wrong_poses import Measured, reordered, rewritten, swapped, writer

from calib_core.captures.content import sphere_of
from calib_core.captures.observe import observe_capture
from calib_core.causes.mirror import mirror_causes
from calib_core.causes.poses import pose_causes
from calib_core.causes.scales import scale_causes
from calib_core.causes.session import unsolved_findings
from calib_core.causes.table import direction_findings, table_causes
from calib_core.chain.observations import SphereObservation, SphereSize, TableObservation
from calib_core.chain.start import centers_of, find_start
from calib_core.chain.table_frame import TableFrame
from calib_core.findings import Finding
from calib_core.frames import RigidTransform
from calib_core.records import Session
from tests.every_code.made import CELL, TABLE, Case, made, session_of, tool_of


@cache
def measured() -> Measured:
    """Return a right session's captures of the still sphere, measured."""
    session = made("tcp", 11).session
    read = made("tcp", 11).files.__getitem__
    observations = [observe_capture(session, c, read) for c in session.captures]
    return Measured(session, observations, sphere_of(session.cell, session.captures))


def poses(wrong: Callable[[Session], Session]) -> Case:
    """Return what is said of poses that were told in another way."""

    def case() -> Iterable[Finding]:
        session = wrong(measured().session)
        return pose_causes(session.cell, session.captures, measured().observations, measured().sphere)

    return case


def in_order(order: Callable[[int], list[int]]) -> Case:
    """Return what is said of poses in another order."""
    return poses(lambda session: reordered(session, order(len(session.captures))))


def two_swapped(count: int) -> list[int]:
    """Return an order in which two are exchanged."""
    return swapped(count, np.random.default_rng(5))


def centers(y: float) -> Case:
    """Return what is said of centres whose y is so many times the true one."""

    def case() -> Iterable[Finding]:
        there = centers_of(measured().observations, measured().sphere)
        tool = find_start(there)
        arms = np.einsum("kji,kj->ki", there.rotations, tool.center - there.translations)
        seen = (arms - tool.translation) @ tool.rotation * [1.0, y, 1.0]
        found = [
            replace(o, kind="center", circle_radius_mm=None, center_in_laser_mm=center)
            for o, center in zip(measured().observations, seen, strict=True)
        ]
        return mirror_causes(measured().session, found, measured().sphere)

    return case


def lengths(x: float = 1.0, diameter_mm: float = 40.0) -> Case:
    """Return what is said of profiles that are so many times too wide, of a ball that is told as so large."""

    def case() -> Iterable[Finding]:
        cell = made("tcp", 11)
        files = scaled_files(cell.files, x, 1.0)
        return scale_causes(cell.session, cell.session.captures, files.__getitem__, SphereSize(diameter_mm))

    return case


@cache
def on_table() -> list[SphereObservation]:
    """Return the captures of the ball on a table, measured."""
    session = session_of(TABLE)
    return [observe_capture(session, c, CELL.files.__getitem__) for c in session.captures]


def angles(wrong: Callable[[list[float]], list[float]]) -> Case:
    """Return what is said of the table's angles, told otherwise."""

    def case() -> Iterable[Finding]:
        session = told_angles(session_of(TABLE), wrong)
        tool = RigidTransform(np.array(CELL.truth["tool0_from_laser"]), "tool0", "laser")
        told = [
            TableObservation(seen, float(np.deg2rad(c.table_deg or 0.0)), c.mount or "")
            for seen, c in zip(on_table(), session.captures, strict=True)
        ]
        return table_causes(session.captures, told, SphereSize(40.0), tool)

    return case


def direction(told: int) -> Case:
    """Return what is said where right-handed angles about an axis that points up are told so, or not."""
    up = RigidTransform.of(np.eye(3), np.zeros(3), "base", "turntable")
    cell = session_of(TABLE, turntable={"direction": told}).cell
    return lambda: direction_findings(cell, TableFrame(up, 1, np.zeros((1, 3))))


def in_unit(scenario: str) -> Case:
    """Return the causes of a session whose files are in a unit, unsolved."""
    return lambda: unsolved_findings(made(scenario, 3).session, made(scenario, 3).files.__getitem__)


CASES: dict[str, tuple[Case, Case]] = {
    "moved-sphere": (
        tool_of("sphere: moved by 5 mm for good"),
        tool_of("books: tool changed midway by 2 mm, 1°"),
    ),
    "changed-tool": (
        tool_of("books: tool changed midway by 0.2°", 2),
        tool_of("sphere: moved by 0.5 mm for good"),
    ),
    "swapped-poses": (tool_of("books: two poses swapped"), tool_of("books: a pose is another capture's")),
    "shifted-poses": (tool_of("books: poses shifted by one"), tool_of("books: two poses swapped")),
    "pose-list-order": (in_order(lambda count: list(range(count))[::-1]), in_order(two_swapped)),
    "pose-reading": (
        poses(lambda session: rewritten(session, "fanuc", writer("kuka", 1.0, False))),
        poses(lambda session: rewritten(session, "kuka", writer("kuka", 1.0, False))),
    ),
    "sphere-diameter": (lengths(diameter_mm=44.0), lengths()),
    "scaled-profile": (lengths(x=1.05), lengths()),
    "points-mirrored": (centers(-1.0), centers(1.0)),
    "point-unit": (in_unit("tcp-metres"), in_unit("tcp")),
    "table-direction": (direction(-1), direction(1)),
    "table-angles": (angles(ANGLES["10 % too large"]), angles(list)),
}
