"""Rows of archives, and of results that came from elsewhere."""

from collections.abc import Iterable
from functools import cache
from io import BytesIO
from typing import Any

from calib_core.archive.archive import pack_files
from calib_core.archive.bag import open_bag, write_bag
from calib_core.archive.bag_seal import SEAL_FILE
from calib_core.archive.folder import SESSION_FILE, result_data, to_json_bytes
from calib_core.findings import Finding
from calib_core.findings.reading import as_read
from calib_core.review.provenance import HISTORY_FILE, verify
from calib_core.review.replay import replay
from tests.every_code.made import CELL, Case, made, solved


def archived(past: list[Any] | None = None, *, sealed: bool = True) -> Case:
    """Verify an archive, with or without its seal, whose past was edited."""

    def case() -> Iterable[Finding]:
        payload = {**CELL.files, SESSION_FILE: to_json_bytes(CELL.session.to_json()), HISTORY_FILE: b"{}\n"}
        whole, edited = BytesIO(), BytesIO()
        pack_files(CELL.session, payload, whole, "cell")
        with open_bag(whole) as bag:
            seal = b"".join(bag.chunks(SEAL_FILE))
        if past is not None:
            payload[HISTORY_FILE] = to_json_bytes({"results": past})
        write_bag(edited, "cell", payload, {}, lambda _: {SEAL_FILE: seal} if sealed else {})
        return verify(edited).findings

    return case


def came(provenance: str) -> Case:
    """Return a result's findings as they are read where it came so."""
    stored = result_data(solved("tcp", "tcp"))
    return lambda: map(Finding.model_validate, as_read({**stored, "provenance": provenance})["findings"])


@cache
def _replayed(**fields: Any) -> list[Finding]:
    cell = made("tcp")
    stored = {"tcp": {**result_data(solved("tcp", "tcp")), **fields}}
    found = replay(cell.session, cell.files.__getitem__, stored).stages
    return [stage.finding for stage in found if stage.finding is not None]


def replayed(**fields: Any) -> Case:
    """Return what the replay of a result says whose stored fields are others."""
    return lambda: _replayed(**fields)


CASES: dict[str, tuple[Case, Case]] = {
    "not-signed": (archived(sealed=False), archived()),
    "seal-broken": (archived([]), archived([], sealed=False)),
    "archive-disagrees": (archived([{"stage": "tcp"}], sealed=False), archived([], sealed=False)),
    "not-replayed": (lambda: came("imported")(), lambda: came("replayed")()),
    "replay-differs": (replayed(verdict="none"), replayed()),
    "replayed-other-revision": (replayed(verdict="none", method_revision=0), replayed(verdict="none")),
}
