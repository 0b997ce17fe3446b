"""Of several scanners the one whose captures are being taken, and those that have none yet."""

from collections import Counter
from typing import Final

from calib_core.cell.carriers import of_one_scanner, scanner_name
from calib_core.cell.found import mounts_of
from calib_core.records import Session

_LEAST: Final = 5  # captures from which a scanner is found whatever the motions


def in_hand(session: Session, step: str = "tcp") -> Session:
    """Return a session of several scanners as that one has it whose captures of a step are being taken."""
    scanners = session.cell.scanners or {}
    own = [c for c in session.captures if c.step == step and not c.excluded and c.pose is not None]
    if len(scanners) < 2 or not own:
        return session
    return only_scanner(session, of_one_scanner(own, _LEAST)[-1].scanner or next(iter(scanners)), step)


def scanners_left(session: Session, *, solved: bool) -> list[str]:
    """Return the scanners of several that took too few captures, none once they are solved, and are not known."""
    taken = Counter(scanner_name(session.cell, c) for c in session.captures if not c.excluded)
    known, least = mounts_of(session.cell.known.frames or []), 1 if solved else _LEAST
    several = len(session.cell.scanners or {}) > 1
    return [one for one in session.cell.scanners or () if several and one not in known and taken[one] < least]


def only_scanner(session: Session, name: str, step: str = "tcp") -> Session:
    """Return a session of several scanners as one of them has it, by its captures of a step."""
    scanners = session.cell.scanners or {}
    cell = session.cell.model_copy(update={"scanners": {name: scanners[name]}})
    captures = [c for c in session.captures if c.step != step or scanner_name(session.cell, c) == name]
    return session.model_copy(update={"cell": cell, "captures": captures})
