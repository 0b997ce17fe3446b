"""A store opened by a command, also while a server uses it."""

import getpass
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from server.settings import Settings
from server.store.audit import Act, acting_as
from server.store.database import Store
from server.store.folder import require_store


@contextmanager
def audited_store(data: Path, command: str, make: bool = False) -> Generator[Store]:
    """Open the store of a data folder, also while a server uses it, for a command, which its log will name.

    Raises
    ------
    InputError
        If there is no store yet and none shall be made.
    """
    settings = Settings(data=data)
    if not make:
        require_store(settings)
    user = "?"
    with suppress(OSError, KeyError):  # a user id without a name
        user = getpass.getuser()
    store = Store(settings, lambda _: None)
    try:
        with acting_as(Act(f"{user} on the server", "admin", None, "", "command", f"scancell {command}")):
            store.migrate()
            yield store
    finally:
        store.close()
