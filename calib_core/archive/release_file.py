"""`release.json` of an archive: who put its answer in force, and who acknowledged what then, when and why.

It is signed by the server where that was done.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from calib_core.archive.folder import parse_json, to_json_bytes
from calib_core.archive.seals import seal_state, sealed
from calib_core.errors import InputError
from calib_core.records import ResultsData
from calib_core.records.faults import ACKNOWLEDGED, in_order

RELEASE_FILE: Final = "release.json"

_TOLD: Final = (
    "number", "cell", "action", "who", "why", "created", "solved", "inputs_sha256", "verdict", "in_spite_of",
)  # fmt: skip
_TEXTS: Final = ("who", "why", "created")
_OF_FAULT: Final = ("fault", "of", *_TEXTS)


def release_bytes(release: Mapping[str, Any], acknowledged: Sequence[Mapping[str, Any]]) -> bytes:
    """Return a release as it goes into the archive of the answer that it put in force.

    Parameters
    ----------
    release : mapping
        Of an answer that nobody released `solved` and `inputs_sha256` alone.
    acknowledged : sequence of mapping
        Who acknowledged a fault of the moment, when and why.
    """
    told = {name: release.get(name) for name in _TOLD}
    told["acknowledged"] = [{name: one[name] for name in _OF_FAULT} for one in acknowledged]
    at = release.get("created") or max(one["created"] for one in acknowledged)
    return to_json_bytes(sealed({"format": "scancell-release/1", **told}, {}, str(at)))


def release_told(content: bytes, results: ResultsData, solved: str) -> dict[str, Any] | None:
    """Return what such a file tells of these results, solved then: `signed` is whether by one who is trusted here.

    None of other results, and of a file that is not what was signed: it may come from anywhere.
    """
    try:
        told = _told(content, results, solved)
        if told is None or told["number"] is None:
            return None
        return {
            **_texts(told),
            "number": int(told["number"]),
            "in_spite_of": in_order(told.get("in_spite_of") or ()),
            "signed": bool(seal_state(told)),
        }
    except (InputError, KeyError, TypeError, AttributeError, ValueError):
        return None


def acknowledged_told(content: bytes, results: ResultsData, solved: str) -> list[dict[str, Any]]:
    """Return what such a file tells of acknowledged faults; nothing where `release_told` has none."""
    try:
        told = _told(content, results, solved) or {}
        signed, known = bool(told and seal_state(told)), told.get("acknowledged") or ()
        found = [(one["fault"], [str(name) for name in one["of"]], _texts(one)) for one in known]
    except (InputError, KeyError, TypeError, AttributeError, ValueError):
        return []
    return [{"fault": f, "of": of, **texts, "signed": signed} for f, of, texts in found if f in ACKNOWLEDGED]


def _told(content: bytes, results: ResultsData, solved: str) -> dict[str, Any] | None:
    told = parse_json(content, RELEASE_FILE)
    of_these = all(results[stage]["inputs_sha256"] == own for stage, own in told["inputs_sha256"].items())
    return told if of_these and told["solved"] == solved and seal_state(told) is not False else None


def _texts(told: Mapping[str, Any]) -> dict[str, str]:
    return {name: str(told[name] or "") for name in _TEXTS}
