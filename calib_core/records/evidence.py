"""What a result says of itself: a short list of blocks, which terminal, HTML and page draw with one renderer each.

Numbers carry the decimals they are shown with, so that they read alike everywhere; uncertainties are expanded
(k = 2, about 95 %).  How blocks are made is in `calib_core.evidence`.
"""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from calib_core.messages import message
from calib_core.records.base import Finite, Matrix4, Record, Rows, Verdict, mismatch


class Quantity(Record):
    """A number as it is shown: with `decimals` digits after the point, its unit and its expanded uncertainty.

    `value` is None where there is none.
    """

    value: Finite | None
    unit: str = ""
    uncertainty: Finite | None = None
    decimals: int = 0


class Block(Record):
    """What every block has.

    A block with a `title` begins a section, to which the blocks after it belong.  `detail` marks what is shown on
    demand; `id` names a block that a page may replace by an element of its own.
    """

    id: str | None = None
    title: str | None = None
    detail: bool = False

    def model_post_init(self, _context: Any) -> None:
        """Keep the block's kind in its JSON, where fields that were not set are left out."""
        self.__pydantic_fields_set__.add("kind")


class Figure(Block):
    """One number with its label; figures that follow each other make one list.

    `headline` marks what stands first and in summaries; `limit` is what the number is held against, `remark` a
    word on it ("estimated from the data"), `text` stands in the number's place where there is no single number.
    """

    kind: Literal["figure"] = "figure"
    label: str
    quantity: Quantity | None = None
    text: str | None = None
    limit: Quantity | None = None
    limit_label: str | None = None
    remark: str | None = None
    headline: bool = False


class FrameNumber(Record):
    """One number of a frame in a controller's convention."""

    label: str
    quantity: Quantity


class Frame(Block):
    """A transform into_from_outof with its covariance (6, 6; rx ry rz tx ty tz, rad and mm).

    `numbers` are what is typed into the controller, in the session's `convention`, whose `units` and `formula`
    say what they mean; where that is the matrix itself, they are its translation.
    """

    kind: Literal["frame"] = "frame"
    name: str
    into: str
    outof: str
    matrix: Matrix4
    covariance: Rows | None = None
    convention: str
    units: str = ""
    formula: str = ""
    numbers: list[FrameNumber] = Field(default_factory=list)


class Column(Record):
    """A table's column, with unit and decimals of its plain numbers.

    `own` is whether its texts are names and words of people, which stand as they are in every language.
    """

    label: str
    unit: str = ""
    decimals: int = 0
    align: Literal["left", "right"] = "right"
    own: bool = False


class Row(Record):
    """A table's row: texts, numbers (a quantity brings its own unit), or None where there is nothing.

    `capture` names the capture that it is about; a row that is not `used` is crossed out, with its `reason`.
    """

    cells: list[str | Finite | Quantity | None]
    capture: str | None = None
    used: bool = True
    reason: str | None = None


class Table(Block):
    """Rows under columns; the first column heads its row.  `caption` says what the table shows."""

    kind: Literal["table"] = "table"
    caption: str = ""
    columns: list[Column]
    rows: list[Row]

    @model_validator(mode="after")
    def _require_whole_rows(self) -> Self:
        for row in self.rows:
            if len(row.cells) != len(self.columns):
                raise mismatch(
                    message("{count} cells in every row", count=len(self.columns)),
                    str(len(row.cells)),
                    "Solve it again.",
                )
        return self


class Axis(Record):
    """A plot's axis: what it shows, in which unit, and from where to where (None: as far as the points go)."""

    label: str
    unit: str = ""
    low: Finite | None = None
    high: Finite | None = None


class Series(Record):
    """Points of one kind: `x` (empty: 0, 1, 2, …) and `y`, None where there is no value.

    `captures` names each point's capture; `reasons` says why a point was rejected, None where it was not.  In a
    grid each series is one row of cells, from the top.
    """

    label: str = ""
    x: list[Finite] = Field(default_factory=list)
    y: list[Finite | None]
    captures: list[str] = Field(default_factory=list)
    reasons: list[str | None] = Field(default_factory=list[str | None])

    @model_validator(mode="after")
    def _require_one_each(self) -> Self:
        for name, given in (("x", self.x), ("captures", self.captures), ("reasons", self.reasons)):
            if given and len(given) != len(self.y):
                raise mismatch(
                    message("{count} {name}, one for each y", count=len(self.y), name=name),
                    str(len(given)),
                    "Solve it again.",
                )
        return self


class Band(Record):
    """Where points are expected on the y axis."""

    low: Finite
    high: Finite
    label: str


class Plot(Block):
    """A picture of numbers; `caption` says what it shows and how to read it.

    `shape`: `captures` (a dot a capture in their order), `line`, `xy` (dots), `histogram` (x the bins' lower
    edges, y the counts), `grid` (cells shaded by their value) or `section` (both axes to one scale: the first
    series is an outline, broken where y is None, the others are dots).
    """

    kind: Literal["plot"] = "plot"
    shape: Literal["captures", "line", "xy", "histogram", "grid", "section"]
    caption: str
    x: Axis
    y: Axis
    series: list[Series]
    band: Band | None = None


class Picture(Block):
    """A picture: a named `drawing` of a stage, or a `file` of a `capture`.  `alt` says what there is to see."""

    kind: Literal["picture"] = "picture"
    drawing: str | None = None
    capture: str | None = None
    file: str | None = None
    alt: str


class Note(Block):
    """A sentence or two; `level` is a verdict where it carries one."""

    kind: Literal["note"] = "note"
    text: str
    level: Verdict | Literal["info"] = "info"


AnyBlock = Annotated[Figure | Frame | Table | Plot | Picture | Note, Field(discriminator="kind")]
