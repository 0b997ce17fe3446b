"""What exists: formats, conventions, exports, sources and stages, each with the JSON Schema of its settings.

The page builds its choices, its accepted file endings and its forms from these lists.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from calib_core.graph.stage import Stage
from calib_core.proof import Proof
from calib_core.records import Cell
from server.http.api_router import api_router
from server.routes.dependencies import SettingsDep

_NO_STAGE_SETTINGS = {"type": "object", "properties": {}, "additionalProperties": False}

router = api_router("registries")

_NO_SETTINGS: dict[str, Any] = {"type": "object", "properties": {}, "additionalProperties": False}


class _Entry(BaseModel):
    """An entry of a list; what else it says of itself goes out with it."""

    model_config = ConfigDict(extra="allow")

    name: str
    title: str
    settings: dict[str, Any] = Field(description="The JSON Schema of its settings.")


class FileFormat(_Entry):
    """A format of files that captures come in."""

    endings: list[str] = Field(description="Of its files, with the dot, in lower case.")
    kinds: list[str] = Field(description="What its files can hold.")
    reads: bool
    writes: list[str] = Field(description="What can be written in it.")
    proof: Proof = Field(description="What proved its reader.")
    experimental: bool


class PoseConventionEntry(_Entry):
    """A way to write a pose: its numbers in their order, their units, and the rotation from them."""

    brand: str | None
    numbers: list[str]
    units: str
    formula: str


class ExportFormat(_Entry):
    """Another program's syntax for the answer."""

    brand: str | None
    media_type: str
    suffix: str
    proof: Proof | None = Field(description="What proved that the other program takes it; null: own forms.")
    experimental: bool


class CaptureSource(_Entry):
    """Where captures come from besides uploads; `triggered` where it takes one when it is asked to.

    One that `delivers` something is a live device: robot, table or scanner.  `extra` names what must be installed
    for it.
    """

    does: str
    triggered: bool
    delivers: list[str]
    extra: str | None


class StepOfCaptures(BaseModel):
    """A step that captures are taken for, and what they show."""

    name: str
    title: str
    shows: str
    to_capture: str


class StageOfCell(_Entry):
    """A stage: the steps whose captures it takes, the stages that it may rest on, and the guide's steps for it.

    `step` are the captures that are its own, `further_steps` others that it alone takes; its settings stand in the
    cell's field `settings_field`; `element` is where the page's own elements of it lie, null where it has none.
    Poses are `planned` for its own captures; its result can be the session's answer where it `is_answer`.
    """

    steps: list[str]
    after: list[str]
    guided: list[str]
    planned: bool
    is_answer: bool
    step: StepOfCaptures | None
    further_steps: list[StepOfCaptures]
    settings_field: str | None
    layers: list[str]
    element: str | None


class FileFormats(BaseModel):
    """The formats of files."""

    items: list[FileFormat]


class PoseConventions(BaseModel):
    """The pose conventions, the most common first."""

    items: list[PoseConventionEntry]


class ExportFormats(BaseModel):
    """The exports, those of no brand first."""

    items: list[ExportFormat]


class CaptureSources(BaseModel):
    """The sources of captures."""

    items: list[CaptureSource]


class StagesOfCell(BaseModel):
    """The stages, in their order."""

    items: list[StageOfCell]


@router.get("/formats", response_model=FileFormats)
def formats() -> FileFormats:
    """List the file formats, and what may be said about a file that does not say it itself."""
    from calib_core.formats.points import FORMATS

    return FileFormats(items=[FileFormat.model_validate(entry.to_json()) for entry in FORMATS])


@router.get("/conventions", response_model=PoseConventions)
def conventions() -> PoseConventions:
    """List the pose conventions: the names that `pose_convention` may have."""
    from calib_core.robots.registry import BRANDS

    return PoseConventions(
        items=[
            PoseConventionEntry(
                name=convention.name,
                title=convention.description,
                settings=_NO_SETTINGS,
                brand=brand.name,
                numbers=convention.numbers.split(),
                units=convention.units,
                formula=convention.formula,
            )
            for brand in sorted(BRANDS, key=lambda brand: brand.rank)
            for convention in brand.conventions
        ]
    )


@router.get("/exports", response_model=ExportFormats)
def exports() -> ExportFormats:
    """List the exports: the names that `GET …/exports/{name}` takes."""
    from calib_core.exports.registry import all_exports

    return ExportFormats(items=[ExportFormat.model_validate(export.describe()) for export in all_exports()])


@router.get("/sources", response_model=CaptureSources)
def sources() -> CaptureSources:
    """List where captures come from besides uploads."""
    from server.sources.registry import SOURCES

    return CaptureSources(items=[CaptureSource.model_validate(source.describe()) for source in SOURCES])


@router.get("/stages", response_model=StagesOfCell)
def stages(settings: SettingsDep) -> StagesOfCell:
    """List the stages: the names that `POST …/solve/{stage}` takes; `all` solves them in their order."""
    from calib_core.graph.registry import stages as all_stages

    items = [{**describe_stage(stage), "element": _element(settings.web, stage.name)} for stage in all_stages()]
    return StagesOfCell(items=[StageOfCell.model_validate(item) for item in items])


def _element(web: Path, stage: str) -> str | None:
    """Return the address of what a stage draws itself in the page; most draw nothing."""
    script = web / "stages" / stage / "index.js"
    return f"/web/stages/{stage}/index.js" if script.is_file() else None


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
        "settings": _NO_STAGE_SETTINGS if stage.settings_field is None else _settings(stage.settings_field),
        "layers": list(stage.layers),
    }


def _settings(field: str) -> dict[str, Any]:
    """Return the JSON Schema of the record that a field of the cell holds."""
    kind: Any = Cell.model_fields[field].annotation
    for record in getattr(kind, "__args__", (kind,)):  # a field that may be left out is a union with None
        if isinstance(record, type) and issubclass(record, BaseModel):
            return record.model_json_schema()
    raise TypeError(f"cell.{field} is no record")
