"""The session that `scancell demo` leaves in the workbench."""

from collections.abc import Mapping
from pathlib import Path

from calib_core.archive.archive import pack
from calib_core.archive.folder import save_session, to_json_bytes, write_result
from calib_core.disk import temporary_folder
from calib_core.records import Result
from calib_core.simulation.session import SimulatedSession


def keep_session(
    simulated: SimulatedSession, results: Mapping[str, Result], made: Mapping[str, bytes], data: Path
) -> str:
    """Store a solved simulated session as an archive brings it, unless it is there already; returns its name.

    Parameters
    ----------
    simulated : SimulatedSession
    results : mapping
        By stage.
    made : mapping
        The files that the stages made, by name.
    data : Path
        The workbench's data folder, which no server uses meanwhile.

    Raises
    ------
    ConflictError
        If a server uses it.
    CalibrationError
        If it cannot be written.
    """
    from server.settings import Settings
    from server.store.archives import add_import, read_import
    from server.store.database import Store
    from server.store.sessions import list_sessions
    from server.store.store_lock import store_lock

    settings = Settings(data=data)
    name = simulated.session.name
    with store_lock(settings), temporary_folder() as temporary:
        store = Store(settings, lambda _event: None)
        try:
            with store.read() as db:
                if any(item["name"] == name for item in list_sessions(db, 1000, None, name)["items"]):
                    return name
            folder = temporary / "session"
            files = {**simulated.files, **made, "truth.json": to_json_bytes(simulated.truth)}
            save_session(folder, simulated.session, files)
            for stage, result in results.items():
                write_result(folder, stage, result, simulated.session)
            archive = temporary / "session.zip"
            pack(folder, archive)
            with archive.open("rb") as file:
                found = read_import(file, store.blobs)
            with store.write() as db:
                add_import(db, found)
        finally:
            store.close()
    return name
