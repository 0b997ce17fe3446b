"""JSON data in another language: its findings, its messages, and the texts of its fields that hold texts."""

from collections.abc import Mapping
from typing import Any, Final, TypeVar, cast

from calib_core.findings.reading import as_read, in_language
from calib_core.findings.table import CODES
from calib_core.messages import SAID, Catalogue, Message, are_numbers, made_lately, parts_in
from calib_core.records.base import Record
from calib_core.records.findings import Finding

TEXTS: Final = frozenset(
    """
    alt caption cells detail does doubt doubts exit extra flags formula got helps_most instruction label
    left_out left_reason limit_label limited_by limits message method need note notes problem progress reason
    reasons reference remark right_reason sentence shows suggested_note text title to_capture to_do trends units
    waits_for warning warnings what where why words description
    """.split()  # noqa: SIM905
)
"""The fields whose texts are said as they stand, where the catalogue knows them; others hold names and values."""

B = TypeVar("B", bound=Record)

_FINDING: Final = {"code", "severity", "text"}
_RESULT: Final = {"stage", "findings", "verdict", "warnings", "method"}


def told(document: Any, language: Catalogue) -> Any:
    """Return JSON data as a language says it, without the parts that its messages are made of."""
    if language.language == "en":
        return _without_parts(document)
    return _Telling(language, {str(one): one for one in parts_in(document)}).told(document)


def block_in(block: B, language: Catalogue) -> B:
    """Return a block of evidence as a language says it."""
    return type(block).model_validate(told(block.to_json(), language))


def _without_parts(value: Any) -> Any:
    if isinstance(value, dict):
        fields = cast("dict[str, Any]", value)
        return {k: _without_parts(v) for k, v in fields.items() if k != SAID or not isinstance(v, list)}
    if isinstance(value, list) and not are_numbers(cast("list[Any]", value)):
        return [_without_parts(one) for one in cast("list[Any]", value)]
    return value


class _Telling:
    def __init__(self, language: Catalogue, known: Mapping[str, Message]) -> None:
        self._language, self._known = language, known

    def told(self, value: Any, field: str = "") -> Any:
        if isinstance(value, str):
            said = self._known.get(value) or made_lately(value)
            return self._language.say(value if said is None else said) if said or field in TEXTS else value
        if isinstance(value, list):
            items = cast("list[Any]", value)
            return items if are_numbers(items) else [self.told(one, field) for one in items]
        return self._fields(cast("dict[str, Any]", value), field) if isinstance(value, dict) else value

    def _fields(self, data: dict[str, Any], field: str) -> dict[str, Any]:
        if data.keys() >= _RESULT:
            data = as_read(data, self._language.language)
        elif data.keys() >= _FINDING and data["code"] in CODES and isinstance(data["text"], str):
            return in_language(Finding.model_validate(data), self._language.language).to_json()
        own = {"documentation", "why"} if "who" in data else {"documentation"}  # what people wrote
        told = {
            name: value
            if name in own
            else self.told(value, name if name in TEXTS or not isinstance(value, str) else field)
            for name, value in data.items()
            if name != SAID or not isinstance(value, list)
        }
        if data.get("kind") == "table":
            names = [k for k, column in enumerate(data["columns"]) if column.get("own")]
            for row, as_it_stands in zip(told["rows"], data["rows"], strict=True):
                for k in names:
                    row["cells"][k] = as_it_stands["cells"][k]
        return told
