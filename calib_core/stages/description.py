"""What pages and programs are told of a stage."""

from dataclasses import asdict
from typing import Any

from pydantic import BaseModel

from calib_core.graph.stage import Stage
from calib_core.records import Cell

_NO_SETTINGS = {"type": "object", "properties": {}, "additionalProperties": False}


def describe_stage(stage: Stage) -> dict[str, Any]:
    """Return what a page or a program needs to know of a stage, as JSON data."""
    return {
        "name": stage.name,
        "title": stage.title,
        "steps": list(stage.steps),
        "after": list(stage.after),
        "guided": list(stage.guided),
        "planned": stage.planned,
        "is_answer": stage.is_answer,
        "step": None if stage.step is None else asdict(stage.step),
        "further_steps": [asdict(step) for step in stage.further_steps],
        "settings_field": stage.settings_field,
        "settings": _NO_SETTINGS if stage.settings_field is None else _settings(stage.settings_field),
        "layers": list(stage.layers),
    }


def _settings(field: str) -> dict[str, Any]:
    """Return the JSON Schema of the record that a field of the cell holds."""
    kind: Any = Cell.model_fields[field].annotation
    for record in getattr(kind, "__args__", (kind,)):  # a field that may be left out is a union with None
        if isinstance(record, type) and issubclass(record, BaseModel):
            return record.model_json_schema()
    raise TypeError(f"cell.{field} is no record")
