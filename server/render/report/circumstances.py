"""The report's second page: equipment with its certificates, temperatures, documentation, and the cell's data."""

from collections.abc import Iterable
from typing import Any

from calib_core.captures.certificate import captured_until, is_overdue
from calib_core.evidence.numbers import number_text, quantity, quantity_text, with_unit
from calib_core.messages import message
from calib_core.records import Cell, Session
from calib_core.records.policy import Environment, Equipment
from calib_core.robots import CONVENTIONS
from server.render.report.first_page import ON_FIRST_PAGE, Circumstances, Rows, step_title
from server.render.report.words import KINDS, OFTEN_TOLD


def equipment_rows(session: Session, told: Circumstances) -> list[list[str]]:
    """Return each piece of equipment: kind, identification, serial number, certificate, laboratory, dates."""
    until = captured_until(session, told.solved)
    return [_piece(one, until, told) for one in session.cell.equipment or ()]


def _piece(one: Equipment, until: str, told: Circumstances) -> list[str]:
    certificate = one.certificate
    kind = told.language.say(KINDS.get(one.kind, one.kind))
    identification = " ".join(part for part in (one.name, one.model) if part)
    if certificate is None:
        return [kind, identification, one.serial or "", "", "", "", ""]
    due = certificate.due or ""
    return [
        kind,
        identification,
        one.serial or "",
        certificate.number or "",
        certificate.laboratory or "",
        certificate.issued or "",
        told.say("overdue", due=due) if is_overdue(one, until) else due,
    ]


def certificate_files(session: Session) -> list[str]:
    """Return the names of the certificates' files, as they lie beside the session."""
    told = (one.certificate.file for one in session.cell.equipment or () if one.certificate)
    return list(dict.fromkeys(name for name in told if name))


def certificate_rows(session: Session, told: Circumstances) -> list[list[str]]:
    """Return each certificate's file with its SHA-256, by which it is known in the archive."""
    return [[name, told.digests.get(name) or told.say("no file")] for name in certificate_files(session)]


def environment_rows(session: Session, told: Circumstances) -> list[list[str]]:
    """Return temperatures: of the session, and where captures have their own, their range by step."""
    rows = [[told.say("session"), *_temperatures([session.environment])]] if session.environment else []
    for step in dict.fromkeys(capture.step for capture in session.captures):
        own = [c.environment for c in session.captures if c.step == step and c.environment is not None]
        if own:
            rows.append([step_title(step, told.language.say), *map(told.pointed, _temperatures(own))])
    return rows


def _temperatures(told: Iterable[Environment]) -> list[str]:
    found: list[str] = []
    for name in ("ball_c", "air_c", "arm_c"):
        values = sorted(value for one in told if (value := getattr(one, name)) is not None)
        ends = list(dict.fromkeys(f"{value:.1f}" for value in (*values[:1], *values[-1:])))
        found.append(" – ".join(ends) or "–")
    return found


def documentation_rows(session: Session, told: Circumstances) -> Rows:
    """Return what was told that stands on no other page; usual lines are said in the language."""
    elsewhere = (*ON_FIRST_PAGE, "report_number", "replaces_because")
    return [
        (told.say(name) if name in OFTEN_TOLD else name.replace("_", " ").capitalize(), text)
        for name, text in (session.documentation or {}).items()
        if name not in elsewhere
    ]


def cell_rows(cell: Cell, told: Circumstances) -> Rows:
    """Return the cell as it was told."""
    say = told.language.say
    sigma, axis, board = cell.sphere_diameter_sigma_mm, cell.scanner.z_axis, cell.board
    ball = cell.sphere_diameter_mm
    rows: list[tuple[Any, str | None]] = [
        (
            message("Sphere's diameter"),
            None if ball is None else quantity_text(quantity(ball, "mm", sigma or None)),
        ),
        (message("Poses as"), f"{cell.pose_convention}: {CONVENTIONS[cell.pose_convention].numbers}"),
        (message("Scanner's z axis"), axis and say(KINDS[axis])),
        (message("Noise of one point (one sigma)"), _sigma(cell.scanner.point_sigma_mm, "mm")),
        (message("Robot's position (one sigma)"), _sigma(cell.robot.position_sigma_mm, "mm")),
        (message("Robot's orientation (one sigma)"), _sigma(cell.robot.orientation_sigma_deg, "°")),
        (message("Turntable's angle (one sigma)"), _sigma(cell.turntable.angle_sigma_deg, "°")),
        (message("Board"), board and f"{say(KINDS[board.kind])}, {board.columns} × {board.rows}"),
    ]
    as_typed = message("Poses as")
    return [
        (say(label), value if label == as_typed else told.pointed(value))
        for label, value in rows
        if value is not None
    ]


def _sigma(sigma: float | None, unit: str) -> str | None:
    return None if sigma is None else with_unit(number_text(sigma, 4), unit)
