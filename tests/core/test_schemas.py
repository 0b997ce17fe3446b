"""`scancell schema`: what stored sessions hold is what the schemas allow, and they refuse what the format does."""

import json
from pathlib import Path
from zipfile import ZipFile

import jsonschema_rs
import pytest

from server.commands.schema.records import SCHEMAS, schema_text

RELEASE = Path(__file__).parents[1] / "releases" / "2026-11"
ZIPS = [RELEASE / "folders.zip", RELEASE / "archives" / "frames.zip"]
RECORDS = [name for name in SCHEMAS if not name.startswith("python-")]


@pytest.mark.parametrize("name", RECORDS)
def test_stored_records_are_allowed(name):
    validator = jsonschema_rs.validator_for(json.loads(schema_text(name)))
    stored = "/session.json" if name == "session" else f"/results/{name.removeprefix('result-')}.json"
    zips = [ZipFile(file) for file in ZIPS]
    found = [file.read(each) for file in zips for each in file.namelist() if each.endswith(stored)]
    for text in found:
        assert [error.message for error in validator.iter_errors(json.loads(text))] == []
    assert found or name == "result-hand-eye"
    assert not validator.is_valid({"format": "scancell-session/1"})
