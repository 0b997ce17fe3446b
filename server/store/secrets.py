"""Secrets that are shown once: made from 256 random bits, kept as a keyed hash.

Nobody guesses 256 random bits, so the hash need not be slow. Its key is a file beside the database: without it
nothing that stands in the database lets anybody in, and nobody can put a token of their own there.
"""

import re
import secrets
from hashlib import sha256
from hmac import new as keyed_hash
from pathlib import Path

from calib_core.disk import write_private
from calib_core.errors import InputError
from calib_core.messages import plural

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
        write_private(path, secrets.token_bytes(_KEY_BYTES))
    key = path.read_bytes()
    if len(key) != _KEY_BYTES:
        raise InputError(
            "a key of {key_bytes} bytes",
            plural("{count} byte", "{count} bytes", by="count", count=len(key)),
            "Put the file back from a backup; or remove it, and make new tokens: those made so far end with it.",
            str(path),
            key_bytes=_KEY_BYTES,
        )
    return key


def copy_key(source: Path, target: Path) -> None:
    """Copy the key of one folder to another, as for a backup, where there is one and the other has none."""
    if (source / KEY_FILE).exists() and not (target / KEY_FILE).exists():
        write_private(target / KEY_FILE, load_key(source))


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
