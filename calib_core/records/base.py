"""What records are made of: names, numbers with limits, a frozen base that keeps fields it does not know."""

from collections.abc import Mapping
from math import isnan, nan
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    PlainSerializer,
    StringConstraints,
    ValidationError,
)
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from calib_core import steps
from calib_core.poses.conventions import CONVENTIONS
from calib_core.records.field_errors import SMALLEST, input_error
from calib_core.records.strict_fields import require_known_fields, unknown_within

FORMAT = "scancell-session/1"
Kind = Literal["frame", "profile", "cloud", "sweep", "center"]
Verdict = Literal["pass", "warn", "fail"]
if TYPE_CHECKING:
    PoseConvention = str
else:
    PoseConvention = Literal[tuple(CONVENTIONS)]  # whatever the robots' registry has
Identifier = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]
_LARGEST = 1e20  # more is no quantity of a cell; its square is still a number, and moments in nanoseconds fit


def _no_switch(value: object) -> object:
    """Refuse true and false, which would be taken for 1 and 0."""
    if isinstance(value, bool):
        raise PydanticCustomError("float_type", "Input should be a valid number")
    return value


_NUMBER = BeforeValidator(_no_switch)
Positive = Annotated[float, Field(ge=SMALLEST, le=_LARGEST, allow_inf_nan=False), _NUMBER]
NotNegative = Annotated[float, Field(ge=0, le=_LARGEST, allow_inf_nan=False), _NUMBER]
Finite = Annotated[float, Field(ge=-_LARGEST, le=_LARGEST, allow_inf_nan=False), _NUMBER]
Vector3 = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Matrix4 = Annotated[
    list[Annotated[list[Finite], Field(min_length=4, max_length=4)]], Field(min_length=4, max_length=4)
]
Rows = list[list[float]]
ResultsData = Mapping[str, Mapping[str, Any]]
"""Results as JSON data, by stage."""
Open = Annotated[
    float,
    BeforeValidator(lambda number: nan if number is None else number, json_schema_input_type=float | None),
    PlainSerializer(lambda number: None if isnan(number) else number, return_type=float | None),
]
"""A number that is not determined where it is null: NaN inside."""
OpenVector3 = Annotated[list[Open], Field(min_length=3, max_length=3)]
OpenMatrix4 = Annotated[
    list[Annotated[list[Open], Field(min_length=4, max_length=4)]], Field(min_length=4, max_length=4)
]
OpenRows = list[list[Open]]


def mismatch(need: str, got: str, to_do: str) -> ValueError:
    """Return what a validator raises: `input_error_from_details` takes the three parts out again."""
    return ValueError(f"need {need}, got {got}. {to_do}", need, got, to_do)


def require_inside(name: str) -> None:
    """Refuse a file's name that leads out of the session's folder."""
    outside = not name or name.startswith("/") or ".." in name.split("/")
    if outside or "\\" in name or "\0" in name or ":" in name:
        raise mismatch("a file inside the session folder", repr(name)[:80], "Copy it into captures/.")


class _Registered:
    """Marks a name that the registry of stages must know; the JSON Schema lists the names there are."""

    def __init__(self, function: str) -> None:
        self._function = function

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self._check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {**handler(schema), "enum": list(self._names())}

    def _check(self, name: str) -> str:
        names = self._names()
        if name not in names:
            raise mismatch(
                "one of " + ", ".join(f"'{known}'" for known in names), repr(name), "Correct this field."
            )
        return name

    def _names(self) -> tuple[str, ...]:
        return getattr(steps, self._function)()


StepName = Annotated[str, _Registered("step_names")]
"""The name of a step that captures are taken for."""

PlannedStep = Annotated[str, _Registered("planned_steps")]
"""A step for whose captures poses are planned."""

StageName = Annotated[str, _Registered("stage_names")]
"""The name of a stage."""

GuidedStep = Annotated[str, _Registered("guided_steps")]
"""The name of a step of the guide."""


class Record(BaseModel):
    """A frozen record that keeps fields it does not know."""

    model_config = ConfigDict(frozen=True, extra="allow")

    def to_json(self) -> dict[str, Any]:
        """Return the record as plain JSON data, without the fields that were left out."""
        return self.model_dump(mode="json", exclude_unset=True)

    def unknown_fields(self) -> list[str]:
        """Return the names in this record that the format does not know (typing errors, or newer fields)."""
        return sorted(self.model_extra or {})


class WrittenRecord(Record):
    """A record that people write in their own programs, refused there as a file or a request would be.

    Raises
    ------
    InputError
        If a field is none, or unknown: a typing error would have no effect, and nobody would know.
    """

    if not TYPE_CHECKING:  # type checkers make the arguments of the fields

        def __init__(self, **fields: Any) -> None:
            where = type(self).__name__
            try:
                super().__init__(**fields)
            except ValidationError as error:
                raise input_error(error, fields, where) from None
            # Records that are put into this one have been asked already, or come from a file.
            kept = {path for name, value in fields.items() for path, _ in unknown_within(value, f"{name}.")}
            require_known_fields(self, where, kept)

        # pydantic makes records of JSON data without it: other versions' fields are kept there.
        __init__.__pydantic_base_init__ = True
