"""The seal of an archive: which files it had when it was packed, signed; a tag file of the bag."""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple, cast

from calib_core.archive.bag import PAYLOAD, Bag
from calib_core.archive.folder import SESSION_FILE, parse_json, to_json_bytes
from calib_core.archive.keys import keys
from calib_core.archive.seals import seal_state, sealed, session_sha256
from calib_core.errors import InputError
from calib_core.findings.codes.provenance import NOT_SIGNED, SEAL_BROKEN
from calib_core.records import ResultsData
from calib_core.records.findings import Finding

SEAL_FILE: Final = "scancell-seal.json"
_MAY_GO: Final = ("report.html", "scene.html")  # with the names in them
_WHAT: Final = "scancell-archive/1"


class Sealed(NamedTuple):
    """Whether an archive is as it was signed: None where nobody who is trusted here did so."""

    holds: bool | None
    signed_by: str | None
    findings: list[Finding]


def seal_of(record: Mapping[str, Any], digests: Mapping[str, str], moment: str) -> bytes | None:
    """Return the seal of a bag's files, given by their SHA-256; None where there is no key to sign with.

    Parameters
    ----------
    record : mapping
        What session.json holds.  Signed in place of its bytes, without the documentation.
    digests : mapping
        By name in the bag.
    moment : str
        When its newest result was solved; the same session gives the same bytes.
    """
    files = {name.removeprefix(PAYLOAD): digest for name, digest in digests.items()}
    del files[SESSION_FILE]
    data = sealed({"archive": _WHAT, "session": session_sha256(record), "files": files}, {}, moment)
    return to_json_bytes(data) if "seal" in data else None


def check_seal(bag: Bag, results: ResultsData) -> Sealed:
    """Compare a bag, and the results in it, with what was signed."""
    broken = [f"results/{stage}.json" for stage, result in results.items() if seal_state(result) is False]
    data = _seal(bag)
    if data is None:
        signers = {str(result["seal"]["key"]) for result in results.values() if result.get("seal")}
        found = [] if broken else [NOT_SIGNED([], why="none", key="")]
        return Sealed(
            False if broken else None, _named(signers), [*(SEAL_BROKEN([], what=w) for w in broken), *found]
        )
    state, key = seal_state(data), str(data["seal"].get("key"))
    broken += [SEAL_FILE] if state is False else _changed(bag, data)
    if broken:
        return Sealed(False, _named({key}), [SEAL_BROKEN([], what=what) for what in dict.fromkeys(broken)])
    unknown = [] if state else [NOT_SIGNED([], why="unknown", key=key)]
    return Sealed(state, _named({key}), unknown)


def _named(signers: set[str]) -> str | None:
    here = keys()
    return ", ".join(sorted(here.name_of(key) for key in signers)) or None


def _seal(bag: Bag) -> dict[str, Any] | None:
    """Return what the seal's file holds, None where there is none that is one."""
    if SEAL_FILE not in bag.names:
        return None
    where = f"{bag.where}: {SEAL_FILE}"
    try:
        data = parse_json(b"".join(bag.chunks(SEAL_FILE)), where)
        is_one = isinstance(data["seal"], dict) and isinstance(data["files"], dict)
    except (InputError, TypeError, KeyError):
        is_one = False
        data = None
    return cast("dict[str, Any]", data) if is_one else {"seal": {}, "files": {}}


def _changed(bag: Bag, data: Mapping[str, Any]) -> list[str]:
    """Return the names of what is not as it was signed."""
    signed: Mapping[str, str] = data["files"]
    there = set(bag.payload) - {SESSION_FILE}
    changed = [name for name in sorted(there) if signed.get(name) != bag.sha256(name)]
    changed += [name for name in sorted(set(signed) - there) if name not in _MAY_GO]
    record = parse_json(bag.read(SESSION_FILE), SESSION_FILE)
    return changed + ([SESSION_FILE] if data.get("session") != session_sha256(record) else [])
