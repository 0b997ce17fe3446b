"""No pattern is shown to anybody: every one that a record, a setting or an address has is said in words."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from calib_core.errors import InputError
from calib_core.exports.registry import all_exports
from calib_core.formats.points import FORMATS
from calib_core.records import Session, parse_session
from calib_core.records.field_errors import OTHER, in_words
from server.app import create_app
from server.movers.registry import MOVERS
from server.settings import Settings
from server.sources.registry import SOURCES
from server.store.archived_history import ArchivedHistory


def patterns(schema: Any) -> Iterator[str]:
    """Give the patterns anywhere in a schema."""
    if isinstance(schema, dict):
        if isinstance(schema.get("pattern"), str):
            yield schema["pattern"]
        schema = list(schema.values())
    if isinstance(schema, list):
        for part in schema:
            yield from patterns(part)


def test_every_pattern_is_said_in_words(tmp_path: Path) -> None:
    entries = (*FORMATS, *all_exports(), *SOURCES, *MOVERS)
    schemas = [entry.settings.model_json_schema() for entry in entries]
    schemas += [Session.model_json_schema(), ArchivedHistory.model_json_schema()]
    schemas.append(create_app(Settings(data=tmp_path)).openapi())
    found = set(patterns(schemas))
    assert len(found) > 10
    assert [one for one in found if in_words(one) == OTHER] == []


@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ({"id": "x/y"}, "up to 64 letters, digits"),
        ({"spheres": [{"name": "a b", "on": "base"}]}, "up to 64 letters, digits"),
    ],
)
def test_a_refusal_has_no_pattern(cell: dict[str, Any], said: str) -> None:
    record = {"format": "scancell-session/1", "cell": {"pose_convention": "kuka", **cell}, "captures": []}
    with pytest.raises(InputError) as refused:
        parse_session(record)
    assert said in str(refused.value)
    assert not re.search(r"\^|\{\d|\[A-Z", json.dumps(str(refused.value)))
