"""The key that signs what is solved here, and the public keys whose signatures count: in no data folder."""

import json
import os
import platform
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from calib_core.disk import remove_file, write_private
from calib_core.errors import ConflictError, InputError, NotFoundError
from calib_core.formats.shared.writing import write_atomically
from calib_core.messages import message
from calib_core.moment import now

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

VARIABLE: Final = "SCANCELL_KEY_FILE"
_HEX: Final = 64
_NEW_KEY: Final = (
    f"Put it back from a backup, or name another by {VARIABLE}; `scancell trust renew` makes a new one."
)


@dataclass(frozen=True)
class TrustedKey:
    """A public key whose signatures count.

    Attributes
    ----------
    key : str
        64 hex digits.
    name : str
        Whose it is.
    added : str
        When it was added, ISO 8601.
    until : str or None
        Signatures of later moments do not count.
    """

    key: str
    name: str
    added: str
    until: str | None = None

    def counts_at(self, moment: str) -> bool:
        """Return whether a signature of a moment counts; one without a moment only where the key has no end."""
        return self.until is None or "" < moment <= self.until


@dataclass(frozen=True)
class Keys:
    """The keys of this installation: its own, which may be none, and those that it trusts."""

    own: "Ed25519PrivateKey | None"
    trusted: tuple[TrustedKey, ...]
    trouble: str = ""

    @property
    def own_key(self) -> str | None:
        """The public half of the own key, 64 hex digits."""
        return None if self.own is None else self.own.public_key().public_bytes_raw().hex()

    def trusts(self, key: object, moment: str) -> bool:
        """Return whether a signature that a key made at a moment counts."""
        return any(one.key == key and one.counts_at(moment) for one in self.trusted)

    def name_of(self, key: str) -> str:
        """Return what a key is called, with the digits by which it is told from others."""
        name = next((one.name for one in self.trusted if one.key == key), "unknown key")
        return f"{name} ({key[:16]})"


def key_file() -> Path:
    """Return where the own key lies: `SCANCELL_KEY_FILE`, else the user's folder for configuration."""
    named = os.environ.get(VARIABLE)
    return Path(named) if named else _of_user()


@cache
def _of_user() -> Path:
    from platformdirs import user_config_path

    return user_config_path("scancell", appauthor=False) / "key.pem"


def trust_file() -> Path:
    """Return where the trusted public keys lie: beside the own key."""
    return _trust_beside(key_file())


@cache  # asked for with each row that is signed
def _trust_beside(own: Path) -> Path:
    return own.with_name(f"{own.stem}-trusted.json")


def keys() -> Keys:
    """Return the keys of this installation; an own key is made where there is none.

    Raises
    ------
    InputError
        If a file is there and is not what it should be.

    Notes
    -----
    Where no key can be written, as in a read-only home, one is made that lasts as long as the process: `trouble`
    says so.
    """
    own = key_file()
    trusted = _trust_beside(own)
    return _keys(own, trusted, _state(own), _state(trusted))


def trust(key: str, name: str, until: str | None = None) -> TrustedKey:
    """Add a public key to those that count, or change its name or its end; return it.

    Raises
    ------
    InputError
        If it is no public key, or the list cannot be written.
    """
    key = public_key_of(key)
    known = next((one for one in keys().trusted if one.key == key), None)
    added = TrustedKey(key, name, now(), until) if known is None else replace(known, name=name, until=until)
    _write([*(one for one in keys().trusted if one.key != key), added])
    return added


def distrust(key: str) -> TrustedKey:
    """Take a public key, given by its first digits or its name, from those that count; return it.

    Raises
    ------
    NotFoundError
        If there is none such.
    ConflictError
        If it is the own key, with which results are being signed.
    """
    found = trusted_key(key)
    if found.key == keys().own_key:
        to_do = "Make a new one first: `scancell trust renew`."
        raise ConflictError("a key that does not sign here any more", "this installation's own", to_do, key)
    _write(one for one in keys().trusted if one.key != found.key)
    return found


def trusted_key(key: str) -> TrustedKey:
    """Return the trusted key with a name or first digits; raises NotFoundError where there is not exactly one."""
    found = [one for one in keys().trusted if key and (one.name == key or one.key.startswith(key.lower()))]
    if len(found) != 1:
        got = "none" if not found else f"{len(found)} of them"
        to_do = "List them with `scancell trust`, and name one by more of its digits."
        raise NotFoundError("a trusted key, by its name or its first digits", f"{got}: {key[:80]!r}", to_do, "KEY")
    return found[0]


def renew() -> TrustedKey:
    """Make a new own key; the former one's signatures count until it is removed.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    _write(keys().trusted)  # the former must be among them before its file goes
    try:
        remove_file(key_file(), missing_ok=True)
    except OSError as error:
        got = (error.strerror or type(error).__name__).lower()
        to_do = "Replace the key where it is kept, as in the secret that the container gets."
        raise InputError("a key file that can be replaced", got, to_do, str(key_file())) from None
    return trusted_key(keys().own_key or "")


def public_key_of(text: str) -> str:
    """Return a public key, given as 64 hex digits or as PEM; raises InputError where it is none."""
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
    from cryptography.hazmat.primitives.serialization import load_pem_public_key

    text = text.strip()
    try:
        if text.startswith("-----"):
            loaded = load_pem_public_key(text.encode())
            if isinstance(loaded, Ed25519PublicKey):
                return loaded.public_bytes_raw().hex()
        elif len(text) == _HEX:
            return Ed25519PublicKey.from_public_bytes(bytes.fromhex(text)).public_bytes_raw().hex()
    except ValueError:
        pass
    to_do = "Copy it from what `scancell trust` shows where it signs."
    raise InputError("an Ed25519 public key, 64 hex digits or PEM", "something else", to_do, "KEY")


def _state(file: Path) -> tuple[int, int] | None:
    """Return what tells one content of a file from another, None where it is not there or cannot be looked at."""
    try:
        told = file.stat()
    except OSError:
        return None
    return told.st_mtime_ns, told.st_size


@cache
def _keys(own_file: Path, trust_file: Path, own_state: object, trust_state: object) -> Keys:
    own, trouble = _own(own_file, there=own_state is not None)
    listed = _listed(trust_file) if trust_state is not None else ()
    found = Keys(own, listed, trouble)
    if found.own_key is not None and not any(one.key == found.own_key for one in listed):
        mine = TrustedKey(found.own_key, platform.node() or "this machine", now())
        found = replace(found, trusted=(*listed, mine))
        with suppress(InputError):  # a secret's folder cannot be written to; the own key counts all the same
            _write(found.trusted, trust_file)
    return found


def _own(file: Path, *, there: bool) -> "tuple[Ed25519PrivateKey | None, str]":
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import (
        Encoding,
        NoEncryption,
        PrivateFormat,
        load_pem_private_key,
    )

    if not there:
        made = Ed25519PrivateKey.generate()
        try:
            file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            write_private(file, made.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
        except OSError as error:
            why = (error.strerror or type(error).__name__).lower()
            what = "the key for signing results cannot be written to {file} ({why})"
            return made, message(what, file=file, why=why)
    try:
        loaded = load_pem_private_key(file.read_bytes(), None)
    except (OSError, ValueError, TypeError, UnsupportedAlgorithm) as error:
        got = (error.strerror or "").lower() if isinstance(error, OSError) else "something else"
        raise InputError("an Ed25519 private key (PEM)", got, _NEW_KEY, str(file)) from None
    if not isinstance(loaded, Ed25519PrivateKey):
        raise InputError("an Ed25519 private key (PEM)", f"a {type(loaded).__name__}", _NEW_KEY, str(file))
    return loaded, ""


def _listed(file: Path) -> tuple[TrustedKey, ...]:
    try:
        rows: list[dict[str, Any]] = json.loads(file.read_bytes())["trusted"]
        return tuple(TrustedKey(row["key"], row["name"], row["added"], row.get("until")) for row in rows)
    except (OSError, ValueError, KeyError, TypeError) as error:
        to_do = "Put it back from a backup, or remove it and add the keys again."
        raise InputError("a list of trusted keys", f"{type(error).__name__}", to_do, str(file)) from None


def _write(trusted: Iterable[TrustedKey], file: Path | None = None) -> None:
    rows = [
        {"key": one.key, "name": one.name, "added": one.added, "until": one.until}
        for one in sorted(trusted, key=lambda one: one.added)
    ]
    write_atomically(file or trust_file(), (json.dumps({"trusted": rows}, indent=1) + "\n").encode())
