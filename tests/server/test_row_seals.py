"""Rows that another installation signed: their key is named, no hand is accused, and trusting it heals them."""

from pathlib import Path

import pytest

from calib_core.archive.keys import keys, trust
from server.store.models import EquipmentRow


def test_a_row_signed_elsewhere_is_no_altered_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SCANCELL_KEY_FILE", str(tmp_path / "there" / "key.pem"))
    row = EquipmentRow(id="ball-1", created="2026-11-27T08:00:00.000Z", record={"diameter_mm": 40.0})
    row.sign()
    there = keys().own_key
    assert (row.holds, row.unknown_key) == (True, None)
    monkeypatch.setenv("SCANCELL_KEY_FILE", str(tmp_path / "here" / "key.pem"))
    assert (row.holds, row.unknown_key) == (False, there)
    assert there is not None
    trust(there, "the old machine")
    assert (row.holds, row.unknown_key) == (True, None)
    row.record = {"diameter_mm": 41.0}
    assert (row.holds, row.unknown_key) == (False, None)
