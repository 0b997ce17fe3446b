"""Archives: one zip that loses nothing, that any BagIt tool verifies, and that still computes."""

from pathlib import Path

from calib_core.archive import archive
from calib_core.archive.archive import ArchiveFacts
from calib_core.archive.folder import load_session
from calib_core.archive.stored_results import stored_results
from calib_core.records import Progress
from calib_core.review.replay import Replay
from calib_core.review.replay import replay as replay_session


def pack(folder: str | Path, file: str | Path) -> ArchiveFacts:
    """Write a session folder's archive, which is verified before it gets its name.

    Raises
    ------
    CalibrationError
        If the session cannot be read, or its files cannot be stored.
    """
    return archive.pack(Path(folder), Path(file))


def unpack(file: str | Path, folder: str | Path) -> ArchiveFacts:
    """Write an archive's files as a new folder, all or nothing; its `data` is the session folder.

    Raises
    ------
    CalibrationError
        If the archive is damaged, or the folder stands already.
    """
    return archive.unpack(Path(file), Path(folder))


def verify_archive(file: str | Path) -> ArchiveFacts:
    """Check that an archive is whole and unaltered, and say what it holds; else raise CalibrationError."""
    from calib_core.review.provenance import verify

    return verify(Path(file))


def replay(path: str | Path, progress: Progress | None = None) -> Replay:
    """Solve an archive or a session folder afresh and compare every number with what it holds.

    Raises
    ------
    CalibrationError
        If the archive is damaged, or nothing in it was solved.
    """
    with archive.opened(Path(path)) as folder:
        session, read = load_session(folder)
        tell: Progress = progress or (lambda _fraction, _what: None)
        return replay_session(session, read, stored_results(folder), tell, str(path))
