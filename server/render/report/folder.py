"""What a report of a session folder tells beside session and results: release and certificates that lie in it."""

import hashlib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from calib_core.archive.folder import past_of
from calib_core.archive.release_file import RELEASE_FILE, acknowledged_told, release_told
from calib_core.errors import CalibrationError
from calib_core.records import ReadFile, Session
from calib_core.review.decided_before import decided_before_in
from calib_core.review.standing import said_acknowledgement, said_signed
from server.render.report.circumstances import certificate_files
from server.render.report.first_page import Circumstances, Data


def circumstances_in(
    folder: Path, session: Session, read: ReadFile, results: Mapping[str, Data], solved: str, **more: Any
) -> Circumstances:
    """Return the circumstances of a folder's report; `more` are its language and paper."""
    content = b""
    with suppress(OSError):
        content = (folder / RELEASE_FILE).read_bytes()
    release = release_told(content, results, solved)
    told = acknowledged_told(content, results, solved)
    acknowledged = [said_signed(said_acknowledgement(one), one) for one in told]
    digests: dict[str, str] = {}
    for name in certificate_files(session):
        with suppress(CalibrationError):
            digests[name] = hashlib.sha256(read(name)).hexdigest()
    before = decided_before_in(past_of(folder), session, results)
    known: Any = {"decided_before": before, "digests": digests, "read": read, **more}
    return Circumstances(solved=solved, release=release, acknowledged=acknowledged, **known)
