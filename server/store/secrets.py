"""Secrets that are shown once: made from 256 random bits, kept as a keyed hash.

Nobody guesses 256 random bits, so the hash need not be slow. Its key is a file beside the database: without it
nothing that stands in the database lets anybody in, and nobody can put a token of their own there.
"""

import os
import re
import secrets
from contextlib import suppress
from hashlib import sha256
from hmac import new as keyed_hash
from pathlib import Path

from calib_core.disk import remove_file, rename_new
from calib_core.errors import InputError

KEY_FILE = "login.key"
_KEY_BYTES = 32
_TOKEN = re.compile(r"scancell_([0-9a-f]{12})_[A-Za-z0-9_-]{43}")


def load_key(data: Path) -> bytes:
    """Return the key of a data folder, made when it is first asked for and readable by its owner alone.

    Raises
    ------
    InputError
        If the file is there and is no key.
    """
    path = data / KEY_FILE
    if not path.exists():
        data.mkdir(parents=True, exist_ok=True)
        _write_key(path, secrets.token_bytes(_KEY_BYTES))
    key = path.read_bytes()
    if len(key) != _KEY_BYTES:
        raise InputError(
            f"a key of {_KEY_BYTES} bytes",
            f"{len(key)} bytes",
            "Put the file back from a backup; or remove it, and make new tokens: those made so far end with it.",
            str(path),
        )
    return key


def copy_key(source: Path, target: Path) -> None:
    """Copy the key of one folder to another, as for a backup, where there is one and the other has none."""
    if (source / KEY_FILE).exists() and not (target / KEY_FILE).exists():
        _write_key(target / KEY_FILE, load_key(source))


def _write_key(path: Path, key: bytes) -> None:
    """Write a key whole and durably; of two writers the first wins."""
    fresh = path.with_name(f"{path.name}.{secrets.token_hex(8)}")
    handle = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(key)
            file.flush()
            os.fsync(file.fileno())
        with suppress(FileExistsError):
            _name_new(fresh, path)
    finally:
        remove_file(fresh, missing_ok=True)


def _name_new(fresh: Path, path: Path) -> None:
    """Give a file a name that nothing has; raises FileExistsError. Network and USB drives know no second names."""
    try:
        os.link(fresh, path)
    except FileExistsError:
        raise
    except OSError:
        if path.exists():
            raise FileExistsError(path) from None
        rename_new(fresh, path)


def new_token() -> tuple[str, str]:
    """Return a token's id and the token itself, in which the id stands."""
    token_id = secrets.token_hex(6)
    return token_id, f"scancell_{token_id}_{secrets.token_urlsafe(32)}"


def token_id_of(token: str) -> str | None:
    """Return the id in a token, None where it is no token."""
    match = _TOKEN.fullmatch(token)
    return match[1] if match else None


def new_cookie() -> str:
    """Return the value of a login's cookie."""
    return secrets.token_urlsafe(32)


def digest_of(key: bytes, secret: str) -> str:
    """Return what is kept of a secret: HMAC-SHA-256, 64 hex digits."""
    return keyed_hash(key, secret.encode(), sha256).hexdigest()
