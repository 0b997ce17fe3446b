"""Seals: signatures (Ed25519) by which a result, an answer or an archive is known to be as it was made."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any, Final, cast

from calib_core.archive.keys import Keys, keys
from calib_core.moment import now
from calib_core.records import Session
from calib_core.records.findings import Finding

_EXACT: Final = 2.0**53
_CONTAINERS: Final = (list, dict)


SOLVED: Final = "solved"
IMPORTED: Final = "imported"

_FORMAT: Final = "scancell-seal/1"
_ADDED_ON_READING: Final = ("seal", "provenance", "stale", "at_workpiece", "turned_deg")
_NOT_OF_A_SESSION: Final = (
    "documentation", "format", "id", "created", "updated", "revision", "scene", "simulated"
)  # fmt: skip


def signed_result(
    result: Mapping[str, Any],
    session: Session | Mapping[str, Any],
    provenance: str = SOLVED,
    finding: Finding | None = None,
    moment: str | None = None,
    before: Sequence[Mapping[str, Any]] = (),
    files: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Return a result with the seal of this installation; as it is where there is no key to sign with.

    Parameters
    ----------
    result : mapping
        JSON data.
    session : Session or mapping
        What it was solved from.
    provenance : str
        How it came to be here.
    finding : Finding, optional
        What a replay noticed.
    moment : str, optional
        When; left out, now.
    before : sequence of mapping, optional
        What a verification was preceded by: `decision` and `solved` of each.
    files : mapping, optional
        The SHA-256 of the session's files, where what it was solved from is kept beside it.
    """
    seal: dict[str, Any] = {"session": session_sha256(session), "provenance": provenance}
    if finding is not None:
        seal["finding"] = finding.to_json()
    if before:
        seal["before"] = [dict(one) for one in before]
    if files is not None:
        seal["files"] = digest_of(files)
    return sealed({**result, "provenance": provenance}, seal, moment)


def sealed(data: Mapping[str, Any], about: Mapping[str, Any], moment: str | None = None) -> dict[str, Any]:
    """Return JSON data with a seal over it and what is said about it; `moment` is when, left out for now."""
    plain = {name: value for name, value in data.items() if name != "seal"}
    own = keys()
    if own.own is None:
        return plain
    at = now() if moment is None else moment
    seal: dict[str, Any] = {"format": _FORMAT, **about, "at": at, "key": own.own_key}
    return {**plain, "seal": {**seal, "signature": own.own.sign(_signed(plain, seal)).hex()}}


def seal_state(data: Mapping[str, Any], here: Keys | None = None) -> bool | None:
    """Return whether the seal of a result or an answer holds: None where it is unknown here, or there is none.

    False means that the data is not what was signed.
    """
    seal = data.get("seal")
    if not isinstance(seal, Mapping):
        return None
    told = cast("Mapping[str, Any]", seal)
    if not _holds(data, told):
        return False
    return True if (here or keys()).trusts(told.get("key"), str(told.get("at") or "")) else None


def decisions_sealed(result: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return what a verification's seal says was decided before: `decision` and `solved`, the oldest first."""
    seal = result.get("seal")
    told = cast("Mapping[str, Any]", seal).get("before") if isinstance(seal, Mapping) else None
    known = cast("list[Any]", told) if isinstance(told, list) else []
    return [
        {name: str(cast("Mapping[str, Any]", one).get(name) or "") for name in ("decision", "solved")}
        for one in known
        if isinstance(one, Mapping)
    ]


def has_origin(seal: Mapping[str, Any]) -> bool:
    """Return whether what a result was solved from was kept beside it when it was signed."""
    return "files" in seal


def without_origin(result: Mapping[str, Any]) -> dict[str, Any]:
    """Return a result signed anew as it stands, for one whose origin nobody knows any more."""
    seal = {name: result["seal"][name] for name in ("session", "finding", "before") if name in result["seal"]}
    provenance = with_provenance(result)["provenance"]
    return sealed({**result, "provenance": provenance}, {**seal, "provenance": provenance})


def is_origin(solved_from: Mapping[str, Any], seal: Mapping[str, Any]) -> bool:
    """Return whether a session and its `files` are what was signed with a result as what it was solved from."""
    signed = seal.get("files")
    return session_sha256(solved_from["session"]) == seal.get("session") and (
        signed is None or digest_of(solved_from.get("files") or {}) == signed
    )


def with_provenance(result: Mapping[str, Any]) -> dict[str, Any]:
    """Return a stored result with the provenance that its seal proves, whatever it says of itself."""
    state = seal_state(result)
    return {**result, "provenance": result["seal"]["provenance"] if state else IMPORTED}


def session_sha256(session: Session | Mapping[str, Any]) -> str:
    """Return the SHA-256 of a session's record without its documentation, so that names can be taken out."""
    record = session.to_json() if isinstance(session, Session) else session
    return digest_of({name: value for name, value in record.items() if name not in _NOT_OF_A_SESSION})


def digest_of(data: Any) -> str:
    """Return the SHA-256 of JSON data, whatever program wrote it: see `canonical`."""
    return hashlib.sha256(canonical(data)).hexdigest()


def canonical(data: Any) -> bytes:
    """Return the one text of JSON data: sorted names, shortest numbers, without fields that say nothing."""
    text = json.dumps(_plain(data), sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.encode("utf-8", "surrogatepass")


def _holds(data: Mapping[str, Any], seal: Mapping[str, Any]) -> bool:
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    if data.get("provenance", seal.get("provenance")) not in (seal.get("provenance"), IMPORTED):
        return False
    try:
        key = Ed25519PublicKey.from_public_bytes(bytes.fromhex(str(seal.get("key"))))
        key.verify(bytes.fromhex(str(seal.get("signature"))), _signed(data, seal))
    except (InvalidSignature, ValueError, TypeError):
        return False
    return True


def _signed(data: Mapping[str, Any], seal: Mapping[str, Any]) -> bytes:
    """Return what a signature is over: what the seal says, and stage, inputs, software and content of the data."""
    content = {name: value for name, value in data.items() if name not in _ADDED_ON_READING}
    return canonical({
        **{name: value for name, value in seal.items() if name != "signature"},
        "stage": data.get("stage"),
        "inputs": data.get("inputs_sha256"),
        "software": data.get("software"),
        "content": digest_of(content),
    })  # fmt: skip


def _plain(value: Any) -> Any:
    """Return JSON data without what only some versions write: nulls, empty lists, the first revision."""
    kind = type(value)
    if kind is float:
        return int(value) if value.is_integer() and -_EXACT < value < _EXACT else value
    if kind is list or kind is tuple:
        return [_plain(item) for item in value]
    if kind is dict:
        told = {name: _plain(item) for name, item in value.items() if item is not None}
        if told.get("method_revision") == 1:
            del told["method_revision"]
        return {name: item for name, item in told.items() if item or type(item) not in _CONTAINERS}
    return value
