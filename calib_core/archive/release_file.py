"""`release.json` of an archive: who put its answer in force, when and why, signed by the server that did."""

from collections.abc import Mapping
from typing import Any, Final

from calib_core.archive.folder import parse_json, to_json_bytes
from calib_core.archive.seals import seal_state, sealed
from calib_core.errors import InputError
from calib_core.records import ResultsData
from calib_core.records.faults import in_order

RELEASE_FILE: Final = "release.json"

_TOLD: Final = (
    "number", "cell", "action", "who", "why", "created", "solved", "inputs_sha256", "verdict", "in_spite_of",
)  # fmt: skip
_TEXTS: Final = ("who", "why", "created")


def release_bytes(release: Mapping[str, Any]) -> bytes:
    """Return a release as it goes into the archive of the answer that it put in force."""
    told = {name: release.get(name) for name in _TOLD}
    return to_json_bytes(sealed({"format": "scancell-release/1", **told}, {}, str(release["created"])))


def release_told(content: bytes, results: ResultsData, solved: str) -> dict[str, Any] | None:
    """Return what such a file tells of these results, solved then: `signed` is whether by one who is trusted here.

    None of other results, and of a file that is not what was signed: it may come from anywhere.
    """
    try:
        told = parse_json(content, RELEASE_FILE)
        of_these = all(results[stage]["inputs_sha256"] == own for stage, own in told["inputs_sha256"].items())
        if not of_these or told["solved"] != solved or seal_state(told) is False:
            return None
        texts = {name: str(told[name] or "") for name in _TEXTS}
        return {
            **texts,
            "number": int(told["number"]),
            "in_spite_of": in_order(told.get("in_spite_of") or ()),
            "signed": bool(seal_state(told)),
        }
    except (InputError, KeyError, TypeError, AttributeError, ValueError):
        return None
