"""What can be put right in a store: files from a backup, leftovers removed."""

from pathlib import Path

import sqlalchemy as sa

from calib_core.errors import DamagedError, NotFoundError
from calib_core.messages import message, plural
from server.settings import Settings
from server.store.blob_folder import FolderBlobs
from server.store.blob_places import open_blobs
from server.store.doctor import Examination, referring
from server.store.engine import engine_of, reading
from server.store.store_lock import store_lock


def repair(settings: Settings, found: Examination, backup: Path | None) -> list[str]:
    """Mend what an examination found, and say what was done, a sentence each.

    Parameters
    ----------
    settings : Settings
    found : Examination
    backup : Path, optional
        Where damaged and missing files are taken from.

    Raises
    ------
    ConflictError
        If a server uses the store.
    """
    done: list[str] = []
    with store_lock(settings):
        blobs = open_blobs(settings.blob_place)
        if backup is not None:
            kept = FolderBlobs(backup / "blobs")
            for digest in sorted({finding.sha256 for finding in found.findings if finding.sha256}):
                try:
                    blobs.mend(kept.read(digest))
                    done.append(message("the file {digest}… was put back", digest=digest[:12]))
                except (NotFoundError, DamagedError):
                    done.append(message("the file {digest}… is not in the backup", digest=digest[:12]))
        halves = len(blobs.interrupted())
        blobs.clean()
        orphans = set(blobs.digests()) - _referred(settings)
        blobs.remove(orphans, young_s=-1.0)  # no upload is under way
    if halves:
        done.append(
            plural(
                "{count} file of an interrupted upload was removed",
                "{count} files of interrupted uploads were removed",
                by="count",
                count=halves,
            )
        )
    if orphans:
        done.append(
            plural(
                "{count} file that nothing refers to was removed",
                "{count} files that nothing refers to were removed",
                by="count",
                count=len(orphans),
            )
        )
    return done


def _referred(settings: Settings) -> set[str]:
    engine: sa.Engine = reading(engine_of(settings.sql_url))
    try:
        with engine.connect() as connection:
            return {row["sha256"] for row in referring(connection)}
    finally:
        engine.dispose()
