"""The page's types are those of the API as it stands."""

from tests.web.api_types import TARGET, render


def test_types_are_current() -> None:
    assert TARGET.read_text(encoding="utf-8") == render(), "run: python tests/web/api_types.py"


def test_each_kind_of_schema_becomes_its_type() -> None:
    text = TARGET.read_text(encoding="utf-8")
    assert 'verdict: "pass" | "warn" | "fail";' in text
    assert "export interface StoredCapture {" in text
    assert "pose?: number[] | null;" in text
    assert "measured: Measured;" in text
