"""Certificates of equipment: which were overdue when it was captured with."""

from datetime import date

from calib_core.findings.codes.circumstances import CERTIFICATE_OVERDUE
from calib_core.records import Finding, Session
from calib_core.records.policy import Equipment

_DATE = len("2026-11-03")


def piece_words(one: Equipment) -> str:
    """Return a piece of equipment by name and serial number, else its kind: these are words of no language."""
    return " ".join(part for part in (one.name, one.serial) if part) or one.kind


def captured_until(session: Session, otherwise: str) -> str:
    """Return the day of the newest capture that tells it (ISO 8601), that of another moment where none does."""
    return max((capture.taken[:_DATE] for capture in session.captures if capture.taken), default=otherwise[:_DATE])


def is_overdue(one: Equipment, on: str) -> bool:
    """Return whether a piece's certificate was due before a day; False where either is not told as a date."""
    due = one.certificate.due if one.certificate is not None else None
    try:
        return bool(due) and date.fromisoformat((due or "")[:_DATE]) < date.fromisoformat(on[:_DATE])
    except ValueError:
        return False


def overdue_certificates(session: Session, otherwise: str) -> list[Finding]:
    """Return a warning for each piece of equipment whose certificate was due before its captures.

    `otherwise` is the moment that counts where no capture tells when it was taken: when it was solved, or now.
    """
    on = captured_until(session, otherwise)
    return [
        CERTIFICATE_OVERDUE(
            where="cell.equipment",
            piece=piece_words(one),
            due=one.certificate.due if one.certificate else "",
            on=on,
        )
        for one in session.cell.equipment or ()
        if is_overdue(one, on)
    ]
